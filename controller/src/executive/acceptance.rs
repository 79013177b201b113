//! The checks that a trajectory must pass before the loop follows it.

use pcc_model::{Configuration, Robot};
use shared_types::codes::LoopState;
use trajectory::{Knot, QuinticSegment, Trajectory, limit_use};

use super::motion::Motion;
use super::refusal::{BENDING_TOLERANCE_RAD, START_TOLERANCE_RAD, TrajectoryRefusal};

/// A velocity, rad/s, or acceleration, rad/s², under this is rest.
const REST: f64 = 1e-9;

/// Relative excess over a tendon limit that rounding may cause.
const LIMIT_TOLERANCE: f64 = 1e-6;

/// How late a trajectory that waits in the loop may begin, ns; the daemon withdraws one that has not begun by then.
const LATEST_BEGIN_NS: i64 = 300_000_000;

/// Points of each segment at which bending is checked, besides its ends.
const BENDING_SAMPLES: u32 = 4;

/// The state of loop and guard that a trajectory is checked against.
#[derive(Clone, Copy, Debug)]
pub struct AcceptanceContext {
    /// State of the loop.
    pub state: LoopState,
    /// Commanded configuration of the loop, rad.
    pub commanded_rad: Configuration,
    /// The trajectory that the loop follows, 0 for none.
    pub trajectory_id: u32,
    /// Path time of the loop on that trajectory, s.
    pub path_time_s: f64,
    /// Now, ns of CLOCK_MONOTONIC.
    pub now_ns: i64,
    /// Orders and daemon as the guard knows them.
    pub guard: GuardState,
}

/// What the guard knows of orders and of the daemon, for which trajectories are refused.
#[derive(Clone, Copy, Debug, Default)]
pub struct GuardState {
    /// Trajectories that were requested up to this time are refused, ns of CLOCK_MONOTONIC: the latest of the process's start, the
    /// newest stop and the newest reset.
    pub wanted_from_ns: i64,
    /// Instance of the daemon that sent the newest heartbeat; `None` before the first one.
    pub daemon_instance: Option<u64>,
}

/// How far a trajectory's begin may be from now.
#[derive(Clone, Copy, Debug)]
pub struct BeginWindow {
    /// How far in the past a trajectory may begin, ns.
    pub past_ns: i64,
    /// How far in the future a trajectory may begin, ns.
    pub ahead_ns: i64,
}

impl BeginWindow {
    /// The window for a trajectory that was taken within this window and has waited in the loop since: it may begin as late as this
    /// window allows, or 300 ms late where that is more.
    pub(crate) fn of_waiting(self) -> Self {
        Self {
            past_ns: self.past_ns.max(LATEST_BEGIN_NS),
            ..self
        }
    }
}

/// Checks a trajectory completely; not for the loop (it allocates and solves polynomials). `last` is the trajectory that was taken
/// last: one that leaves it gets its knots ahead of the loop before its own.
///
/// # Errors
/// The first rule of [`TrajectoryRefusal`] that it breaks.
pub fn check(
    motion: &mut Motion,
    last: &Motion,
    context: &AcceptanceContext,
    robot: &Robot,
    window: &BeginWindow,
) -> Result<(), TrajectoryRefusal> {
    if (last.id, last.begin_ns) == (motion.id, motion.begin_ns) {
        return Err(TrajectoryRefusal::OldId(motion.id));
    }
    let path = Trajectory::new(motion.knots.clone())?;
    check_still_valid(motion, context.now_ns, &context.guard, window)?;
    check_ends(motion)?;
    check_limits(&path, robot)?;
    match (motion.leaves, context.state) {
        (None, state) => check_start(motion, state, &context.commanded_rad),
        // The last one is still to be begun: where the loop is on it is not known yet.
        (Some(departure), LoopState::Executing)
            if departure.trajectory_id == last.id && context.trajectory_id != last.id =>
        {
            Err(TrajectoryRefusal::Waiting)
        }
        (Some(_), LoopState::Executing) => motion.lead_in_from(last, context.path_time_s),
        (Some(_), state) => Err(TrajectoryRefusal::State(state)),
    }
}

