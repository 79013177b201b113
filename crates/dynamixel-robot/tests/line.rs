//! The program on serial lines without servos.
#![allow(clippy::unwrap_used)] // tests

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use tempfile::TempDir;

/// Runs the driver of servos on this line until it ends.
fn driver_on(line: &str) -> Output {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let shipped = fs::read_to_string(repository.join("config/dynamixel-robot.toml")).unwrap();
    let robot = repository.join("config/robots/unit.toml");
    let settings = shipped
        .replace("/dev/ttyUSB0", line)
        .replace("robots/unit.toml", robot.to_str().unwrap());
    let folder = TempDir::new().unwrap();
    let config = folder.path().join("dynamixel-robot.toml");
    fs::write(&config, settings).unwrap();
    Command::new(env!("CARGO_BIN_EXE_dynamixel-robot"))
        .arg("--config")
        .arg(config)
        .env("PCC_ROOT", folder.path().join("services"))
        .env("PCC_PREFIX", "line")
        .output()
        .unwrap()
}

fn assert_refused(ended: &Output, words: &[&str]) {
    let said = String::from_utf8_lossy(&ended.stderr);
    assert_eq!(ended.status.code(), Some(1), "{said}");
    for word in words {
        assert!(said.contains(word), "{word:?} is missing: {said}");
    }
}

#[test]
fn a_line_that_is_not_there_is_named_with_its_speed() {
    let words = ["\"/dev/null/line\"", "4000000 baud", "Not a directory"];
    assert_refused(&driver_on("/dev/null/line"), &words);
}

#[test]
fn a_servo_that_never_answers_is_named() {
    let terminal = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&terminal).unwrap();
    unlockpt(&terminal).unwrap();
    let line = ptsname(&terminal, Vec::new()).unwrap();
    let ended = driver_on(line.to_str().unwrap());
    assert_refused(&ended, &["servo 1 does not answer", "is it powered"]);
}
