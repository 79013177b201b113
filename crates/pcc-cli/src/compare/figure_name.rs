//! The figures of the page by their names, which are their anchors and what `--figures` takes.

use clap::ValueEnum;

/// A figure of the page; the paper's first, in its order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FigureName {
    /// Tip paths around a ball by denoising step, and the executed motion.
    AroundABall,
    /// The paper's network.
    Network,
    /// Denoising from a random and from the straight start.
    Denoising,
    /// Several solutions among none to four balls.
    Solutions,
    /// What guidance is worth.
    Ablation,
    /// Success and time beside the paper's rivals.
    Comparison,
    /// Two targets one after the other, executed.
    Consecutive,
    /// Two solutions of one target, executed.
    ExecutedSolutions,
    /// Avoiding a ball, executed.
    Obstacle,
    /// The best candidate by each selection rule, at equal number and at equal time.
    Best,
    /// Time against the number of candidates.
    Candidates,
    /// Success against sampling steps.
    Steps,
    /// Success against updates of the training.
    Updates,
    /// Time against tip length.
    TipLength,
    /// Latency of plans through the daemon.
    Latency,
}
