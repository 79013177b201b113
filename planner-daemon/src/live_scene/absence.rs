//! The reasons why a missing live scene forbids execution.

use shared_types::codes::SceneRefusal;
use shared_types::valid::SourceName;

/// Why nothing may be executed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum SceneAbsence {
    /// A scene is expected and no source has published one.
    #[error(
        "no live scene: one is expected ([live_scene] expected = true), and no source has told of any"
    )]
    Missing,
    /// A source has fallen silent without taking its leave.
    #[error(
        "the live scene of source {source_name:?} has ended: it must publish again, or take its leave (`pcc scene leave NAME`)",
        source_name = .source_name.to_string()
    )]
    Ended {
        /// The source's name.
        source_name: SourceName,
    },
    /// A live publisher, which may know of obstacles, has sent no scene.
    #[error("a publisher of scenes has not been heard (process {pid}): it must publish, or end")]
    Unheard {
        /// Process id of the publisher.
        pid: u32,
    },
    /// The scenes of a live publisher are refused.
    #[error(
        "a publisher's scenes do not count (process {pid}): {refusal}; it must {}",
        what_helps(*.refusal)
    )]
    Refused {
        /// Process id of the publisher.
        pid: u32,
        /// Why the publisher's scenes are refused.
        refusal: SceneRefusal,
    },
}

/// What a publisher must do whose scenes do not count.
fn what_helps(refusal: SceneRefusal) -> &'static str {
    match refusal {
        SceneRefusal::SeveralNames => "end",
        _ => "publish one that does, or end",
    }
}
