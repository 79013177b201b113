//! Requests that nobody can solve: how long it takes to say so.

use datasets::scenes::Setting;
use pcc_model::UnitRobot;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use shared_types::codes::Sampler;
use shared_types::valid::PlanRequest;
use tests::world::shipped_number;

use crate::fast_random::make_infeasible;
use crate::fast_scenes::{Served, requests};
use crate::fast_turns::{SAMPLERS, Times, in_turns};
use crate::report::Report;
use crate::scale::Scale;

/// An answer may be this much later than its deadline.
const LATE_AT_MOST_MS: f64 = 1.0;

/// What default takes for the requests that no sampler has a candidate for: without a deadline they are among all the others; with the
/// shipped one, their answers must be in time.
pub(crate) fn that_nobody_solves(
    report: &mut Report,
    name: &str,
    served: &mut Served,
    unsolved: &[&PlanRequest],
) -> anyhow::Result<()> {
    let deadline_ms = shipped_number("planner-daemon.toml", "default_deadline_ms");
    let mut times = Times::default();
    let mut late = Vec::new();
    for request in unsolved {
        let as_shipped = PlanRequest {
            deadline: None,
            ..(*request).clone()
        };
        let (answer, seconds) = served.ask(&as_shipped)?;
        times.add(&answer, seconds);
        let ms = 1e3 * seconds;
        if ms > deadline_ms + LATE_AT_MOST_MS {
            late.push(format!("seed {}: {ms:.2} ms", request.seed));
        }
    }
    let line = format!(
        "latency, {name}: {} requests that no sampler solves, answers of default later than the shipped {deadline_ms} ms by more than {LATE_AT_MOST_MS} ms",
        unsolved.len()
    );
    // Of no requests nothing can be late.
    if unsolved.is_empty() {
        report.shown(&line, "nothing was asked".to_owned());
        return Ok(());
    }
    report.none_of(&line, &late);
    let line =
        format!("latency, {name}: default, what no sampler solves, with the shipped deadline");
    report.shown(&line, times.text());
    Ok(())
}

/// Requests made infeasible, and those that nobody solves among as many in scenes of 32 balls.
pub(crate) fn infeasible(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let name = "infeasible";
    let mut served = Served::start(Vec::new())?;
    let wanted = scale.pick(30, 300);
    let robot = served.world.unit_robot();
    let made = made_infeasible(&robot, wanted);
    let turns = in_turns(&mut served, &made, 1)?;
    let unsolved = turns.unsolved(&made);
    let line = format!(
        "latency, {name}: requests out of reach, blocked at their start or goal, or bent too far, that no sampler solves"
    );
    report.all_of(&line, unsolved.len(), wanted);
    for sampler in SAMPLERS {
        let line = format!("latency, {name}: {sampler}, end to end, without a deadline");
        report.shown(&line, turns.times(sampler).text());
    }
    that_nobody_solves(report, name, &mut served, &unsolved)?;
    let crowded: Vec<PlanRequest> = requests(&robot, Setting::General(Some(32)))
        .take(wanted)
        .collect();
    let turns = in_turns(&mut served, &crowded, wanted)?;
    let unsolved = turns.unsolved(&crowded);
    let name = format!("{name}, 32 balls as drawn");
    let line =
        format!("latency, {name}: default, end to end, all {wanted} requests, without a deadline");
    report.shown(&line, turns.times(Sampler::Default).text());
    turns.show_missed(report, &name);
    let line = format!("latency, {name}: requests that no sampler solves");
    let count = unsolved.len();
    report.check(&line, format!("{count} of {wanted}"), "> 0", count > 0);
    that_nobody_solves(report, &name, &mut served, &unsolved)
}

fn made_infeasible(robot: &UnitRobot, count: usize) -> Vec<PlanRequest> {
    let mut rng = Pcg64::seed_from_u64(0);
    let spoiled = |mut request: PlanRequest| {
        make_infeasible(&mut request, &mut rng);
        request
    };
    let feasible = requests(robot, Setting::General(None)).take(count);
    feasible.map(spoiled).collect()
}
