//! A trajectory on its way to the loop and back, and the checks that it has to pass outside of it.

use pcc_model::{Configuration, Robot};
use shared_types::{
    capacity::MAX_KNOTS,
    codes::{LoopState, Refusal},
    valid::Invalid,
};
use trajectory::{Knot, QuinticSegment, Trajectory, TrajectoryError, limit_use};

/// A trajectory may start this far from the commanded configuration, rad; the difference is kept as an offset.
pub const START_TOLERANCE_RAD: f64 = 1e-6;

/// A velocity, rad/s, or acceleration, rad/s², under this is rest.
const REST: f64 = 1e-9;

/// Relative excess over a tendon limit that rounding may cause.
const LIMIT_TOLERANCE: f64 = 1e-6;

/// Excess over the bending limit that certified motions may have, rad.
const BENDING_TOLERANCE_RAD: f64 = 5e-3;

/// How late a trajectory that waits in the loop may begin, ns; the daemon takes back what has not begun by then.
const LATEST_BEGIN_NS: i64 = 300_000_000;

/// Points of each segment at which bending is checked, besides its ends.
const BENDING_SAMPLES: u32 = 4;

/// A trajectory in memory of our own, made once and filled again and again.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Its id, at least 1.
    pub id: u32,
    /// The daemon that has published it.
    pub daemon_instance: u64,
    /// When the sender of the request was asked for it, ns of CLOCK_MONOTONIC.
    pub requested_ns: i64,
    /// When it begins, ns of CLOCK_MONOTONIC.
    pub begin_ns: i64,
    /// Tracking error that its certificate covers, rad.
    pub path_tolerance_rad: f64,
    /// The motion; never more than its capacity of [`MAX_KNOTS`].
    pub knots: Vec<Knot>,
}

impl Motion {
    /// An empty motion with room for every trajectory.
    #[must_use]
    pub fn empty() -> Self {
        Self {
            id: 0,
            daemon_instance: 0,
            requested_ns: 0,
            begin_ns: 0,
            path_tolerance_rad: 0.0,
            knots: Vec::with_capacity(MAX_KNOTS),
        }
    }

    /// Duration, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.knots.last().map_or(0.0, |knot| knot.time)
    }
}

/// Why a trajectory is not executed.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum Unacceptable {
    /// The loop is not holding.
    #[error("the controller is {0}, a trajectory is taken only while it is holding")]
    State(LoopState),
    /// Another one is waiting for its begin.
    #[error("another trajectory is waiting for its begin")]
    Waiting,
    /// The daemon gives no sign of life.
    #[error("the daemon that sent it gives no sign of life")]
    DaemonSilent,
    /// It was meant for a controller before this one.
    #[error("it is meant for another controller than this one, which was started since")]
    OtherController,
    /// Another daemon than the one whose heart beats has published it.
    #[error(
        "it was published by another daemon than the one whose heart beats: nobody would watch over it"
    )]
    OtherDaemon,
    /// It was taken, and something came before its begin that it was given up for.
    #[error(
        "it was set aside before its begin: a stop, a reset, a fault or the loss of robot or daemon came first"
    )]
    SetAside,
    /// A stop or a reset was ordered, or the controller was started, after it was requested.
    #[error(
        "it was requested {before_ms:.1} ms before a stop or a reset was ordered or the controller was started"
    )]
    RequestedBefore {
        /// How long before.
        before_ms: f64,
    },
    /// Its stamp is of the future: no stop could be later.
    #[error("it was requested {ahead_ms:.1} ms from now: its stamp is not of CLOCK_MONOTONIC")]
    FromTheFuture {
        /// How far.
        ahead_ms: f64,
    },
    /// A field of the message is wrong.
    #[error(transparent)]
    Invalid(#[from] Invalid),
    /// It was taken before.
    #[error("trajectory {0} with this begin was taken before")]
    OldId(u32),
    /// It begins in the past.
    #[error("it begins {late_ms:.1} ms in the past, {allowed_ms:.1} ms are allowed")]
    Past {
        /// How far.
        late_ms: f64,
        /// How far it may.
        allowed_ms: f64,
    },
    /// It begins too far in the future.
    #[error("it begins {ahead_s:.1} s from now, {allowed_s:.1} s are allowed")]
    Ahead {
        /// How far.
        ahead_s: f64,
        /// How far it may.
        allowed_s: f64,
    },
    /// Its first knot is not the commanded configuration.
    #[error(
        "it starts {distance_rad:.2e} rad from the commanded configuration, {START_TOLERANCE_RAD:.0e} are allowed"
    )]
    Start {
        /// How far.
        distance_rad: f64,
    },
    /// An end is not at rest.
    #[error("it does not {0} at rest")]
    InMotion(&'static str),
    /// The knots are no motion.
    #[error("it is no motion: {0}")]
    NoMotion(#[from] TrajectoryError),
    /// It exceeds a tendon limit.
    #[error("it uses {share:.6} of the tendons' {limit} limit")]
    Tendons {
        /// Which limit.
        limit: &'static str,
        /// The largest ratio to it.
        share: f64,
    },
    /// It bends a section too far.
    #[error(
        "it bends a section {excess_rad:.4} rad over its limit, {BENDING_TOLERANCE_RAD} are allowed"
    )]
    Bending {
        /// Excess over the limit.
        excess_rad: f64,
    },
}

