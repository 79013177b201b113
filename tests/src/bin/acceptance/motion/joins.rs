//! Replans at random instants: continuity, limits, contacts, and what they win over stopping first.

use std::collections::BTreeMap;
use std::time::Instant;

use pcc_model::TendonLimits;
use shared_types::codes::LoopState;
use shared_types::message::Cycle;
use tests::brute_force::{Ball, Body, Tendons};
use tests::judge::{ALLOWED_USE, SENT_USE, Verdict};
use tests::knots::{largest_bending_rad, least_clearance_m, limit_use, state_at};
use tests::listener::{Heard, Published};
use tests::motion::raise;
use tests::replans::StopThenGo;
use tests::world::{Settings, shipped};

use super::replan_run::{Population, motion_of, run as replan};
use crate::report::Report;
use crate::scale::Scale;

/// A request whose motion was published.
#[derive(Clone, Copy)]
pub(super) struct Asked {
    pub(super) seed: u64,
    /// When the goal was given to the client.
    pub(super) at: Instant,
    /// The same by the clock of the messages, nanoseconds.
    pub(super) mono_ns: i64,
}

/// What replans showed.
#[derive(Default)]
pub(super) struct Figures {
    /// Requests in all.
    pub(super) requests: usize,
    /// Requests that found the robot in motion.
    pub(super) in_motion: usize,
    /// What was published, by id.
    pub(super) published: BTreeMap<u32, Asked>,
    /// From a request to the first set-point of the motion that joins another, ms, with the time at which it was asked for.
    pub(super) to_setpoint_ms: Vec<(Instant, f64)>,
    /// Refusals in motion by cause.
    pub(super) refusals: BTreeMap<String, usize>,
    /// Refusals at rest by cause: no replans.
    pub(super) refused_at_rest: BTreeMap<String, usize>,
    pub(super) scenes_passed_over: usize,
    /// Motions that left another one.
    pub(super) joined: usize,
    /// Of these, motions whose switch the loop passed.
    pub(super) switched: usize,
    /// Largest difference at a switch, rad, rad/s, rad/s².
    discontinuity: [f64; 3],
    limits_of_file: [f64; 3],
    /// Largest use of velocity, acceleration and jerk by knots of joined motions.
    limits: [f64; 3],
    largest_bending_rad: f64,
    /// Least clearance of joined motions and of executed set-points, m.
    clearance_m: [f64; 2],
    /// (stop-then-go − joined) ÷ the shortest stop.
    won: Vec<f64>,
    /// References without a motion.
    without_reference: usize,
    /// What was sent to the robot and done by it.
    pub(super) sent: Verdict,
}

impl Figures {
    /// None yet, of a robot with these tendon limits.
    pub(super) fn of(limits: &TendonLimits) -> Self {
        Self {
            limits_of_file: [limits.velocity, limits.acceleration, limits.jerk],
            clearance_m: [f64::INFINITY; 2],
            ..Self::default()
        }
    }

    /// Looks at motions and cycles that were heard in a scene.
    pub(super) fn look(&mut self, body: &Body, heard: &Heard, balls: &[Ball]) {
        for motion in &heard.motions {
            self.look_at_motion(body, motion, &heard.motions, balls);
        }
        for motion in heard.motions.iter().filter(|it| it.leaves.is_some()) {
            let Some(first_ns) = first_followed(&heard.cycles, motion.id) else {
                continue;
            };
            self.switched += 1;
            if let Some(asked) = self.published.get(&motion.id) {
                let took_ms = (first_ns - asked.mono_ns) as f64 * 1e-6;
                self.to_setpoint_ms.push((asked.at, took_ms));
            }
        }
        let setpoints: Vec<(i64, Tendons)> = heard
            .cycles
            .iter()
            .filter(|cycle| cycle.state == LoopState::Executing.code())
            .map(|cycle| (cycle.stamp_mono_ns, cycle.setpoint_m))
            .collect();
        let executed = body.least_clearance(&setpoints, |_| balls).at_least_m();
        lower(&mut self.clearance_m[1], executed);
    }

    fn look_at_motion(
        &mut self,
        body: &Body,
        motion: &Published,
        all: &[Published],
        balls: &[Ball],
    ) {
        let Some((left, at_s)) = motion.leaves else {
            return;
        };
        self.joined += 1;
        let before = motion_of(all, left).and_then(|left| state_at(&left.knots, at_s));
        let first = motion.knots.first().map(|knot| knot.values);
        for (order, figure) in self.discontinuity.iter_mut().enumerate() {
            let difference = match (before, first) {
                (Some(before), Some(first)) => (0..6)
                    .map(|i| (before[order][i] - first[order][i]).abs())
                    .fold(0.0, f64::max),
                _ => f64::NAN,
            };
            raise(figure, difference);
        }
        let used = limit_use(body, &motion.knots, &self.limits_of_file);
        for (figure, used) in self.limits.iter_mut().zip(used) {
            raise(figure, used);
        }
        raise(
            &mut self.largest_bending_rad,
            largest_bending_rad(&motion.knots),
        );
        let clearance = least_clearance_m(body, &motion.knots, balls) - body.chord_error_m();
        lower(&mut self.clearance_m[0], clearance);
    }