/// Checks that no order since a trajectory was requested, no other daemon, and no time that has passed forbids it. The loop checks
/// again when it takes the trajectory, and when that is to begin, since orders may have come and time has passed.
///
/// # Errors
/// [`TrajectoryRefusal::OtherDaemon`], [`TrajectoryRefusal::RequestedBefore`], [`TrajectoryRefusal::FromTheFuture`], [`TrajectoryRefusal::Past`] or
/// [`TrajectoryRefusal::Ahead`].
pub fn check_still_valid(
    motion: &Motion,
    now_ns: i64,
    guard: &GuardState,
    window: &BeginWindow,
) -> Result<(), TrajectoryRefusal> {
    let is_others = |daemon| daemon != motion.daemon_instance;
    if guard.daemon_instance.is_some_and(is_others) {
        return Err(TrajectoryRefusal::OtherDaemon);
    }
    if motion.requested_ns > now_ns {
        let ahead_ms = milliseconds(motion.requested_ns - now_ns);
        return Err(TrajectoryRefusal::FromTheFuture { ahead_ms });
    }
    if motion.requested_ns <= guard.wanted_from_ns {
        let before_ms = milliseconds(guard.wanted_from_ns - motion.requested_ns);
        return Err(TrajectoryRefusal::RequestedBefore { before_ms });
    }
    match motion.leaves {
        None => check_begin(motion.begin_ns - now_ns, window),
        // It begins by path time.
        Some(_) => Ok(()),
    }
}

/// Checks that the loop holds the robot where a trajectory starts; the loop checks again when it takes the trajectory.
///
/// # Errors
/// [`TrajectoryRefusal::State`] or [`TrajectoryRefusal::Start`].
pub fn check_start(
    motion: &Motion,
    state: LoopState,
    commanded_rad: &Configuration,
) -> Result<(), TrajectoryRefusal> {
    if state != LoopState::Holding {
        return Err(TrajectoryRefusal::State(state));
    }
    let distance_rad = motion.knots.first().map_or(f64::INFINITY, |first| {
        (first.position - commanded_rad).norm()
    });
    if distance_rad <= START_TOLERANCE_RAD {
        Ok(())
    } else {
        Err(TrajectoryRefusal::Start { distance_rad })
    }
}

#[expect(clippy::cast_precision_loss, reason = "for a message")]
fn milliseconds(interval_ns: i64) -> f64 {
    interval_ns as f64 * 1e-6
}

fn check_begin(ahead_ns: i64, window: &BeginWindow) -> Result<(), TrajectoryRefusal> {
    if ahead_ns < -window.past_ns {
        let (late_ms, allowed_ms) = (-milliseconds(ahead_ns), milliseconds(window.past_ns));
        return Err(TrajectoryRefusal::Past {
            late_ms,
            allowed_ms,
        });
    }
    if ahead_ns > window.ahead_ns {
        let seconds = |ns| milliseconds(ns) * 1e-3;
        let (ahead_s, allowed_s) = (seconds(ahead_ns), seconds(window.ahead_ns));
        return Err(TrajectoryRefusal::Ahead { ahead_s, allowed_s });
    }
    Ok(())
}

fn check_ends(motion: &Motion) -> Result<(), TrajectoryRefusal> {
    let rests = |knot: Option<&Knot>| {
        knot.is_some_and(|knot| knot.velocity.amax() <= REST && knot.acceleration.amax() <= REST)
    };
    if motion.leaves.is_none() && !rests(motion.knots.first()) {
        return Err(TrajectoryRefusal::InMotion("begin"));
    }
    if !rests(motion.knots.last()) {
        return Err(TrajectoryRefusal::InMotion("end"));
    }
    Ok(())
}

fn check_limits(path: &Trajectory, robot: &Robot) -> Result<(), TrajectoryRefusal> {
    let used = limit_use(path, &robot.tendons, &robot.tendon_limits);
    let ratios = [
        ("velocity", used.velocity),
        ("acceleration", used.acceleration),
        ("jerk", used.jerk),
    ];
    for (limit, share) in ratios {
        // Written so that NaN is refused.
        if share.is_nan() || share > 1.0 + LIMIT_TOLERANCE {
            return Err(TrajectoryRefusal::Tendons { limit, share });
        }
    }
    let excess_rad = path
        .segments()
        .map(|segment| bending_excess_rad(&segment, robot))
        .fold(f64::NEG_INFINITY, f64::max);
    if excess_rad > BENDING_TOLERANCE_RAD {
        return Err(TrajectoryRefusal::Bending { excess_rad });
    }
    Ok(())
}

