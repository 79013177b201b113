//! Commands whose output nobody reads on.
#![allow(clippy::unwrap_used)] // tests

use std::io::{BufRead, BufReader, Read};
use std::process::{Command, Stdio};

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
