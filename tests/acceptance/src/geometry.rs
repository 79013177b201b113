//! Kinematics, tendons, arcs and certificates.

use anyhow::ensure;
use pcc_model::Robot;
use std::process::Command;
use tests::brute_force::Body;
use tests::geometry::{
    arc_error, certified_curves, certified_edges, golden_tip_error, jacobian_error,
    tendon_matrix_error,
};
use tests::programs::repository;

use crate::report::Report;
use crate::scale::Scale;

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "cargo test --release -p pcc-model -p collision";
    report.group("unit tests of the geometry", command, unit_tests);
    let command = "acceptance chain, geometry";
    report.group("kinematics", command, |report| kinematics(report, scale));
    report.group("certificate", command, |report| certificate(report, scale));
}

fn unit_tests(report: &mut Report) -> anyhow::Result<()> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let output = Command::new(cargo)
        .current_dir(repository())
        .args(["test", "--release", "--locked", "--no-fail-fast"])
        .args(["-p", "pcc-model", "-p", "collision"])
        .output()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let counts: Vec<[usize; 2]> = text.lines().filter_map(test_counts).collect();
    let [passed, failed] = [0, 1].map(|which| counts.iter().map(|c| c[which]).sum::<usize>());
    ensure!(
        passed + failed > 0,
        "no tests ran: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    report.check(
        "tests of pcc-model and collision",
        format!("{passed} passed, {failed} failed"),
        "none failed",
        failed == 0 && output.status.success(),
    );
    Ok(())
}

/// Of `test result: ok. 12 passed; 0 failed; …`.
pub(crate) fn test_counts(line: &str) -> Option<[usize; 2]> {
    let counts = line.strip_prefix("test result: ")?;
    let number = |before: &str| {
        let words: Vec<&str> = counts.split([' ', ';']).collect();
        let at = words.iter().position(|word| *word == before)?;
        words.get(at.checked_sub(1)?)?.parse().ok()
    };
    Some([number("passed")?, number("failed")?])
}

fn robot(name: &str) -> anyhow::Result<Robot> {
    let file = repository().join("config/robots").join(name);
    Ok(Robot::from_file(&file)?)
}

fn kinematics(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let (unit, authors) = (robot("unit.toml")?, robot("authors-42mm.toml")?);
    report.at_most(
        "golden tip of three sections, error m",
        golden_tip_error(&unit),
        1e-8,
    );
    report.at_most(
        "authors' tendon matrix, largest difference mm/rad",
        tendon_matrix_error(&authors),
        5.1e-5,
    );
    let count = 10_000;
    let name = format!("Jacobian against eighth-order differences, {count} configurations");
    report.at_most(&name, jacobian_error(&unit, count, 1), 1e-9);
    let count = scale.pick(5_000, 20_000);
    let name = format!("arc distance against brute force, {count} points, error m");
    report.at_most(&name, arc_error(&unit, count, 1), 1e-9);
    Ok(())
}

fn certificate(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let unit = robot("unit.toml")?;
    let file = std::fs::read_to_string(repository().join("config/robots/unit.toml"))?;
    let body = Body::from_robot_file(&file);
    let edges = certified_edges(&unit, &body, scale.pick(4_000, 20_000), 1);
    let curves = certified_curves(&unit, &body, scale.pick(500, 2_000), 1);
    for (kind, found) in [("edges", edges), ("knot curves", curves)] {
        let name = format!("random {kind} certified and colliding");
        let figure = format!(
            "{} of {} ({} certified, {} colliding)",
            found.certified_and_colliding, found.tried, found.certified, found.colliding
        );
        let is_telling = found.certified > found.tried / 10 && found.colliding > found.tried / 10;
        let passed = found.certified_and_colliding == 0 && is_telling;
        report.check(&name, figure, "0, with a tenth of each kind", passed);
    }
    Ok(())
}

#[cfg(test)]
mod unit {
    use super::*;

    #[test]
    fn counts_are_read_from_the_result_line() {
        let line =
            "test result: FAILED. 12 passed; 3 failed; 0 ignored; 0 measured; 1 filtered out";
        assert_eq!(test_counts(line), Some([12, 3]));
        assert_eq!(test_counts("test geometry ... ok"), None);
    }
}
