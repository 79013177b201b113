//! The figures of the page: the paper's, made again, and those that it does not have. Each file makes one kind: its data and its
//! pictures.

mod ablation;
mod bench;
mod best;
mod candidates;
mod denoising;
mod figure;
mod hardware;
mod kept;
mod latency;
mod network;
mod processes;
mod rivals;
mod solutions;
mod steps;
mod tip_length;
mod updates;

pub(super) use self::bench::Bench;
pub(super) use self::figure::{Figure, Picture};
pub(super) use self::processes::remove_what_killed_runs_left;

use self::hardware::Hardware;
use super::figure_name::FigureName;
use std::cell::OnceCell;

/// Some figures, in their order.
pub(super) fn make(bench: &Bench, names: &[FigureName]) -> anyhow::Result<Vec<Figure>> {
    let executed = OnceCell::new();
    let figure = |name: &FigureName| match name {
        FigureName::AroundABall => denoising::around_a_ball(bench, once(&executed, bench)?),
        FigureName::Network => network::figure(bench),
        FigureName::Denoising => denoising::from_two_starts(bench),
        FigureName::Solutions => solutions::figure(bench),
        FigureName::Ablation => ablation::figure(bench),
        FigureName::Comparison => rivals::figure(bench),
        FigureName::Consecutive => once(&executed, bench)?.consecutive(bench),
        FigureName::ExecutedSolutions => once(&executed, bench)?.two_solutions(bench),
        FigureName::Obstacle => once(&executed, bench)?.obstacle(bench),
        FigureName::Best => best::figure(bench),
        FigureName::Candidates => candidates::figure(bench),
        FigureName::Steps => steps::figure(bench),
        FigureName::Updates => updates::figure(),
        FigureName::TipLength => tip_length::figure(bench),
        FigureName::Latency => latency::figure(bench),
    };
    names.iter().map(figure).collect()
}

/// What was executed, read with the first figure that needs it.
fn once<'a>(executed: &'a OnceCell<Hardware>, bench: &Bench) -> anyhow::Result<&'a Hardware> {
    if let Some(known) = executed.get() {
        return Ok(known);
    }
    let read = Hardware::read(bench)?;
    Ok(executed.get_or_init(|| read))
}
