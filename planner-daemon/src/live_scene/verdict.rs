//! The verdict on a scene that arrived.

use shared_types::codes::SceneRefusal;
use shared_types::message::ReasonText;
use shared_types::valid::Invalid;

/// What became of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SceneVerdict {
    pub(crate) refusal: SceneRefusal,
    /// What is wrong with a malformed scene.
    pub(crate) invalid: Option<Invalid>,
    /// Balls of the scene that count.
    pub(crate) balls: usize,
}

impl SceneVerdict {
    pub(crate) fn refused(refusal: SceneRefusal, invalid: Option<Invalid>) -> Self {
        Self {
            refusal,
            invalid,
            balls: 0,
        }
    }

    /// What is wrong with the scene, in words; empty where it counts.
    pub(crate) fn reason(&self) -> ReasonText {
        match (self.refusal, &self.invalid) {
            (SceneRefusal::None, _) => ReasonText::ZEROED,
            (refusal, None) => ReasonText::new(refusal.text()),
            (_, Some(invalid)) => ReasonText::new(&invalid.to_string()),
        }
    }

    pub(crate) fn accepted(balls: usize) -> Self {
        Self {
            refusal: SceneRefusal::None,
            invalid: None,
            balls,
        }
    }
}
