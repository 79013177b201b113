//! `pcc evaluate` as its users call it.
#![allow(clippy::unwrap_used)] // tests

mod pcc;

use denoiser::Manifest;
use pcc::{empty_folder, fixture, pcc, repository, said};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use std::process::Output;

fn evaluate(out: &Path, planner: &str, more: &[&str]) -> Output {
    let out = out.display().to_string();
    let robot = repository("config/robots/unit.toml");
    let dataset = repository("tests/data/reference-mixed-sample");
    let weights = fixture();
    let mut words = vec!["evaluate", "--planner", planner, "--dataset", &dataset];
    words.extend(["--robot", &robot, "--weights", &weights, "--out", &out]);
    words.extend(["--cases", "1", "--candidates", "1"]);
    words.extend(more);
    let words: Vec<String> = words.into_iter().map(str::to_owned).collect();
    pcc(&words)
}

fn record(out: &Path) -> Value {
    let text = fs::read_to_string(out.join("result.json")).unwrap();
    let result: Value = serde_json::from_str(&text).unwrap();
    result["diffusion"].clone()
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
    assert_eq!(record(&out), expected);
    let output = evaluate(&out, "straight", &[]);
    assert!(output.status.success(), "{}", said(&output));
    assert_eq!(record(&out), Value::Null);
}

#[test]
fn options_of_the_diffusion_model_are_refused_where_nothing_reads_them_and_where_they_are_wrong() {
    let out = empty_folder("evaluate-refused");
    for planner in ["straight", "rrt-connect", "fast", "default"] {
        for (option, value) in [
            ("--model", "sampled"),
            ("--steps", "50"),
            ("--solver", "ddim"),
            ("--precision", "f32"),
        ] {
            let output = evaluate(&out, planner, &[option, value]);
            let named = format!("{option} is not read by --planner {planner}");
            assert_eq!(output.status.code(), Some(1), "{}", said(&output));
            assert!(said(&output).contains(&named), "{}", said(&output));
        }
    }
    for (option, value, status, named) in [
        ("--steps", "0", 1, "--steps 0: 1 to 1000"),
        ("--steps", "1001", 1, "--steps 1001: 1 to 1000"),
        ("--solver", "euler", 2, "ddim and dpm-solver are allowed"),
        ("--precision", "f16", 2, "f32 and bf16 are allowed"),
        ("--model", "mixed", 1, "has no weights `mixed`"),
    ] {
        let output = evaluate(&out, "diffusion", &[option, value]);
        assert_eq!(output.status.code(), Some(status), "{}", said(&output));
        assert!(said(&output).contains(named), "{}", said(&output));
    }
    assert!(!out.join("result.json").exists());
}