fn bending_excess_rad(segment: &QuinticSegment, robot: &Robot) -> f64 {
    (0..=BENDING_SAMPLES)
        .map(|sample| segment.duration * f64::from(sample) / f64::from(BENDING_SAMPLES))
        .map(|time| robot.limit_excess(&segment.evaluate(time).position))
        .fold(f64::NEG_INFINITY, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{MS, curved_motion, target_configuration, unit_robot};
    use shared_types::codes::Refusal;

    const NOW_NS: i64 = 5_000 * MS;
    const DAEMON: u64 = 3;
    const WINDOW: BeginWindow = BeginWindow {
        past_ns: 20 * MS,
        ahead_ns: 60_000 * MS,
    };

    fn context() -> AcceptanceContext {
        AcceptanceContext {
            state: LoopState::Holding,
            commanded_rad: Configuration::zeros(),
            now_ns: NOW_NS,
            guard: GuardState {
                wanted_from_ns: NOW_NS - 100 * MS,
                daemon_instance: Some(DAEMON),
            },
            trajectory_id: 0,
            path_time_s: 0.0,
        }
    }

    fn last() -> Motion {
        let mut last = Motion::empty();
        (last.id, last.begin_ns) = (6, NOW_NS);
        last
    }

    fn check_motion(
        mut motion: Motion,
        context: &AcceptanceContext,
    ) -> Result<(), TrajectoryRefusal> {
        check(&mut motion, &last(), context, &unit_robot(), &WINDOW)
    }

    fn motion() -> Motion {
        let mut motion = curved_motion(7, NOW_NS, Configuration::zeros(), target_configuration());
        (motion.daemon_instance, motion.requested_ns) = (DAEMON, NOW_NS - 50 * MS);
        motion
    }

    #[test]
    fn a_good_trajectory_is_accepted_up_to_the_edges_of_the_window() {
        for offset_ms in [-20, 0, 60_000] {
            let mut motion = motion();
            motion.begin_ns += offset_ms * MS;
            check_motion(motion, &context()).unwrap();
        }
    }

    #[test]
    fn every_rule_is_named_by_reason_and_code() {
        type Spoil = fn(&mut Motion);
        let cases: [(Refusal, &str, Spoil); 14] = [
            (Refusal::OldId, "trajectory 6", |m| m.id = 6),
            (Refusal::OtherDaemon, "another daemon", |m| {
                m.daemon_instance = DAEMON + 1;
            }),
            (
                Refusal::RequestedBefore,
                "0.0 ms before a stop or a reset",
                |m| {
                    m.requested_ns = NOW_NS - 100 * MS;
                },
            ),
            (Refusal::Malformed, "requested 1.0 ms from now", |m| {
                m.requested_ns = NOW_NS + MS;
            }),
            (Refusal::BeginsInThePast, "30.0 ms in the past, 20.0", |m| {
                m.begin_ns -= 30 * MS;
            }),
            (Refusal::BeginsTooLate, "61.0 s from now, 60.0", |m| {
                m.begin_ns += 61_000 * MS;
            }),
            (Refusal::StartsElsewhere, "rad from the commanded", |m| {
                m.knots.iter_mut().for_each(|knot| knot.position[0] += 2e-6);
            }),
            (Refusal::StartsElsewhere, "does not begin at rest", |m| {
                m.knots[0].velocity[1] = 1e-6;
            }),
            (Refusal::EndsInMotion, "does not end at rest", |m| {
                m.knots[47].acceleration[1] = 1e-6;
            }),
            (Refusal::Malformed, "knot 3 has a number", |m| {
                m.knots[3].position[2] = f64::NAN;
            }),
            (Refusal::Malformed, "knot 5 is not after", |m| {
                m.knots[5].time = m.knots[4].time;
            }),
            (Refusal::Malformed, "at least 2 knots", |m| {
                m.knots.truncate(1);
            }),
            (Refusal::OutOfLimits, "of the tendons'", |m| {
                m.knots.iter_mut().for_each(|knot| {
                    knot.time *= 0.99;
                    knot.velocity /= 0.99;
                    knot.acceleration /= 0.99 * 0.99;
                });
            }),
            (Refusal::OutOfLimits, "bends a section", |m| {
                let over = curved_motion(
                    7,
                    NOW_NS,
                    Configuration::zeros(),
                    Configuration::from([1.6, 0.0, 0.0, 0.0, 0.0, 0.0]),
                );
                m.knots = over.knots;
            }),
        ];
        for (code, text, spoil) in cases {
            let mut motion = motion();
            spoil(&mut motion);
            let reason = check_motion(motion, &context()).unwrap_err();
            assert!(reason.to_string().contains(text), "{reason} for {text}");
            assert_eq!(reason.code(), code, "{reason}");
        }
    }

    #[test]
    fn only_a_holding_controller_takes_a_trajectory() {
        let cases = [
            (LoopState::Starting, Refusal::NotReady),
            (LoopState::Executing, Refusal::Busy),
            (LoopState::Stopping, Refusal::Busy),
            (LoopState::Fault, Refusal::Faulted),
        ];
        for (state, code) in cases {
            let context = AcceptanceContext { state, ..context() };
            let reason = check_motion(motion(), &context).unwrap_err();
            assert_eq!(reason.code(), code);
        }
    }
}
