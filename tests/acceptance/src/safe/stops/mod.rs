//! Stops and speed changes at every period, on motions with steps of jerk.

mod drive;
mod extrapolating_law;
mod judge;
mod live;
mod motions;
mod premise;

use anyhow::Context;
use drive::{Before, Run, stop_everywhere};
use pcc_model::Robot;
use premise::{ON_PATH_RAD, ROUNDING, have_jerk_steps};
use tests::programs::repository;

use crate::report::Report;
use crate::scale::Scale;

/// Periods, ns: 4 kHz, 1 kHz, 400 Hz, 100 Hz.
const PERIODS_NS: [i64; 4] = [250_000, 1_000_000, 2_500_000, 10_000_000];
/// Rounding of positions ÷ the square of the shortest cycle, ÷ the acceleration limit.
const DIFFERENCE_ROUNDING: f64 = 1.0 + 1e-5;
/// The median stop, of what it took with the extrapolating law.
const LONGEST_MEDIAN: f64 = 1.05;

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "acceptance safe, stops";
    report.group("stops", command, |report| simulated(report, scale));
    report.group("stops, live", command, |report| live::run(report, scale));
}

fn simulated(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let robot = Robot::from_file(&repository().join("config/robots/unit.toml"))?;
    let unit_robot = robot.to_unit().context("equal sections are needed")?;
    let motions = motions::planned(unit_robot, scale.pick(8, 50))?;
    have_jerk_steps(report, "defect 1", &robot, &motions);
    let orders = scale.pick(1_000, 26_000);
    let mut all = Run::default();
    for period_ns in PERIODS_NS {
        let run = stop_everywhere(&robot, &motions, period_ns, orders)?;
        let figure = format!(
            "{} stops, {} speed changes, {} let go; largest acceleration sent {:.7} of the limit",
            run.stops,
            run.speed_changes,
            run.let_go.len(),
            run.figures.acceleration,
        );
        let name = format!("stops at {} ms, jittered and late", period_ns as f64 * 1e-6);
        report.shown(&name, figure);
        for before in Before::ALL {
            let name = format!(
                "defect 1: {name}, {}: median ÷ that of the extrapolating law, same motions and instants",
                before.text()
            );
            report.at_most(&name, run.median_ratio(before), LONGEST_MEDIAN);
        }
        all.merge(run);
    }
    judge(
        report,
        &all,
        orders * PERIODS_NS.len(),
        scale.pick(3_600, 100_000),
    );
    Ok(())
}

fn judge(report: &mut Report, all: &Run, trials: usize, least: usize) {
    let figure = format!(
        "{} stops, {} speed changes; {} motions of {trials} had ended before their stop",
        all.stops,
        all.speed_changes,
        trials - all.stops
    );
    let bar = format!(">= {least} stops");
    let enough = all.stops >= least;
    let name = "defect 1: stops and speed changes ordered while motions with steps of jerk go on";
    report.check(name, figure, &bar, enough);
    report.none_of(
        "defect 1: robots let go by a stop or a speed change",
        &all.let_go,
    );
    report.none_of("defect 1: stops that did not come to rest", &all.unrested);
    let figures = &all.figures;
    let at_most = [
        ("velocity sent ÷ limit", figures.velocity, ROUNDING),
        ("acceleration sent ÷ limit", figures.acceleration, ROUNDING),
        ("step ÷ time ÷ velocity limit", figures.step, ROUNDING),
        (
            "velocity step ÷ time ÷ acceleration limit",
            figures.velocity_step,
            ROUNDING,
        ),
        (
            "second difference of positions ÷ acceleration limit",
            figures.second_difference,
            DIFFERENCE_ROUNDING,
        ),
        (
            "distance from the path, rad",
            figures.off_path_rad,
            ON_PATH_RAD,
        ),
        ("path time ahead of the clock, s", figures.ahead_s, 1e-9),
    ];
    for (what, figure, bar) in at_most {
        let name = format!("defect 1: stops, {} cycles: {what}", figures.cycles);
        report.at_most(&name, figure, bar);
    }
}
