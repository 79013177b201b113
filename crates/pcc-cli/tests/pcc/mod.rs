//! The program, and what it is given.
#![allow(
    dead_code,
    unreachable_pub,
    reason = "each test program uses the part of it that it needs"
)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Runs `pcc` until it ends.
pub fn pcc(arguments: &[String]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pcc"));
    command.args(arguments).output().unwrap()
}

/// What it wrote to stderr.
pub fn said(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// A file or folder of the repository.
pub fn repository(path: &str) -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    root.join(path).display().to_string()
}

/// The folder with the small diffusion model `sampled` of the parity test.
pub fn fixture() -> String {
    repository("crates/planning/tests/fixtures")
}

/// A folder of this name for one test, without what an earlier run left.
pub fn empty_folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    folder
}
