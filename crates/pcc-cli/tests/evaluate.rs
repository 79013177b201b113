//! `pcc evaluate` as its users call it.
#![allow(clippy::unwrap_used)] // tests

mod pcc;

use datasets::{ArchiveReader, ArchiveWriter};
use denoiser::Manifest;
use pcc::{empty_folder, fixture, pcc, repository, said};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use std::process::Output;

fn evaluate(out: &Path, planner: &str, more: &[&str]) -> Output {
    evaluate_with(&fixture(), out, planner, more)
}

fn evaluate_with(weights: &str, out: &Path, planner: &str, more: &[&str]) -> Output {
    let out = out.display().to_string();
    let robot = repository("config/robots/unit.toml");
    let dataset = repository("tests/data/reference-mixed-sample");
    let mut words = vec!["evaluate", "--planner", planner, "--dataset", &dataset];
    words.extend(["--robot", &robot, "--weights", weights, "--out", &out]);
    words.extend(["--candidates", "1"]);
    if !more.contains(&"--proposals") {
        words.extend(["--cases", "1"]);
    }
    words.extend(more);
    let words: Vec<String> = words.into_iter().map(str::to_owned).collect();
    pcc(&words)
}

fn result(out: &Path) -> Value {
    let text = fs::read_to_string(out.join("result.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

#[test]
fn a_result_says_which_model_was_sampled_and_how() {
    let out = empty_folder("evaluate-record");
    let more = [
        "--model",
        "sampled",
        "--solver",
        "dpm-solver",
        "--steps",
        "50",
    ];
    let output = evaluate(&out, "diffusion", &more);
    assert!(output.status.success(), "{}", said(&output));
    let manifest = Manifest::open(Path::new(&fixture())).unwrap();
    let entry = manifest.entry("sampled").unwrap();
    let expected = json!({
        "model": "sampled",
        "sha256": entry.sha256,
        "updates": entry.updates,
        "steps": 50,
        "evaluations": 49,
        "solver": "dpm-solver",
        "precision": "f32",
    });
    assert_eq!(result(&out)["diffusion"], expected);
    let output = evaluate(&out, "straight", &[]);
    assert!(output.status.success(), "{}", said(&output));
    assert_eq!(result(&out)["diffusion"], Value::Null);
    assert_eq!(result(&out)["fast"], Value::Null);
}

#[test]
fn the_few_step_model_is_named_and_sampled_as_often_as_asked() {
    let weights = repository("crates/denoiser/tests/fixtures");
    let manifest = Manifest::open(Path::new(&weights)).unwrap();
    let entry = manifest.entry("tiny").unwrap();
    let mut drawn = Vec::new();
    for (more, evaluations) in [(&[][..], 2), (&["--evaluations", "4"], 4)] {
        let out = empty_folder(&format!("evaluate-fast-{evaluations}"));
        let output = evaluate_with(
            &weights,
            &out,
            "fast",
            &[&["--model", "tiny"], more].concat(),
        );
        assert!(output.status.success(), "{}", said(&output));
        let expected = json!({
            "model": "tiny",
            "sha256": entry.sha256,
            "updates": entry.updates,
            "evaluations": evaluations,
        });
        assert_eq!(result(&out)["fast"], expected);
        let mut archive = ArchiveReader::open(&out.join("paths.npz")).unwrap();
        drawn.push(archive.read::<f64>("sampled").unwrap().0);
    }
    assert_ne!(drawn[0], drawn[1]);
}

/// Writes an archive of paths all of whose numbers are one value.
fn propose(file: &str, shape: &[usize], value: f64) {
    let mut writer = ArchiveWriter::create(Path::new(file)).unwrap();
    let values = vec![value; shape.iter().product()];
    writer.write("paths", shape, values).unwrap();
    writer.finish().unwrap();
}

#[test]
fn paths_of_another_program_are_judged_as_those_of_the_planners() {
    let straight = empty_folder("evaluate-proposed-straight");
    let output = evaluate(&straight, "straight", &[]);
    assert!(output.status.success(), "{}", said(&output));
    assert_eq!(
        result(&straight)["share_delivered"],
        1.0,
        "the paths are good"
    );
    let archive = straight.join("paths.npz").display().to_string();
    let out = empty_folder("evaluate-proposed");
    let output = evaluate(&out, "proposed", &["--proposals", &archive]);
    assert!(output.status.success(), "{}", said(&output));
    assert_eq!(result(&out)["share_before_fallback"], 1.0);
    assert_eq!(result(&out)["cases"], 1);
    let file = out.join("damaged.npz").display().to_string();
    for (shape, value, named) in [
        (
            [1, 2, 64, 6],
            0.0,
            "has shape [1, 2, 64, 6], [1, 1, 64, 6] is needed",
        ),
        ([1, 1, 64, 6], f64::NAN, "has the value NaN in case 0"),
    ] {
        propose(&file, &shape, value);
        let output = evaluate(&out, "proposed", &["--proposals", &file]);
        assert_eq!(output.status.code(), Some(1), "{}", said(&output));
        assert!(said(&output).contains(named), "{}", said(&output));
    }
    let many = out.join("many.npz").display().to_string();
    propose(&many, &[1000, 1, 64, 6], 0.0);
    for (planner, more, named) in [
        ("proposed", &[][..], "--planner proposed needs --proposals"),
        (
            "proposed",
            &["--proposals", &many],
            "is for 1000 cases; at most 60",
        ),
        (
            "straight",
            &["--proposals", &file],
            "goes with --planner proposed",
        ),
    ] {
        let output = evaluate(&out, planner, more);
        assert!(said(&output).contains(named), "{}", said(&output));
    }
}

#[test]
fn options_of_a_model_are_refused_where_nothing_reads_them_and_where_they_are_wrong() {
    let out = empty_folder("evaluate-refused");
    let classical = &["straight", "straight-drawn", "rrt-connect", "rrt-smooth"][..];
    let fast = &["fast", "default"][..];
    let by_steps = ["diffusion", "diffusion-post", "diffusion-guided"];
    for (option, value, planners) in [
        ("--model", "sampled", [classical, &["proposed"]].concat()),
        ("--evaluations", "2", [classical, &by_steps].concat()),
        ("--steps", "50", [classical, fast].concat()),
        ("--solver", "ddim", [classical, fast].concat()),
        ("--precision", "f32", [classical, fast].concat()),
    ] {
        for planner in planners {
            let output = evaluate(&out, planner, &[option, value]);
            let named = format!("{option} {value} is not read by --planner {planner}");
            assert_eq!(output.status.code(), Some(1), "{}", said(&output));
            assert!(said(&output).contains(&named), "{}", said(&output));
        }
    }
    for (option, value, status, named) in [
        ("--steps", "0", 2, "a whole number from 1 to 1000"),
        ("--steps", "1001", 2, "a whole number from 1 to 1000"),
        ("--solver", "euler", 2, "possible values: ddim, dpm-solver"),
        ("--precision", "f16", 2, "possible values: f32, bf16"),
        ("--model", "mixed", 1, "has no weights `mixed`"),
    ] {
        let output = evaluate(&out, "diffusion", &[option, value]);
        assert_eq!(output.status.code(), Some(status), "{}", said(&output));
        assert!(said(&output).contains(named), "{}", said(&output));
    }
    let weights = repository("crates/denoiser/tests/fixtures");
    for evaluations in ["0", "3"] {
        let more = ["--model", "tiny", "--evaluations", evaluations];
        let output = evaluate_with(&weights, &out, "fast", &more);
        assert_eq!(output.status.code(), Some(2), "{}", said(&output));
        let named = "possible values: 1, 2, 4, 8";
        assert!(said(&output).contains(named), "{}", said(&output));
    }
    assert!(!out.join("result.json").exists());
}
