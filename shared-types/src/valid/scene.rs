//! Validated scenes, scene verdicts and heartbeats.

use std::fmt;

use super::check::{
    Quantity, check_code, check_count, check_flag, check_radius, check_stamp, check_version,
};
use super::invalid::{Invalid, Reason, invalid, invalid_at};
use crate::PROTOCOL_VERSION;
use crate::capacity::{MAX_SCENE_BALLS, SOURCE_NAME_BYTES};
use crate::codes::{ProcessKind, SceneRefusal};
use crate::message::{self, MovingBall, ReasonText, SceneMessage};

/// Shortest lifetime of a scene, nanoseconds: 1 ms.
const LEAST_SCENE_LIFETIME_NS: i64 = 1_000_000;
/// Longest lifetime of a scene, nanoseconds: an hour.
pub const MOST_SCENE_LIFETIME_NS: i64 = 3_600_000_000_000;
/// A stamp this near to the time of day, nanoseconds, is one of that clock: a day.
const WALL_CLOCK_NS: i64 = 86_400_000_000_000;

/// Name of a source of live scenes: 1 to 32 characters of printable ASCII.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct SourceName([u8; SOURCE_NAME_BYTES]);

impl SourceName {
    /// Checks a name.
    ///
    /// # Errors
    /// [`Invalid`] if it is empty, longer than 32 bytes, or has other characters than printable ASCII.
    pub fn new(name: &str) -> Result<Self, Invalid> {
        let mut wire = [0; SOURCE_NAME_BYTES];
        let length = u32::try_from(name.len()).unwrap_or(u32::MAX);
        let length = check_count("source", length, 1, SOURCE_NAME_BYTES)?;
        wire[..length].copy_from_slice(name.as_bytes());
        Self::try_from(&wire)
    }

    /// The wire form.
    #[must_use]
    pub const fn to_wire(self) -> [u8; SOURCE_NAME_BYTES] {
        self.0
    }
}

impl TryFrom<&[u8; SOURCE_NAME_BYTES]> for SourceName {
    type Error = Invalid;

    fn try_from(wire: &[u8; SOURCE_NAME_BYTES]) -> Result<Self, Invalid> {
        let length = wire.iter().position(|&byte| byte == 0);
        let (name, rest) = wire.split_at(length.unwrap_or(SOURCE_NAME_BYTES));
        let printable = |byte: &u8| (b' '..=b'~').contains(byte);
        check_count("source", name.len() as u32, 1, SOURCE_NAME_BYTES)?;
        let wrong = |(_, byte): &(usize, &u8)| !printable(byte);
        let strange = name.iter().enumerate().find(wrong);
        let trailing = rest.iter().enumerate().find(|(_, byte)| **byte != 0);
        let trailing = trailing.map(|(index, byte)| (name.len() + index, byte));
        if let Some((index, byte)) = strange.or(trailing) {
            let value = f64::from(*byte);
            let allowed = "printable ASCII, 32..=126, then zeros";
            return Err(invalid_at(
                "source",
                index,
                Reason::OutOfRange { value, allowed },
            ));
        }
        Ok(Self(*wire))
    }
}

impl fmt::Display for SourceName {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = self.0.iter().take_while(|byte| **byte != 0);
        let text: String = text.map(|byte| char::from(*byte)).collect();
        formatter.pad(&text)
    }
}

/// All obstacles that one source knows of at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Name of the scene's source.
    pub source: SourceName,
    /// The publisher's number of the scene.
    pub sequence: u32,
    /// Time for which the centres hold, nanoseconds of `CLOCK_MONOTONIC`.
    pub stamp_mono_ns: i64,
    /// For how long from the stamp on the scene counts, nanoseconds, 1 ms to an hour.
    pub lifetime_ns: i64,
    /// Whether the source takes its leave; the obstacles then mean nothing.
    pub takes_leave: bool,
    /// The obstacles: at most 1024, all finite, radii not negative.
    pub balls: Vec<MovingBall>,
}

impl TryFrom<&SceneMessage> for Scene {
    type Error = Invalid;

    fn try_from(wire: &SceneMessage) -> Result<Self, Invalid> {
        check_version(wire.protocol_version)?;
        let source = SourceName::try_from(&wire.source)?;
        let takes_leave = check_flag("takes_leave", wire.takes_leave)?;
        let lifetime_ns = check_lifetime(wire.lifetime_ns)?;
        let count = check_count("ball_count", wire.ball_count, 0, MAX_SCENE_BALLS)?;
        let balls = wire.balls[..count].to_vec();
        for (index, ball) in balls.iter().enumerate() {
            Quantity::Length
                .check_all(&ball.centre_m)
                .and_then(|()| Quantity::Rate.check_all(&ball.velocity_m_s))
                .and_then(|()| check_radius(ball.radius_m))
                .map_err(|reason| invalid_at("balls", index, reason))?;
        }
        Ok(Self {
            source,
            sequence: wire.sequence,
            stamp_mono_ns: check_stamp("stamp_mono_ns", wire.stamp_mono_ns)?,
            lifetime_ns,
            takes_leave,
            balls,
        })
    }
}

