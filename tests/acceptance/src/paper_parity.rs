//! The network, its gradient and its samples against what PyTorch made of the same numbers.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::ensure;
use tests::programs::repository;

use crate::geometry::test_counts;
use crate::paper_python::reference_python;
use crate::report::Report;
use crate::runs::folder;

/// Largest relative error against PyTorch, f32.
const TOLERANCE: f64 = 1e-4;
/// What the tests write before the name and the figure of a comparison.
const MARK: &str = "parity of ";

pub(crate) fn run(report: &mut Report) {
    let command = "cargo test --release -p denoiser --lib unet:: -- --nocapture";
    report.group("parity of the network", command, |report| {
        compare(report, &NETWORK, None)
    });
    let command = "scripts/fixtures_unet.py --width 64 --context 256 --graph 128; UNET_FIXTURE=… cargo test …";
    report.group("parity of the network, width 64", command, |report| {
        compare(report, &NETWORK, Some(&fixture_of_full_width()?))
    });
    let command =
        "cargo test --release -p planning --lib samples_are_those_of_pytorch -- --nocapture";
    report.group("parity of the samples", command, |report| {
        compare(report, &SAMPLES, None)
    });
}

/// Fresh random weights of the paper's size, and what PyTorch makes of them.
fn fixture_of_full_width() -> anyhow::Result<PathBuf> {
    let out = folder().join("paper-unet-64");
    let mut command = Command::new(reference_python()?);
    command.arg(repository().join("scripts/fixtures_unet.py"));
    command.args(["--width", "64", "--context", "256", "--graph", "128"]);
    let status = command.arg("--out").arg(&out).status()?;
    ensure!(status.success(), "scripts/fixtures_unet.py failed");
    Ok(out)
}

/// Tests that print what they compare.
struct Comparisons {
    package: &'static str,
    tests: &'static str,
    /// Comparisons that there are.
    least: usize,
}

const NETWORK: Comparisons = Comparisons {
    package: "denoiser",
    tests: "unet::",
    least: 26,
};
const SAMPLES: Comparisons = Comparisons {
    package: "planning",
    tests: "samples_are_those_of_pytorch",
    least: 6,
};

/// Runs tests, with another fixture than the committed one if one is given, and shows the largest error of each comparison.
fn compare(
    report: &mut Report,
    comparisons: &Comparisons,
    fixture: Option<&Path>,
) -> anyhow::Result<()> {
    let Comparisons {
        package,
        tests,
        least,
    } = *comparisons;
    eprintln!("  building and running tests of {package}");
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command
        .current_dir(repository())
        .args(["test", "--release", "--locked", "-p", package, "--lib"])
        .args([tests, "--", "--nocapture", "--test-threads=1"]);
    if let Some(fixture) = fixture {
        command.env("UNET_FIXTURE", fixture);
    }
    let output = command.output()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let counts: Vec<[usize; 2]> = text.lines().filter_map(test_counts).collect();
    ensure!(
        counts.iter().any(|[passed, failed]| passed + failed > 0),
        "no tests ran: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    let size = fixture.map_or("", |_| ", width 64");
    for (name, error) in largest_errors(&text) {
        report.at_most(
            &format!("parity with PyTorch{size}, {name}"),
            error,
            TOLERANCE,
        );
    }
    let compared = largest_errors(&text).len();
    let name = format!("parity with PyTorch{size}: tests of {package} that hold it");
    let figure = format!(
        "{compared} comparisons, {}",
        if output.status.success() {
            "passed"
        } else {
            "failed"
        }
    );
    let bar = format!("at least {least} comparisons, passed");
    report.check(
        &name,
        figure,
        &bar,
        output.status.success() && compared >= least,
    );
    Ok(())
}

/// Of lines with `parity of NAME: 1.2e-7`, the largest figure of each name.
fn largest_errors(text: &str) -> BTreeMap<&str, f64> {
    let mut errors = BTreeMap::new();
    for line in text.lines() {
        let compared = line
            .split_once(MARK)
            .and_then(|(_, rest)| rest.rsplit_once(": "));
        let Some((name, Ok(error))) = compared.map(|(name, figure)| (name, figure.parse())) else {
            continue;
        };
        let largest = errors.entry(name).or_insert(0.0_f64);
        // An error that is not a number stays, and fails.
        *largest = if error > *largest || f64::is_nan(error) {
            error
        } else {
            *largest
        };
    }
    errors
}

#[cfg(test)]
mod unit {
    use super::*;

    #[test]
    fn the_largest_error_of_each_name_is_found_in_the_tests_output() {
        let text = "test unet::a ... parity of stem: 1.0e-7\nparity of up.1.grow: 2e-6\nparity of stem: 3e-7\nok\nnoise: 1";
        let expected = BTreeMap::from([("stem", 3e-7), ("up.1.grow", 2e-6)]);
        assert_eq!(largest_errors(text), expected);
        assert!(largest_errors("parity of a: NaN\nparity of a: 1")["a"].is_nan());
    }
}
