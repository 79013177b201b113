//! `pcc trace` as its users call it.
#![allow(clippy::unwrap_used)] // tests

use std::process::{Command, Output};

fn trace(arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_pcc"));
    command.arg("trace").args(arguments).output().unwrap()
}

fn said(output: &Output) -> &str {
    str::from_utf8(&output.stderr).unwrap()
}

#[test]
fn a_trace_without_a_tip_is_refused_by_name() {
    let output = trace(&["--out", "nowhere/trace.npz"]);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(said(&output).contains("--tip"), "{}", said(&output));
}
