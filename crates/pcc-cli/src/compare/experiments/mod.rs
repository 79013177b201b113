//! The figures of the page: the paper's, made again, and those that it does not have. Each file makes one kind: its data, its
//! pictures, and the command that makes it.

mod ablation;
mod bench;
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

use super::records::SetRecords;

/// All figures, those of the paper first.
pub(super) fn all(bench: &Bench, sets: &[SetRecords]) -> anyhow::Result<Vec<Figure>> {
    let hardware = hardware::Hardware::read(bench)?;
    Ok(vec![
        denoising::around_a_ball(bench, &hardware)?,
        network::figure(bench)?,
        denoising::from_two_starts(bench)?,
        solutions::figure(bench)?,
        ablation::figure(bench)?,
        rivals::figure(bench)?,
        hardware.consecutive(bench)?,
        hardware.two_solutions(bench)?,
        hardware.obstacle(bench)?,
        candidates::figure(bench)?,
        steps::figure(bench)?,
        updates::figure()?,
        tip_length::figure(sets)?,
        latency::figure(bench)?,
    ])
}
