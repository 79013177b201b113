//! `pcc view`: motions in 3D as one self-contained HTML page, of an evaluation's `paths.npz` or of a record.

mod archive;
mod page;
mod recorded;

use crate::number;
use crate::output_files::{make_writable_for, write_whole};
use anyhow::bail;
use clap::Args;
use std::path::PathBuf;

/// Arguments of `pcc view`.
#[derive(Args)]
pub(crate) struct Arguments {
    /// `paths.npz` of `pcc evaluate`, or a record of `pcc record`.
    file: PathBuf,
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
    let file = &arguments.file;
    let out = arguments.out.clone();
    let out = out.unwrap_or_else(|| file.with_extension("html"));
    make_writable_for(&out)?;
    let view = match file.extension().and_then(|extension| extension.to_str()) {
        Some("npz") => archive::read(file, arguments.case, &arguments.robot)?,
        Some("mcap") => recorded::read(file)?,
        _ => bail!(
            "{}: a file .npz of `pcc evaluate` or .mcap of `pcc record` is needed",
            file.display()
        ),
    };
    write_whole(&out, &page::html(&view)?)?;
    say!(
        "{}: {} motions, {:.2} s",
        out.display(),
        view.motions.len(),
        view.duration_s
    );
    Ok(())
}