fn check_lifetime(lifetime_ns: i64) -> Result<i64, Invalid> {
    if (LEAST_SCENE_LIFETIME_NS..=MOST_SCENE_LIFETIME_NS).contains(&lifetime_ns) {
        return Ok(lifetime_ns);
    }
    let value = lifetime_ns as f64;
    let allowed = "1e6..=3.6e12 ns (1 ms to an hour)";
    Err(invalid(
        "lifetime_ns",
        Reason::OutOfRange { value, allowed },
    ))
}

/// Why a scene with this stamp and lifetime does not count now, if it does not.
#[must_use]
pub fn stamp_refusal(
    stamp_mono_ns: i64,
    lifetime_ns: i64,
    now_mono_ns: i64,
    now_wall_ns: i64,
) -> Option<SceneRefusal> {
    if stamp_mono_ns > now_mono_ns {
        let to_wall_ns = stamp_mono_ns.saturating_sub(now_wall_ns).saturating_abs();
        let is_wall = to_wall_ns <= WALL_CLOCK_NS;
        return Some(if is_wall {
            SceneRefusal::OtherClock
        } else {
            SceneRefusal::InTheFuture
        });
    }
    let is_over = now_mono_ns >= stamp_mono_ns.saturating_add(lifetime_ns);
    is_over.then_some(SceneRefusal::TooOld)
}

impl Scene {
    /// Writes the wire form into `wire`, which may lie in shared memory.
    ///
    /// # Errors
    /// [`Invalid`] where it would not be accepted; `wire` then holds no usable scene.
    pub fn write(&self, wire: &mut SceneMessage) -> Result<(), Invalid> {
        wire.stamp_mono_ns = self.stamp_mono_ns;
        wire.lifetime_ns = self.lifetime_ns;
        wire.source = self.source.to_wire();
        wire.sequence = self.sequence;
        wire.protocol_version = PROTOCOL_VERSION;
        wire.ball_count = u32::try_from(self.balls.len()).unwrap_or(u32::MAX);
        wire.takes_leave = u32::from(self.takes_leave);
        for (slot, ball) in wire.balls.iter_mut().zip(&self.balls) {
            *slot = *ball;
        }
        Self::try_from(&*wire).map(drop)
    }

    /// When it ceases to count, nanoseconds of `CLOCK_MONOTONIC`.
    #[must_use]
    pub fn end_mono_ns(&self) -> i64 {
        self.stamp_mono_ns.saturating_add(self.lifetime_ns)
    }
}

/// The daemon's verdict on a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SceneStatus {
    /// `source` of the scene as it came: it may be what is wrong with the scene.
    pub source: [u8; SOURCE_NAME_BYTES],
    /// The scene's sequence.
    pub sequence: u32,
    /// The scene's stamp.
    pub scene_stamp_mono_ns: i64,
    /// Why the scene does not count; none: it does.
    pub refusal: SceneRefusal,
    /// What is wrong with the scene, in words.
    pub reason: ReasonText,
}

impl TryFrom<&message::SceneStatus> for SceneStatus {
    type Error = Invalid;

    fn try_from(wire: &message::SceneStatus) -> Result<Self, Invalid> {
        check_version(wire.protocol_version)?;
        Ok(Self {
            source: wire.source,
            sequence: wire.sequence,
            scene_stamp_mono_ns: wire.scene_stamp_mono_ns,
            refusal: check_code("refusal", wire.refusal)?,
            reason: wire.reason,
        })
    }
}

/// A heartbeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heartbeat {
    /// When the heartbeat was sent, nanoseconds of `CLOCK_MONOTONIC`.
    pub stamp_mono_ns: i64,
    /// Identifies the sender among all processes of its kind.
    pub instance: u64,
    /// The kind of process that sent it.
    pub kind: ProcessKind,
}

impl TryFrom<&message::Heartbeat> for Heartbeat {
    type Error = Invalid;

