//! The live scene: obstacles that move while the robot does.

use iceoryx2::prelude::ZeroCopySend;

use super::wire_message;
use crate::capacity::MAX_SCENE_BALLS;

wire_message! {
    /// An obstacle that keeps its velocity.
    pub struct MovingBall: "pcc.v2.MovingBall", 56 bytes {
        /// Centre in the base frame at the scene's stamp, metres.
        pub centre_m: [f64; 3],
        /// Radius, metres, not negative.
        pub radius_m: f64,
        /// Velocity of the centre, m/s.
        pub velocity_m_s: [f64; 3],
    }
}

wire_message! {
    /// All obstacles there are now (service `scene`, history 1, the latest replaces the one before).
    pub struct SceneMessage: "pcc.v2.SceneMessage", 57360 bytes {
        /// Time for which the centres hold, nanoseconds of `CLOCK_MONOTONIC`.
        pub stamp_mono_ns: i64,
        /// [`crate::PROTOCOL_VERSION`] of the sender.
        pub protocol_version: u32,
        /// Balls in use, 0..=1024.
        pub ball_count: u32,
        /// The first `ball_count` are obstacles; the others are not read.
        pub balls: [MovingBall; MAX_SCENE_BALLS],
    }
}
