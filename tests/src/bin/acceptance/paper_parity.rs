//! The network, its gradient and its samples against what PyTorch made of the same numbers.

use std::collections::BTreeMap;
use std::process::Command;

use anyhow::ensure;
use tests::programs::repository;

use crate::Report;
use crate::geometry::test_counts;

/// Largest relative error against PyTorch, f32.
const TOLERANCE: f64 = 1e-4;
/// What the tests write before the name and the figure of a comparison.
const MARK: &str = "parity of ";

pub(crate) fn run(report: &mut Report) {
    let command = "cargo test --release -p denoiser --lib unet:: -- --nocapture";
    report.group("parity of the network", command, |report| {
        compare(report, "denoiser", "unet::", 26)
    });
    let command =
        "cargo test --release -p planning --lib samples_are_those_of_pytorch -- --nocapture";
    report.group("parity of the samples", command, |report| {
        compare(report, "planning", "samples_are_those_of_pytorch", 6)
    });
}

/// Runs tests of a package and shows the largest error of each comparison that they print, of at least so many.
fn compare(report: &mut Report, package: &str, tests: &str, least: usize) -> anyhow::Result<()> {
    eprintln!("  building and running tests of {package}");
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .current_dir(repository())
        .args(["test", "--release", "--locked", "-p", package, "--lib"])
        .args([tests, "--", "--nocapture", "--test-threads=1"])
        .output()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let counts: Vec<[usize; 2]> = text.lines().filter_map(test_counts).collect();
    ensure!(
        counts.iter().any(|[passed, failed]| passed + failed > 0),
        "no tests ran: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    for (name, error) in largest_errors(&text) {
        report.at_most(&format!("parity with PyTorch, {name}"), error, TOLERANCE);
    }
    let compared = largest_errors(&text).len();
    let name = format!("parity with PyTorch: tests of {package} that hold it");
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
