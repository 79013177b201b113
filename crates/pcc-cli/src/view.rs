//! `pcc view`: motions in 3D as one self-contained HTML page, of an evaluation's `paths.npz` or of a record, or served while they happen.

mod archive;
mod live;
mod page;
mod recorded;
mod samples;
mod surroundings;

use crate::number;
use crate::output_files::{make_writable_for, write_whole};
use anyhow::bail;
use clap::Args;
use std::path::{Path, PathBuf};

/// Arguments of `pcc view`.
#[derive(Args)]
pub(crate) struct Arguments {
    /// `paths.npz` of `pcc evaluate`, or a record of `pcc record`.
    #[arg(required_unless_present = "live")]
    file: Option<PathBuf>,
    /// Serve a page of what happens now, to this machine alone, until interrupted.
    #[arg(long, conflicts_with_all = ["file", "case", "robot", "out"])]
    live: bool,
    /// Port of 127.0.0.1 for --live (0: any that is free).
    #[arg(long, requires = "live", conflicts_with = "file", default_value_t = 0, value_parser = number::whole(0, u16::MAX))]
    port: u16,
    /// Scene file whose obstacles are shown, too, and count for the clearance: the one that the daemon has.
    #[arg(long)]
    scene: Option<PathBuf>,
    /// Case of `paths.npz` that is shown, counted from 0.
    #[arg(long, default_value_t = 0, value_parser = number::whole(0, usize::MAX))]
    case: usize,
    /// Robot file of `paths.npz`.
    #[arg(long, default_value = "config/robots/unit.toml")]
    robot: PathBuf,
    /// The page; without it the name of the file with .html.
    #[arg(long)]
    out: Option<PathBuf>,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    match &arguments.file {
        Some(file) => arguments.write(file),
        None => live::serve(arguments.port, arguments.scene.as_deref()),
    }
}

impl Arguments {
    fn write(&self, file: &Path) -> anyhow::Result<()> {
        let out = self.out.clone();
        let out = out.unwrap_or_else(|| file.with_extension("html"));
        make_writable_for(&out)?;
        let scene = self.scene.as_deref();
        let view = match file.extension().and_then(|extension| extension.to_str()) {
            Some("npz") => archive::read(file, self.case, &self.robot, scene)?,
            Some("mcap") => recorded::read(file, scene)?,
            _ => bail!(
                "{}: a file .npz of `pcc evaluate` or .mcap of `pcc record` is needed",
                file.display()
            ),
        };
        write_whole(&out, &page::html(&view.title, Some(&view))?)?;
        say!(
            "{}: {} motions, {:.2} s",
            out.display(),
            view.motions.len(),
            view.duration_s
        );
        Ok(())
    }
}