    /// Compares a joined motion with stopping first.
    pub(super) fn compare(&mut self, motion: &Published, reference: &StopThenGo) {
        let duration_s = motion.knots.last().map_or(f64::NAN, |knot| knot.time_s);
        match reference.go_s {
            Some(go_s) => {
                let won = reference.stop_s + go_s - duration_s;
                self.won.push(won / reference.stop_s);
            }
            None => self.without_reference += 1,
        }
    }
}

fn lower(figure: &mut f64, value: f64) {
    if value.is_nan() || value < *figure {
        *figure = value;
    }
}

/// Stamp of the first cycle that follows a motion, nanoseconds.
fn first_followed(cycles: &[Cycle], id: u32) -> Option<i64> {
    let first = cycles.iter().find(|cycle| cycle.trajectory_id == id)?;
    Some(first.stamp_mono_ns)
}

/// Bulk replans ten times as fast, and real ones.
pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "requests to planner-daemon from a moving robot";
    let bulk = Population {
        settings: Settings::ten_times_as_fast(),
        time_factor: 10.0,
        replans: scale.pick(400, 10_000),
        disturb: |_, _| (),
    };
    report.group("replans, ten times as fast", command, |report| {
        show(report, "ten times as fast", &replan(&bulk)?);
        Ok(())
    });
    let real = Population {
        settings: Settings::default(),
        time_factor: 1.0,
        replans: scale.pick(20, 100),
        disturb: |_, _| (),
    };
    report.group("replans, real", command, |report| {
        show(report, "real", &replan(&real)?);
        Ok(())
    });
}

/// The lines of a population.
pub(super) fn show(report: &mut Report, name: &str, figures: &Figures) {
    let line = |what: &str| format!("replans, {name}: {what}");
    let counts = format!(
        "{} requests found the robot in motion, of {} in all; {} motions joined another, {} of them were begun; refused in motion: {:?}; \
         refused at rest: {:?}; {} scenes in which the robot had no room were passed over",
        figures.in_motion,
        figures.requests,
        figures.joined,
        figures.switched,
        figures.refusals,
        figures.refused_at_rest,
        figures.scenes_passed_over
    );
    report.shown(&line("what was asked for"), counts);
    for (difference, unit) in figures.discontinuity.iter().zip(["rad", "rad/s", "rad/s²"]) {
        let what = format!("largest difference of both curves at the switch, {unit}");
        report.at_most(&line(&what), *difference, 1e-9);
    }
    let kinds = ["velocity", "acceleration", "jerk"];
    for (used, kind) in figures.limits.iter().zip(kinds) {
        let what = format!("largest use of the {kind} limit by joined motions, dense sampling");
        report.at_most(&line(&what), *used, SENT_USE);
    }
    let sent = &figures.sent;
    report.at_most(
        &line("set-points: velocity ÷ limit"),
        sent.velocity,
        SENT_USE,
    );
    let acceleration = sent.acceleration;
    report.at_most(
        &line("set-points: acceleration ÷ limit"),
        acceleration,
        SENT_USE,
    );
    let steps = sent.sent.position.max(sent.sent.velocity);
    report.at_most(
        &line("set-points: steps by differences ÷ limits"),
        steps,
        ALLOWED_USE,
    );
    let offences = format!("{} {:?}", sent.offence_count, sent.offences.first());
    report.check(
        &line("set-points: offences"),
        offences,
        "0",
        sent.offence_count == 0,
    );
    let bending = bending_limit_rad() + 5e-3;
    let largest = figures.largest_bending_rad;
    report.at_most(
        &line("largest bending of joined motions, rad"),
        largest,
        bending,
    );
    let [planned, executed] = figures.clearance_m;
    let touch = |clearance: f64| format!("{clearance:.5} m");
    report.check(
        &line("least clearance of joined motions, dense sampling"),
        touch(planned),
        ">= 0",
        planned >= 0.0,
    );
    report.check(
        &line("least clearance of what was executed, dense sampling"),
        touch(executed),
        ">= 0",
        executed >= 0.0,
    );
    wins(
        report,
        &line(
            "time won over a stop at the switch and the fastest of ten motions to the same goal configuration",
        ),
        figures,
    );
}

/// Against stop-then-go.
fn wins(report: &mut Report, name: &str, figures: &Figures) {
    // A replan that is refused wins nothing.
    let refused: usize = figures.refusals.values().sum();
    let mut won = figures.won.clone();
    won.extend(std::iter::repeat_n(0.0, refused));
    won.sort_by(f64::total_cmp);
    let at = |part: f64| {
        won.get((part * won.len() as f64) as usize)
            .copied()
            .unwrap_or(f64::NAN)
    };
    let later = won.iter().filter(|won| **won < -1e-6).count();
    let figure = format!(
        "median {:.3}, p10 {:.3}, p90 {:.3} of the shortest stop; {} compared, {} without a reference, {refused} refused count 0",
        at(0.5),
        at(0.1),
        at(0.9),
        figures.won.len(),
        figures.without_reference
    );
    report.check(name, figure, ">= 0.35", at(0.5) >= 0.35);
    let worst = won.first().copied().unwrap_or(f64::NAN);
    let figure = format!("{later} of {}, the worst {worst:.3}", won.len());
    report.check(&format!("{name}: arrivals later"), figure, "0", later == 0);
}

fn bending_limit_rad() -> f64 {
    let robot = shipped("robots/unit.toml");
    robot["bending_limit_rad"].as_float().unwrap_or(f64::NAN)
}
