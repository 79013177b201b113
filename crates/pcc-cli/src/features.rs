//! `pcc features`: the training arrays of the few-step model.

use crate::number::whole;
use crate::output_files::make_writable_for;
use crate::robot::unit_robot;
use anyhow::Context;
use clap::{Args, ValueEnum};
use datasets::{Dataset, training_rows};
use planning::FeatureFrame;
use std::path::PathBuf;

#[derive(Clone, Copy, ValueEnum)]
enum FrameName {
    /// Turned so that the goal has azimuth zero.
    Canonical,
    /// The robot's base.
    Base,
}

/// Arguments of `pcc features`.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Folder of a data set.
    #[arg(long)]
    dataset: PathBuf,
    /// Added to the target indices (0 to 2^32 - 1), so that the targets of several data sets stay apart.
    #[arg(long, default_value_t = 0, value_parser = whole(0, u32::MAX))]
    first_group: u32,
    /// Frame of the arrays.
    #[arg(long, value_enum, default_value = "canonical")]
    frame: FrameName,
    /// Robot file.
    #[arg(long, default_value = "config/robots/unit.toml")]
    robot: PathBuf,
    /// Training archive to write.
    #[arg(long)]
    out: PathBuf,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    make_writable_for(&arguments.out)?;
    let robot = unit_robot(&arguments.robot)?;
    let dataset = Dataset::read(&arguments.dataset)
        .with_context(|| format!("data set {}", arguments.dataset.display()))?;
    let frame = match arguments.frame {
        FrameName::Canonical => FeatureFrame::Canonical,
        FrameName::Base => FeatureFrame::Base,
    };
    let rows = training_rows(&robot, &dataset.rows, arguments.first_group, frame)?;
    rows.write(&arguments.out)?;
    say!("{}: {} rows", arguments.out.display(), rows.count());
    Ok(())
}