impl Unacceptable {
    /// The reason as a code in the controller's state.
    #[must_use]
    pub fn code(&self) -> Refusal {
        match self {
            Self::State(LoopState::Starting) | Self::DaemonSilent => Refusal::NotReady,
            Self::State(LoopState::Fault) => Refusal::Faulted,
            Self::State(_) | Self::Waiting => Refusal::Busy,
            Self::Invalid(invalid) if invalid.field == "protocol_version" => Refusal::WrongVersion,
            Self::OtherController => Refusal::OtherController,
            Self::OtherDaemon => Refusal::OtherDaemon,
            Self::RequestedBefore { .. } => Refusal::RequestedBefore,
            Self::SetAside => Refusal::SetAside,
            Self::OldId(_) => Refusal::OldId,
            Self::Past { .. } => Refusal::BeginsInThePast,
            Self::Ahead { .. } => Refusal::BeginsTooLate,
            Self::Start { .. } | Self::InMotion("begin") => Refusal::StartsElsewhere,
            Self::InMotion(_) => Refusal::EndsInMotion,
            Self::Invalid(_) | Self::NoMotion(_) | Self::FromTheFuture { .. } => Refusal::Malformed,
            Self::Tendons { .. } | Self::Bending { .. } => Refusal::OutOfLimits,
        }
    }
}

/// What a trajectory is checked against.
#[derive(Clone, Copy, Debug)]
pub struct Situation {
    /// What the loop does.
    pub state: LoopState,
    /// Its commanded configuration, rad.
    pub commanded_rad: Configuration,
    /// Now, ns of CLOCK_MONOTONIC.
    pub now_ns: i64,
    /// What the guard has heard.
    pub heard: Heard,
    /// Id and begin of the last trajectory taken: the service hands its last message out again.
    pub last_taken: Option<(u32, i64)>,
}

/// What the guard has heard that trajectories requested before, or published by others, are refused for.
#[derive(Clone, Copy, Debug, Default)]
pub struct Heard {
    /// What was requested before this is not wanted any more, ns of CLOCK_MONOTONIC: the newest of the process's start, the newest
    /// stop and the newest reset.
    pub wanted_from_ns: i64,
    /// The daemon whose heart beat last; `None` before the first beat.
    pub daemon_instance: Option<u64>,
}

/// How far a trajectory's begin may be from now.
#[derive(Clone, Copy, Debug)]
pub struct BeginWindow {
    /// In the past, ns.
    pub past_ns: i64,
    /// In the future, ns.
    pub ahead_ns: i64,
}

impl BeginWindow {
    /// The window for a trajectory that was taken within this one and has waited in the loop since: it may begin as late as that, or
    /// 300 ms late where that is more.
    pub(crate) fn of_waiting(self) -> Self {
        Self {
            past_ns: self.past_ns.max(LATEST_BEGIN_NS),
            ..self
        }
    }
}

/// Checks a trajectory completely; not for the loop (it allocates and solves polynomials).
///
/// # Errors
/// The first rule of [`Unacceptable`] that it breaks.
pub fn check(
    motion: &Motion,
    situation: &Situation,
    robot: &Robot,
    window: &BeginWindow,
) -> Result<(), Unacceptable> {
    if situation.last_taken == Some((motion.id, motion.begin_ns)) {
        return Err(Unacceptable::OldId(motion.id));
    }
    let path = Trajectory::new(motion.knots.clone())?;
    is_wanted(motion, situation.now_ns, &situation.heard, window)?;
    check_ends(motion)?;
    check_limits(&path, robot)?;
    can_start(motion, situation.state, &situation.commanded_rad)
}

