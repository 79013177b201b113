//! `pcc compare` as its users call it.
#![allow(clippy::unwrap_used)] // tests

mod pcc;

use pcc::{empty_folder, pcc, repository, said};
use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Output;

fn compare(out: &Path, robot: &str, more: &[&str]) -> Output {
    let out = out.display().to_string();
    let words = [&["compare", "--robot", robot, "--out", &out], more].concat();
    let words: Vec<String> = words.into_iter().map(str::to_owned).collect();
    pcc(&words)
}

fn page(out: &Path) -> String {
    fs::read_to_string(out.join("index.html")).unwrap()
}

#[test]
fn a_run_goes_on_from_records_of_the_same_robot_and_cases_alone() {
    let folder = empty_folder("compare-goes-on");
    let (out, robot) = (folder.join("out"), repository("config/robots/unit.toml"));
    let sample = repository("tests/data/reference-mixed-sample");
    let of = |set: &str, cases: &str| {
        let more = [
            "--planners",
            "straight",
            "--against",
            "straight",
            "--sets",
            set,
        ];
        [&more[..], &["--cases", cases]].concat().join("|")
    };
    let run = |robot: &str, options: &str| {
        let output = compare(&out, robot, &options.split('|').collect::<Vec<_>>());
        (output.status.success(), said(&output))
    };
    let first = run(&robot, &of(&sample, "3"));
    assert!(first.0, "{}", first.1);
    let made = page(&out);
    let command = format!(
        "pcc compare --planners straight --cases 3 --against straight --robot {robot} --sets {sample} --out out/reference-mixed-sample"
    );
    assert!(made.contains(&command), "{made}");
    assert!(run(&robot, &of(&sample, "3")).0 && page(&out) == made);

    let other = folder.join("unit.toml").display().to_string();
    let text = fs::read_to_string(&robot).unwrap();
    fs::write(
        &other,
        text.replace("velocity_m_s = 0.0779", "velocity_m_s = 0.0778"),
    )
    .unwrap();
    let (is_taken, said) = run(&other, &of(&sample, "3"));
    assert!(
        !is_taken && said.contains("another run: robot_hash is"),
        "{said}"
    );
    let (is_taken, said) = run(&robot, &of(&sample, "2"));
    assert!(!is_taken && said.contains("of.cases_hash is"), "{said}");
    assert!(said.contains("of.cases is 3 there and 2 here"), "{said}");
}

#[test]
fn the_network_is_that_of_the_weights_that_are_named() {
    let folder = empty_folder("compare-network");
    let weights = folder.join("other & weights");
    symlink(fs::canonicalize(repository("weights")).unwrap(), &weights).unwrap();
    let out = folder.join("out");
    let weights = weights.display().to_string();
    let robot = repository("config/robots/unit.toml");
    let output = compare(
        &out,
        &robot,
        &["--figures", "network", "--weights", &weights],
    );
    assert!(output.status.success(), "{}", said(&output));
    let made = page(&out);
    assert!(made.contains("other &amp; weights/mixed.safetensors"));
    assert!(made.contains(&format!(
        "--weights '{}' --figures network",
        weights.replace('&', "&amp;")
    )));
    assert!(!made.contains("<h2"), "a figure alone was asked for");
}

#[test]
fn figures_do_not_go_with_sets_or_planners() {
    let folder = empty_folder("compare-figures");
    let robot = repository("config/robots/unit.toml");
    for (option, value) in [("--sets", "hard"), ("--planners", "fast")] {
        let output = compare(&folder, &robot, &["--figures", "network", option, value]);
        assert!(!output.status.success() && said(&output).contains(option));
    }
}

#[test]
fn what_does_not_go_together_is_refused_with_its_reason() {
    let folder = empty_folder("compare-refused");
    let robot = repository("config/robots/unit.toml");
    let sample = repository("tests/data/reference-mixed-sample");
    let twice = format!("{sample},{sample}");
    for (options, reason) in [
        (["--planners", "fast,apf,fast"], "--planners has fast twice"),
        (["--planners", "fast,proposed"], "--planners has proposed"),
        (
            ["--planners", "apf"],
            "--against fast is none of the planners that are compared: apf",
        ),
        (
            ["--figures", "network,steps,network"],
            "--figures has network twice",
        ),
        (
            ["--sets", &twice],
            "--sets has reference-mixed-sample twice",
        ),
    ] {
        let output = compare(&folder, &robot, &options);
        assert!(
            !output.status.success() && said(&output).contains(reason),
            "{}",
            said(&output)
        );
    }
}

#[test]
fn one_run_at_a_time_writes_to_a_folder() {
    let out = empty_folder("compare-alone");
    let robot = repository("config/robots/unit.toml");
    let held = fs::File::open(&out).unwrap();
    held.lock().unwrap();
    let output = compare(&out, &robot, &["--figures", "network"]);
    assert!(!output.status.success());
    assert!(
        said(&output).contains("another pcc compare writes to"),
        "{}",
        said(&output)
    );
}
