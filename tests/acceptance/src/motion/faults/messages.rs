//! Trajectories that a daemon would never send, each made of a good one that is pending.

use shared_types::codes::Refusal;
use shared_types::message::TrajectoryMessage;

/// One of them.
pub(super) struct BadMessage {
    pub(super) what: &'static str,
    spoil: fn(&mut TrajectoryMessage),
    /// The name under which it is refused.
    pub(super) refusal: Refusal,
}

const fn bad(
    what: &'static str,
    refusal: Refusal,
    spoil: fn(&mut TrajectoryMessage),
) -> BadMessage {
    BadMessage {
        what,
        spoil,
        refusal,
    }
}

/// All kinds.
pub(super) const BAD_MESSAGES: &[BadMessage] = &[
    bad("another version", Refusal::WrongVersion, |m| {
        m.protocol_version += 1;
    }),
    bad("no knot", Refusal::Malformed, |m| m.knot_count = 0),
    bad("one knot", Refusal::Malformed, |m| m.knot_count = 1),
    bad("more knots than there is room", Refusal::Malformed, |m| {
        m.knot_count = 257;
    }),
    bad("any number of knots", Refusal::Malformed, |m| {
        m.knot_count = u32::MAX;
    }),
    bad("a time that is no number", Refusal::Malformed, |m| {
        m.knots[3].time_s = f64::NAN;
    }),
    bad("a position that is no number", Refusal::Malformed, |m| {
        m.knots[3].configuration_rad[2] = f64::NAN;
    }),
    bad("a velocity that is no number", Refusal::Malformed, |m| {
        m.knots[0].velocity_rad_s[5] = f64::NAN;
    }),
    bad("an endless acceleration", Refusal::Malformed, |m| {
        m.knots[1].acceleration_rad_s2[0] = f64::INFINITY;
    }),
    bad("times that do not rise", Refusal::Malformed, |m| {
        m.knots[2].time_s = m.knots[1].time_s;
    }),
    bad("a start that means nothing", Refusal::Malformed, |m| {
        m.start = 7;
    }),
    bad("it leaves nothing", Refusal::Malformed, |m| {
        m.leaves_trajectory_id = 0;
    }),
    bad("a switch that is no number", Refusal::Malformed, |m| {
        m.leaves_at_s = f64::NAN;
    }),
    bad("a switch before the begin", Refusal::Malformed, |m| {
        m.leaves_at_s = -1.0;
    }),
    bad("no path tolerance", Refusal::Malformed, |m| {
        m.path_tolerance_rad = 0.0;
    }),
    bad("requested in the future", Refusal::Malformed, |m| {
        m.requested_mono_ns += 3_600_000_000_000;
    }),
    bad(
        "requested before the controller's start",
        Refusal::RequestedBefore,
        |m| m.requested_mono_ns = 1,
    ),
    bad("another controller's", Refusal::OtherController, |m| {
        m.controller_instance += 1;
    }),
    bad("another robot's", Refusal::OtherRobot, |m| {
        m.robot_hash += 1;
    }),
    bad("another daemon's", Refusal::OtherDaemon, |m| {
        m.daemon_instance += 1;
    }),
    bad("a motion that ends in motion", Refusal::EndsInMotion, |m| {
        last(m).velocity_rad_s[0] = 1e-6;
    }),
    bad("limits exceeded by a tenth", Refusal::OutOfLimits, hurry),
    bad("it leaves another motion", Refusal::LeavesAnother, |m| {
        m.leaves_trajectory_id += 1000;
    }),
];

impl BadMessage {
    /// The message that it makes of a good one.
    pub(super) fn of(&self, good: &TrajectoryMessage, id: u32) -> TrajectoryMessage {
        let mut message = *good;
        message.trajectory_id = id;
        (self.spoil)(&mut message);
        message
    }
}

fn last(message: &mut TrajectoryMessage) -> &mut shared_types::message::Knot {
    &mut message.knots[message.knot_count as usize - 1]
}

/// The same curve in less time.
fn hurry(message: &mut TrajectoryMessage) {
    for knot in &mut message.knots {
        knot.time_s /= 1.1;
        knot.velocity_rad_s.iter_mut().for_each(|it| *it *= 1.1);
        knot.acceleration_rad_s2
            .iter_mut()
            .for_each(|it| *it *= 1.1 * 1.1);
    }
}
