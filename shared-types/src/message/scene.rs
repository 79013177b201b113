//! The live scene: obstacles that move while the robot does, and the daemon's verdicts on it.

use iceoryx2::prelude::ZeroCopySend;

use super::reason::ReasonText;
use super::wire::wire_message;
use crate::capacity::{MAX_SCENE_BALLS, SOURCE_NAME_BYTES};

wire_message! {
    /// An obstacle that keeps its velocity.
    pub struct MovingBall: "pcc.v7.MovingBall", 56 bytes {
        /// Centre in the base frame at the scene's stamp, metres.
        pub centre_m: [f64; 3],
        /// Radius, metres, not negative.
        pub radius_m: f64,
        /// Velocity of the centre, m/s.
        pub velocity_m_s: [f64; 3],
    }
}

wire_message! {
    /// All obstacles that one source knows of (service `scene`, history 1). The newest scene of a source replaces the one before;
    /// the obstacles of all sources count together. Until a publisher that is there was heard, nothing is executed: make its port with
    /// the first scene, and go on calling `update_connections` or `send`, which hand the last scene to a daemon that starts later.
    pub struct SceneMessage: "pcc.v7.SceneMessage", 57408 bytes {
        /// Time for which the centres hold, nanoseconds of `CLOCK_MONOTONIC`; not in the future.
        pub stamp_mono_ns: i64,
        /// For how long from the stamp on the scene counts, nanoseconds, 1 ms to an hour. Once it is over and no newer one is there,
        /// nothing is executed and what moves is stopped.
        pub lifetime_ns: i64,
        /// Name of the source, 1 to 32 characters of printable ASCII, the rest zero. A publisher has one: once it has sent under two
        /// names nothing is executed until it is gone; two sources want two publishers. One that starts again takes its name up
        /// again; of two that are there the second is refused.
        pub source: [u8; SOURCE_NAME_BYTES],
        /// Counts the publisher's scenes; the daemon's verdict returns it.
        pub sequence: u32,
        /// [`crate::PROTOCOL_VERSION`] of the sender.
        pub protocol_version: u32,
        /// Balls in use, 0..=1024.
        pub ball_count: u32,
        /// 1: the source takes its leave, its obstacles are gone and no scene of it is expected any more (what another publisher has told
        /// under this name counts until its lifetime ends); 0: it does not.
        pub takes_leave: u32,
        /// The first `ball_count` are obstacles; the others are not read.
        pub balls: [MovingBall; MAX_SCENE_BALLS],
    }
}

wire_message! {
    /// The verdict on a scene (service `scene_status`, publisher: the daemon). Scenes that a newer one of the same publisher
    /// replaced before they were examined get no verdict.
    pub struct SceneStatus: "pcc.v7.SceneStatus", 232 bytes {
        /// When the scene was judged, nanoseconds of `CLOCK_MONOTONIC`.
        pub stamp_mono_ns: i64,
        /// `stamp_mono_ns` of the scene.
        pub scene_stamp_mono_ns: i64,
        /// `source` of the scene.
        pub source: [u8; SOURCE_NAME_BYTES],
        /// `sequence` of the scene.
        pub sequence: u32,
        /// [`crate::PROTOCOL_VERSION`] of the daemon.
        pub protocol_version: u32,
        /// [`crate::codes::SceneRefusal`]: why the scene does not count; none: it does.
        pub refusal: u32,
        /// Balls of the scene that count.
        pub ball_count: u32,
        /// What is wrong with the scene, in words.
        pub reason: ReasonText,
    }
}