/// Whether nothing that was heard since a trajectory was requested, nor the time that has passed, forbids it. The loop asks
/// again when it takes the trajectory, and when that is to begin: anything may have been heard meanwhile, and any time may have
/// passed.
///
/// # Errors
/// [`Unacceptable::OtherDaemon`], [`Unacceptable::RequestedBefore`], [`Unacceptable::FromTheFuture`], [`Unacceptable::Past`] or
/// [`Unacceptable::Ahead`].
pub fn is_wanted(
    motion: &Motion,
    now_ns: i64,
    heard: &Heard,
    window: &BeginWindow,
) -> Result<(), Unacceptable> {
    let is_others = |daemon| daemon != motion.daemon_instance;
    if heard.daemon_instance.is_some_and(is_others) {
        return Err(Unacceptable::OtherDaemon);
    }
    if motion.requested_ns > now_ns {
        let ahead_ms = milliseconds(motion.requested_ns - now_ns);
        return Err(Unacceptable::FromTheFuture { ahead_ms });
    }
    if motion.requested_ns <= heard.wanted_from_ns {
        let before_ms = milliseconds(heard.wanted_from_ns - motion.requested_ns);
        return Err(Unacceptable::RequestedBefore { before_ms });
    }
    check_begin(motion.begin_ns - now_ns, window)
}

/// Where the loop must be to take a trajectory; it asks again when it takes it.
///
/// # Errors
/// [`Unacceptable::State`] or [`Unacceptable::Start`].
pub fn can_start(
    motion: &Motion,
    state: LoopState,
    commanded_rad: &Configuration,
) -> Result<(), Unacceptable> {
    if state != LoopState::Holding {
        return Err(Unacceptable::State(state));
    }
    let distance_rad = motion.knots.first().map_or(f64::INFINITY, |first| {
        (first.position - commanded_rad).norm()
    });
    if distance_rad <= START_TOLERANCE_RAD {
        Ok(())
    } else {
        Err(Unacceptable::Start { distance_rad })
    }
}

#[expect(clippy::cast_precision_loss, reason = "for a message")]
fn milliseconds(interval_ns: i64) -> f64 {
    interval_ns as f64 * 1e-6
}

fn check_begin(ahead_ns: i64, window: &BeginWindow) -> Result<(), Unacceptable> {
    if ahead_ns < -window.past_ns {
        let (late_ms, allowed_ms) = (-milliseconds(ahead_ns), milliseconds(window.past_ns));
        return Err(Unacceptable::Past {
            late_ms,
            allowed_ms,
        });
    }
    if ahead_ns > window.ahead_ns {
        let seconds = |ns| milliseconds(ns) * 1e-3;
        let (ahead_s, allowed_s) = (seconds(ahead_ns), seconds(window.ahead_ns));
        return Err(Unacceptable::Ahead { ahead_s, allowed_s });
    }
    Ok(())
}

fn check_ends(motion: &Motion) -> Result<(), Unacceptable> {
    let rests = |knot: Option<&Knot>| {
        knot.is_some_and(|knot| knot.velocity.amax() <= REST && knot.acceleration.amax() <= REST)
    };
    if !rests(motion.knots.first()) {
        return Err(Unacceptable::InMotion("begin"));
    }
    if !rests(motion.knots.last()) {
        return Err(Unacceptable::InMotion("end"));
    }
    Ok(())
}

fn check_limits(path: &Trajectory, robot: &Robot) -> Result<(), Unacceptable> {
    let used = limit_use(path, &robot.tendons, &robot.tendon_limits);
    let ratios = [
        ("velocity", used.velocity),
        ("acceleration", used.acceleration),
        ("jerk", used.jerk),
    ];
    for (limit, share) in ratios {
        // Written so that NaN is refused.
        if share.is_nan() || share > 1.0 + LIMIT_TOLERANCE {
            return Err(Unacceptable::Tendons { limit, share });
        }
    }
    let excess_rad = path
        .segments()
        .map(|segment| bending_excess_rad(&segment, robot))
        .fold(f64::NEG_INFINITY, f64::max);
    if excess_rad > BENDING_TOLERANCE_RAD {
        return Err(Unacceptable::Bending { excess_rad });
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

    const NOW_NS: i64 = 5_000 * MS;
    const DAEMON: u64 = 3;
    const WINDOW: BeginWindow = BeginWindow {
        past_ns: 20 * MS,
        ahead_ns: 60_000 * MS,
    };

    fn situation() -> Situation {
        Situation {
            state: LoopState::Holding,
            commanded_rad: Configuration::zeros(),
            now_ns: NOW_NS,
            heard: Heard {
                wanted_from_ns: NOW_NS - 100 * MS,
                daemon_instance: Some(DAEMON),
            },
            last_taken: Some((6, NOW_NS)),
        }
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
            check(&motion, &situation(), &unit_robot(), &WINDOW).unwrap();
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
            let reason = check(&motion, &situation(), &unit_robot(), &WINDOW).unwrap_err();
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
            let situation = Situation {
                state,
                ..situation()
            };
            let reason = check(&motion(), &situation, &unit_robot(), &WINDOW).unwrap_err();
            assert_eq!(reason.code(), code);
        }
    }
}