    fn try_from(wire: &message::Heartbeat) -> Result<Self, Invalid> {
        Ok(Self {
            stamp_mono_ns: check_stamp("stamp_mono_ns", wire.stamp_mono_ns)?,
            instance: wire.instance,
            kind: check_code("kind", wire.kind)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::valid::BadCase;

    fn scene(balls: Vec<MovingBall>) -> Scene {
        Scene {
            source: SourceName::new("camera 1").unwrap(),
            sequence: 9,
            stamp_mono_ns: 5,
            lifetime_ns: LEAST_SCENE_LIFETIME_NS,
            takes_leave: false,
            balls,
        }
    }

    fn wire() -> SceneMessage {
        let ball = MovingBall {
            radius_m: 0.1,
            ..MovingBall::ZEROED
        };
        let mut wire = SceneMessage::ZEROED;
        scene(vec![ball; 2]).write(&mut wire).unwrap();
        wire
    }

    #[test]
    fn a_scene_survives_the_wire_and_nothing_beyond_its_count_is_read() {
        let mut wire = wire();
        wire.balls[2].radius_m = -1.0;
        let scene = Scene::try_from(&wire).unwrap();
        assert_eq!((scene.stamp_mono_ns, scene.balls.len()), (5, 2));
        assert_eq!(scene.balls[1].radius_m, 0.1);
        assert_eq!(
            (scene.source.to_string(), scene.sequence),
            ("camera 1".to_owned(), 9)
        );
        assert_eq!(scene.end_mono_ns(), 1_000_005);
    }

    #[test]
    fn each_field_is_checked_and_named() {
        let cases: &[BadCase<SceneMessage>] = &[
            (|s| s.protocol_version = 0, "protocol_version is 0"),
            (
                |s| s.ball_count = 1025,
                "ball_count is 1025; allowed is 0..=1024",
            ),
            (|s| s.source = [0; 32], "source is 0; allowed is 1..=32"),
            (
                |s| s.source[1] = 200,
                "source[1] is 200; allowed is printable ASCII",
            ),
            (|s| s.source[12] = b'x', "source[12] is 120"),
            (
                |s| s.takes_leave = 2,
                "takes_leave is 2; allowed are 0 (no) and 1",
            ),
            (
                |s| s.lifetime_ns = 0,
                "lifetime_ns is 0; allowed is 1e6..=3.6e12 ns",
            ),
            (|s| s.lifetime_ns = i64::MAX, "lifetime_ns is 9"),
            (
                |s| s.stamp_mono_ns = -1,
                "stamp_mono_ns is -1; allowed is 0 or later",
            ),
            (
                |s| s.balls[1].radius_m = -0.1,
                "balls[1] is -0.1; allowed is a radius of 0..=1000 m",
            ),
            (|s| s.balls[0].radius_m = f64::NAN, "balls[0] is NaN"),
            (
                |s| s.balls[0].centre_m[2] = f64::INFINITY,
                "balls[0] is inf",
            ),
            (|s| s.balls[1].velocity_m_s[0] = f64::NAN, "balls[1] is NaN"),
        ];
        for (change, text) in cases {
            let mut wire = wire();
            change(&mut wire);
            let error = Scene::try_from(&wire).expect_err(text);
            assert!(
                error.to_string().starts_with(text),
                "{error} does not begin with {text:?}"
            );
        }
        let too_many = scene(vec![MovingBall::ZEROED; MAX_SCENE_BALLS + 1]);
        assert!(too_many.write(&mut wire()).is_err());
        assert!(SourceName::new(&"x".repeat(33)).is_err());
    }

    #[test]
    fn stamps_of_other_clocks_of_the_future_and_of_long_ago_are_told_apart() {
        let (now, wall, life) = (50_000_000_000, 1_790_000_000_000_000_000, 1_000_000_000);
        let refusal = |stamp| stamp_refusal(stamp, life, now, wall);
        assert_eq!(refusal(now), None);
        assert_eq!(refusal(now - life + 1), None);
        assert_eq!(refusal(now - life), Some(SceneRefusal::TooOld));
        assert_eq!(refusal(0), Some(SceneRefusal::TooOld));
        assert_eq!(refusal(now + 1), Some(SceneRefusal::InTheFuture));
        assert_eq!(refusal(i64::MAX), Some(SceneRefusal::InTheFuture));
        for off in [0, -3_600_000_000_000, 3_600_000_000_000] {
            assert_eq!(refusal(wall + off), Some(SceneRefusal::OtherClock));
        }
    }

    #[test]
    fn a_heartbeat_of_nobody_known_is_refused() {
        let wire = message::Heartbeat {
            kind: 1,
            ..message::Heartbeat::ZEROED
        };
        assert_eq!(
            Heartbeat::try_from(&wire).unwrap().kind,
            ProcessKind::Daemon
        );
        let error = Heartbeat::try_from(&message::Heartbeat { kind: 0, ..wire }).unwrap_err();
        assert!(error.to_string().contains("1 (daemon)"), "{error}");
        assert!(
            Heartbeat::try_from(&message::Heartbeat {
                stamp_mono_ns: -1,
                ..wire
            })
            .is_err()
        );
    }
}
