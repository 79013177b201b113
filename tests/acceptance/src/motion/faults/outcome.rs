//! What a fault did: how both motions ended, how far the set-point moved until it rested, and where.

use pcc_model::Robot;
use shared_types::message::Cycle;
use tests::listener::Heard;
use tests::motion::raise;

use super::super::disturbed::named;
use super::super::figures::is_on_its_way;
use super::super::paths::{OffPath, path};
use super::stand::Joining;
use crate::safe::on_path::Along;

/// A set-point slower than this rests, m/s.
const AT_REST_M_S: f64 = 1e-6;

/// A controller that lives makes more than so many cycles in the first time after a fault, ns.
const LEAST_CYCLES: usize = 50;
const STILL_CONTROLLED_NS: i64 = 100_000_000;

/// What was seen of one fault.
#[derive(Debug, Default)]
pub(super) struct Outcome {
    /// How the motion that was to be left ended, and the one that was to be joined.
    pub(super) ends: [String; 2],
    /// The largest way of a tendon from the fault until rest, mm: of the set-points, or of the robot's own reference where the
    /// controller sends none.
    pub(super) moved_mm: f64,
    /// From the fault until rest, s.
    pub(super) rests_after_s: f64,
    /// Path time of the motion that was to be left from the fault to where it ended, s; none where it was not stopped on it.
    pub(super) path_time_s: Option<f64>,
    /// The largest distance of a set-point in motion from its path, rad; not a number where none was seen.
    pub(super) off_path_rad: f64,
}

/// The tendons at one instant.
struct Sample {
    stamp_ns: i64,
    position_m: [f64; 9],
    velocity_m_s: [f64; 9],
}

impl Outcome {
    pub(super) fn of(robot: &Robot, heard: &Heard, joining: &Joining, fault_ns: i64) -> Self {
        let ends = [joining.left, joining.joined].map(|id| {
            let results: Vec<String> = heard
                .results
                .iter()
                .filter(|result| result.trajectory_id == id)
                .map(named)
                .collect();
            if results.is_empty() {
                "no result".to_owned()
            } else {
                results.join(", then ")
            }
        });
        let mut off_path = OffPath::default();
        off_path.look(robot, heard);
        let (moved_mm, rests_after_s) = movement(&samples(heard, fault_ns), fault_ns);
        Self {
            ends,
            moved_mm,
            rests_after_s,
            path_time_s: path_time(robot, heard, joining.left, fault_ns),
            off_path_rad: match off_path.looked_at {
                0 => f64::NAN,
                _ => off_path.farthest_rad,
            },
        }
    }
}

/// The set-points, or what the robot's own reference did where the controller has sent none since the fault.
fn samples(heard: &Heard, fault_ns: i64) -> Vec<Sample> {
    let until_ns = fault_ns + STILL_CONTROLLED_NS;
    let soon = |cycle: &&Cycle| (fault_ns..until_ns).contains(&cycle.stamp_mono_ns);
    let of_cycle = |cycle: &Cycle| Sample {
        stamp_ns: cycle.stamp_mono_ns,
        position_m: cycle.setpoint_m,
        velocity_m_s: cycle.setpoint_velocity_m_s,
    };
    if heard.cycles.iter().filter(soon).count() > LEAST_CYCLES {
        return heard.cycles.iter().map(of_cycle).collect();
    }
    let robot = heard.robot.iter().map(|state| Sample {
        stamp_ns: state.stamp_mono_ns,
        position_m: state.accepted_setpoint_m,
        velocity_m_s: state.accepted_velocity_m_s,
    });
    robot.collect()
}

/// The largest way of a tendon, mm, and the time until the last sample that moves, s.
fn movement(samples: &[Sample], fault_ns: i64) -> (f64, f64) {
    let after = samples.partition_point(|it| it.stamp_ns <= fault_ns);
    let Some(before) = samples[..after].last() else {
        return (f64::NAN, f64::NAN);
    };
    let mut moved_m = 0.0;
    for sample in &samples[after..] {
        for (from, to) in before.position_m.iter().zip(&sample.position_m) {
            raise(&mut moved_m, (to - from).abs());
        }
    }
    let moves = |it: &&Sample| it.velocity_m_s.iter().any(|v| v.abs() > AT_REST_M_S);
    let last_moved = samples[after..].iter().rev().find(moves);
    let until_ns = last_moved.map_or(fault_ns, |it| it.stamp_ns);
    (1e3 * moved_m, (until_ns - fault_ns) as f64 * 1e-9)
}

/// Path time between the fault and the last cycle on a motion, s; none where it is not stopped on.
fn path_time(robot: &Robot, heard: &Heard, id: u32, fault_ns: i64) -> Option<f64> {
    let motion = heard.motions.iter().find(|it| it.id == id)?;
    let (_, path) = path(motion)?;
    let mut along = Along::new(robot, &path);
    let (mut at_fault_s, mut last_s) = (None, None);
    let on_it = |cycle: &&Cycle| cycle.trajectory_id == id && is_on_its_way(cycle);
    for cycle in heard.cycles.iter().filter(on_it) {
        let time_s = along.nearest(cycle).time_s;
        if cycle.stamp_mono_ns <= fault_ns {
            at_fault_s = Some(time_s);
        }
        last_s = Some(time_s);
    }
    Some(last_s? - at_fault_s?)
}
