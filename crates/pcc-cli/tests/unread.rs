//! Commands whose output nobody reads on.
#![allow(clippy::unwrap_used)] // tests

mod pcc;

use pcc::{empty_folder, repository};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Output, Stdio};

#[test]
fn watching_ends_quietly_where_its_reader_has_had_enough() {
    let root = std::env::temp_dir().join(format!("pcc-unread-{}", std::process::id()));
    let mut watching = Command::new(env!("CARGO_BIN_EXE_pcc"))
        .args(["watch", "--rate-hz", "100"])
        .env("PCC_ROOT", &root)
        .env("PCC_PREFIX", "unread")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut reader = BufReader::new(watching.stdout.take().unwrap());
    let mut line = String::new();
    reader.read_line(&mut line).unwrap();
    assert!(line.starts_with("controller"), "{line}");
    drop(reader);
    let status = watching.wait().unwrap();
    let mut said = String::new();
    let mut errors = watching.stderr.take().unwrap();
    errors.read_to_string(&mut said).unwrap();
    assert!(status.success() && said.is_empty(), "{status}: {said}");
    std::fs::remove_dir_all(root).unwrap();
}

/// Makes a small data set, and says so to `reader`.
fn dataset(out: &Path, reader: Stdio) -> Output {
    let robot = repository("config/robots/unit.toml");
    let words = "dataset --method paper --setting obstacle-free --targets 40 --starts 1 --ends 1";
    Command::new(env!("CARGO_BIN_EXE_pcc"))
        .args(words.split(' '))
        .args(["--threads", "1", "--robot", &robot, "--out"])
        .arg(out)
        .stdout(reader)
        .stderr(Stdio::piped())
        .output()
        .unwrap()
}

#[test]
fn a_command_does_its_work_though_nobody_reads_what_it_says() {
    let folder = empty_folder("unread");
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let output = dataset(&folder, writer.into());
    assert!(output.status.success(), "{output:?}");
    assert!(folder.join("dataset.npz").exists());
}

#[test]
fn output_that_is_lost_is_a_failure() {
    let full = File::options().write(true).open("/dev/full").unwrap();
    let output = dataset(&empty_folder("unwritten"), full.into());
    assert_eq!(output.status.code(), Some(1), "{output:?}");
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("cannot write what it says"), "{said}");
}
