//! What keeps a motion from being certified among the obstacles of the live scene.

/// Where an obstacle of the live scene is in the way of a motion.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub(crate) enum InTheWay {
    /// Not certified free at this time of the motion's own.
    #[error("the live scene is in the way at {at_s:.3} s of it")]
    OnTheWay { at_s: f64 },
    /// It is free until its end, but not for standing there.
    #[error("the live scene is in the way: a ball comes to where it ends")]
    AtTheEnd,
}
