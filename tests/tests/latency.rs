//! `pcc latency` against a daemon: its figures are those of its stamps, and what goes wrong has a name.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;
use std::time::Duration;

use serde_json::Value;
use tests::outside::pcc;
use tests::process::Process;
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::{Settings, World};

const LIMIT: Duration = Duration::from_secs(60);

/// A daemon, and a robot that is held, so that there is a loop.
fn stack() -> Stack {
    Stack::running(&Settings::default().patient()).unwrap()
}

fn measured(world: &World, file: &Path, arguments: &[&str]) -> Value {
    let mut all = vec![
        "latency",
        "--warm-up",
        "2",
        "--json",
        file.to_str().unwrap(),
    ];
    all.extend(arguments);
    let said = pcc(world, &all, LIMIT);
    assert!(said.is_good(), "{}", said.text);
    serde_json::from_str(&fs::read_to_string(file).unwrap()).unwrap()
}

/// Median of the last column less another one of the file of stamps, ms.
fn median_ms(stamps: &Path, from: usize) -> f64 {
    let text = fs::read_to_string(stamps).unwrap();
    let mut took: Vec<i64> = text
        .lines()
        .skip(1)
        .map(|line| {
            let columns: Vec<i64> = line.split(' ').map(|it| it.parse().unwrap()).collect();
            columns[2] - columns[from]
        })
        .collect();
    took.sort_unstable();
    took[(took.len() - 1) / 2] as f64 * 1e-6
}

#[test]
fn figures_are_those_of_the_stamps_in_a_closed_and_in_an_open_loop() {
    let stack = stack();
    let folder = tempfile::tempdir().unwrap();
    let [json, stamps] = ["figures.json", "stamps"].map(|name| folder.path().join(name));
    let stamps_file = stamps.to_str().unwrap();
    for pace in [&["--clients", "2"][..], &["--rate", "40"][..]] {
        let mut arguments = vec![
            "--requests",
            "41",
            "--candidates",
            "2",
            "--stamps",
            stamps_file,
        ];
        arguments.extend(pace);
        let figures = measured(&stack.world, &json, &arguments);
        assert_eq!(figures["plans"]["planned"], 41, "{figures}");
        assert_eq!(figures["plans"]["outcomes"]["ok"], 41, "{figures}");
        let told_ms = figures["plans"]["times_ms"]["round trip"]["p50"]
            .as_f64()
            .unwrap();
        let stamped_ms = median_ms(&stamps, 0);
        assert!(
            (told_ms / stamped_ms - 1.0).abs() < 2e-3,
            "{told_ms} for {stamped_ms}"
        );
        assert!(figures["controller_loop"]["cycles"].as_u64().unwrap() > 10);
        let processors = figures["machine"]["processors"].as_u64().unwrap();
        let governors = figures["machine"]["governors"].as_array().unwrap();
        assert!(processors > 0 && governors.len() as u64 == processors);
        let priorities = figures["priorities"].as_array().unwrap();
        assert_eq!(priorities.len(), 3, "{figures}");
        for process in priorities {
            assert!(!process["threads"].as_array().unwrap().is_empty());
        }
    }
    let text = pcc(
        &stack.world,
        &[
            "latency",
            "--requests",
            "5",
            "--compare",
            json.to_str().unwrap(),
        ],
        LIMIT,
    );
    assert!(
        text.is_good() && text.text.contains("now ÷ then"),
        "{}",
        text.text
    );
}

#[test]
fn a_load_beyond_the_daemon_counts_from_when_it_was_due() {
    let stack = stack();
    let folder = tempfile::tempdir().unwrap();
    let json = folder.path().join("figures.json");
    let figures = measured(
        &stack.world,
        &json,
        &["--requests", "60", "--rate", "100000", "--candidates", "10"],
    );
    let times = &figures["plans"]["times_ms"];
    let late = times["late to be sent"]["max"].as_f64().unwrap();
    let longest = times["round trip"]["max"].as_f64().unwrap();
    assert!(late > 1.0 && longest > late, "{figures}");
}

#[test]
fn a_controller_that_dies_under_the_load_is_told() {
    let mut stack = stack();
    let load = ["latency", "--rate", "10", "--requests", "60"];
    let mut measuring = Process::start(&stack.world, "pcc", &load);
    std::thread::sleep(Duration::from_secs(3));
    stack.kill9(Part::Controller);
    let status = measuring.wait(LIMIT).unwrap();
    let said = measuring.log();
    let is_told = said.contains("the controller ended under the load");
    assert!(!status.success() && is_told, "{said}");
}

#[test]
fn without_a_daemon_and_with_a_bad_file_it_says_so() {
    let world = World::new(&Settings::default());
    let said = pcc(&world, &["latency"], LIMIT);
    assert!(
        !said.is_good() && said.text.contains("planner-daemon"),
        "{}",
        said.text
    );
    let mut stack = Stack::within(world);
    stack.start(Part::Daemon);
    stack.client.wait_for_daemon(PATIENCE).unwrap();
    let empty = stack.world.folder().join("empty.json");
    fs::write(&empty, "").unwrap();
    let files = [
        (empty.to_str().unwrap(), "no JSON"),
        ("/dev/zero", "a regular file is needed"),
    ];
    for (file, why) in files {
        let said = pcc(&stack.world, &["latency", "--compare", file], LIMIT);
        let is_refused = !said.is_good() && said.text.contains(why);
        assert!(is_refused, "{}", said.text);
    }
}
