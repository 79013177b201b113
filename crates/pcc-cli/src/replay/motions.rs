//! Recorded motions against a robot file: limits, bending, and set-points as the tendons' matrix has them.

use anyhow::ensure;
use pcc_model::{Configuration, Robot, SECTIONS};
use shared_types::message::{Cycle, TrajectoryMessage};
use shared_types::valid;
use trajectory::{Knot, Trajectory, limit_use};

use super::recording::Recording;

/// Relative amount by which a limit may be exceeded: rounding.
const ROUNDING: f64 = 1e-6;
/// Bending beyond the limit that planning allows: as far as a start may, and from rest through several goals, rad.
const BENDING_SLACK_RAD: f64 = 5e-3;
/// Distance of a set-point from the tendon lengths of its configuration that is none, m.
const SAME_M: f64 = 1e-5;

/// # Errors
/// Where the record is of another robot, or a motion or a set-point does not fit the robot file.
pub(super) fn check(recording: &Recording, robot: &Robot) -> anyhow::Result<()> {
    for recorded in &recording.robots {
        ensure!(
            recorded.robot_hash == robot.hash(),
            "the record is of robot {:016x}; the file is of {:016x}",
            recorded.robot_hash,
            robot.hash()
        );
    }
    check_whole(&recording.cycles)?;
    for cycle in &recording.cycles {
        check_finite(cycle)?;
    }
    let mut largest_use = 0.0_f64;
    let mut largest_bending_rad = 0.0_f64;
    for message in &recording.trajectories {
        let motion = motion(message)?;
        let of_limits = limit_use(&motion, &robot.tendons, &robot.tendon_limits).largest();
        largest_use = largest_use.max(of_limits);
        let bendings = motion
            .knots()
            .iter()
            .map(|knot| bending_rad(&knot.position));
        largest_bending_rad = bendings.fold(largest_bending_rad, f64::max);
    }
    let off_m = recording
        .cycles
        .iter()
        .map(|it| off_m(it, robot))
        .fold(0.0, f64::max);
    say!(
        "{} motions: {largest_use:.6} of the limits at most, bent by {largest_bending_rad:.4} rad at most (limit {:.4} rad)",
        recording.trajectories.len(),
        robot.bending_limit
    );
    say!(
        "{} cycles: set-points {off_m:.1e} m from the tendon lengths of their configurations at most",
        recording.cycles.len()
    );
    ensure!(
        !recording.trajectories.is_empty() || !recording.cycles.is_empty(),
        "the record has no motions and no cycles"
    );
    ensure!(largest_use <= 1.0 + ROUNDING, "a motion exceeds the limits");
    ensure!(
        largest_bending_rad <= robot.bending_limit + BENDING_SLACK_RAD,
        "a motion bends a section too far"
    );
    ensure!(off_m <= SAME_M, "set-points are not those of this robot");
    Ok(())
}

/// Checks that no cycle was lost: their numbers rise by one; where they do not rise another controller has begun.
fn check_whole(cycles: &[Cycle]) -> anyhow::Result<()> {
    for pair in cycles.windows(2) {
        let [before, after] = [pair[0].sequence, pair[1].sequence];
        ensure!(
            after <= before + 1,
            "cycles {} to {} are missing: what was lost cannot be checked",
            before + 1,
            after - 1
        );
    }
    Ok(())
}

/// Checks that a set-point and its configuration are numbers, which comparisons take for granted.
fn check_finite(cycle: &Cycle) -> anyhow::Result<()> {
    let [setpoint, configuration] = [
        &cycle.setpoint_m[..],
        &cycle.commanded_configuration_rad[..],
    ];
    let mut numbers = setpoint.iter().chain(configuration);
    ensure!(
        numbers.all(|it| it.is_finite()),
        "cycle {} has a set-point or a configuration that is no finite number",
        cycle.sequence
    );
    Ok(())
}

/// The motion of a message.
///
/// # Errors
/// Where the message is none that a controller would take.
pub(crate) fn motion(message: &TrajectoryMessage) -> anyhow::Result<Trajectory> {
    let checked = valid::Trajectory::try_from(message)?;
    let knots = checked.knots.iter().map(|knot| Knot {
        time: knot.time_s,
        position: Configuration::from(knot.configuration_rad),
        velocity: Configuration::from(knot.velocity_rad_s),
        acceleration: Configuration::from(knot.acceleration_rad_s2),
    });
    Ok(Trajectory::new(knots.collect())?)
}

fn bending_rad(configuration: &Configuration) -> f64 {
    let of_section = |i: usize| configuration[2 * i].hypot(configuration[2 * i + 1]);
    (0..SECTIONS).map(of_section).fold(0.0, f64::max)
}

/// Distance of a cycle's set-point from the tendon lengths of its configuration, m.
fn off_m(cycle: &Cycle, robot: &Robot) -> f64 {
    let commanded = Configuration::from(cycle.commanded_configuration_rad);
    let count = robot.tendons.count();
    let mut lengths_m = cycle.setpoint_m;
    robot.tendons.lengths(&commanded, &mut lengths_m[..count]);
    let pairs = lengths_m.iter().zip(cycle.setpoint_m).take(count);
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_point_that_is_no_number_is_refused() {
        let mut cycle = Cycle::ZEROED;
        check_finite(&cycle).unwrap();
        cycle.setpoint_m[3] = f64::NAN;
        let error = check_finite(&cycle).unwrap_err();
        assert!(error.to_string().contains("cycle 0"), "{error}");
    }

    #[test]
    fn a_cycle_that_is_missing_is_named_and_another_controller_counts_anew() {
        let cycles = |numbers: &[u64]| -> Vec<Cycle> {
            let cycle = |sequence: &u64| Cycle {
                sequence: *sequence,
                ..Cycle::ZEROED
            };
            numbers.iter().map(cycle).collect()
        };
        check_whole(&cycles(&[5, 6, 7, 1, 2])).unwrap();
        let error = check_whole(&cycles(&[5, 6, 9])).unwrap_err();
        assert!(error.to_string().contains("cycles 7 to 8"), "{error}");
    }
}
