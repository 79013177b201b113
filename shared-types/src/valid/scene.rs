//! Obstacles and signs of life.

use super::{
    Invalid, Quantity, check_code, check_count, check_radius, check_stamp, check_version,
    invalid_at,
};
use crate::PROTOCOL_VERSION;
use crate::capacity::MAX_SCENE_BALLS;
use crate::codes::ProcessKind;
use crate::message::{self, MovingBall, SceneMessage};

/// All obstacles at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Time for which the centres hold, nanoseconds of `CLOCK_MONOTONIC`.
    pub stamp_mono_ns: i64,
    /// At most 1024, all finite, radii not negative.
    pub balls: Vec<MovingBall>,
}

impl TryFrom<&SceneMessage> for Scene {
    type Error = Invalid;

    fn try_from(wire: &SceneMessage) -> Result<Self, Invalid> {
        check_version(wire.protocol_version)?;
        let count = check_count("ball_count", wire.ball_count, 0, MAX_SCENE_BALLS)?;
        let balls = wire.balls[..count].to_vec();
        for (index, ball) in balls.iter().enumerate() {
            let check = |values: &[f64], quantity: Quantity| {
                values
                    .iter()
                    .try_for_each(|&value| quantity.check(value).map(drop))
            };
            check(&ball.centre_m, Quantity::Length)
                .and_then(|()| check(&ball.velocity_m_s, Quantity::Rate))
                .and_then(|()| check_radius(ball.radius_m))
                .map_err(|reason| invalid_at("balls", index, reason))?;
        }
        Ok(Self {
            stamp_mono_ns: check_stamp("stamp_mono_ns", wire.stamp_mono_ns)?,
            balls,
        })
    }
}

impl Scene {
    /// Writes the wire form into `wire`, which may lie in shared memory.
    ///
    /// # Errors
    /// [`Invalid`] where it would not be accepted; `wire` then holds no usable scene.
    pub fn write(
        stamp_mono_ns: i64,
        balls: &[MovingBall],
        wire: &mut SceneMessage,
    ) -> Result<(), Invalid> {
        wire.stamp_mono_ns = stamp_mono_ns;
        wire.protocol_version = PROTOCOL_VERSION;
        wire.ball_count = u32::try_from(balls.len()).unwrap_or(u32::MAX);
        for (slot, ball) in wire.balls.iter_mut().zip(balls) {
            *slot = *ball;
        }
        Self::try_from(&*wire).map(drop)
    }
}

/// A sign of life.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heartbeat {
    /// When it was sent, nanoseconds of `CLOCK_MONOTONIC`.
    pub stamp_mono_ns: i64,
    /// Counts the sender's heartbeats.
    pub sequence: u64,
    /// Who.
    pub kind: ProcessKind,
    /// Its process id.
    pub pid: u32,
}

impl TryFrom<&message::Heartbeat> for Heartbeat {
    type Error = Invalid;

    fn try_from(wire: &message::Heartbeat) -> Result<Self, Invalid> {
        Ok(Self {
            stamp_mono_ns: check_stamp("stamp_mono_ns", wire.stamp_mono_ns)?,
            sequence: wire.sequence,
            kind: check_code("kind", wire.kind)?,
            pid: wire.pid,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::valid::BadCase;

    fn wire() -> SceneMessage {
        let mut wire = SceneMessage::ZEROED;
        Scene::write(
            5,
            &[MovingBall {
                radius_m: 0.1,
                ..MovingBall::ZEROED
            }; 2],
            &mut wire,
        )
        .unwrap();
        wire
    }

    #[test]
    fn a_scene_survives_the_wire_and_nothing_beyond_its_count_is_read() {
        let mut wire = wire();
        wire.balls[2].radius_m = -1.0;
        let scene = Scene::try_from(&wire).unwrap();
        assert_eq!((scene.stamp_mono_ns, scene.balls.len()), (5, 2));
        assert_eq!(scene.balls[1].radius_m, 0.1);
    }

    #[test]
    fn each_field_is_checked_and_named() {
        let cases: &[BadCase<SceneMessage>] = &[
            (|s| s.protocol_version = 0, "protocol_version is 0"),
            (
                |s| s.ball_count = 1025,
                "ball_count is 1025; allowed is 0..=1024",
            ),
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
        let too_many = vec![MovingBall::ZEROED; MAX_SCENE_BALLS + 1];
        assert!(Scene::write(0, &too_many, &mut wire()).is_err());
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
