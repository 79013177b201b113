//! A change of `shared-types` that `wire.json` does not tell of, or C's messages where it is one of layout, fails a test that `scripts/test` runs.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use anyhow::{Context, ensure};
use tests::programs::repository;

use crate::demo::clean_clone;
use crate::report::Report;

const COMMAND: &str = "cargo test --locked -p shared-types --test description, in a changed clone";

/// The test that compares `wire.json` with the types.
const WIRE: &str = "wire_json_is_what_the_types_say";
/// The test that compares C's messages, which assert their layouts, with the types.
const C: &str = "the_messages_for_c_are_what_the_types_say";

/// What `scripts/test` runs all tests with.
const ALL_TESTS: &str = "cargo test --workspace --locked";

/// A change of the source.
struct Change {
    what: &'static str,
    file: &'static str,
    from: &'static str,
    to: &'static str,
    /// Whether C's messages have it, too.
    is_in_c: bool,
}

const CHANGES: [Change; 8] = [
    Change {
        what: "a service's buffer",
        file: "shared-types/src/ipc/topic.rs",
        from: "    buffer: 4,\n",
        to: "    buffer: 5,\n",
        is_in_c: false,
    },
    Change {
        what: "an event's listeners",
        file: "shared-types/src/ipc/event.rs",
        from: "listeners: NODES",
        to: "listeners: NODES - 1",
        is_in_c: false,
    },
    Change {
        what: "a constant",
        file: "shared-types/src/capacity.rs",
        from: "RECENT_PLANS: usize = 16",
        to: "RECENT_PLANS: usize = 17",
        is_in_c: true,
    },
    Change {
        what: "a code of an enumeration",
        file: "crates/codes/src/plan.rs",
        from: "Early = 13 \"early\"",
        to: "Early = 33 \"early\"",
        is_in_c: true,
    },
    Change {
        what: "two fields in another order",
        file: "shared-types/src/message/plan.rs",
        from: "Length of the tip's path, metres.\n        pub tip_path_m: f64,\n        /// Least distance of the body's surface to an obstacle, metres; infinite without obstacles.\n        pub clearance_m: f64,",
        to: "Least distance of the body's surface to an obstacle, metres; infinite without obstacles.\n        pub clearance_m: f64,\n        /// Length of the tip's path, metres.\n        pub tip_path_m: f64,",
        is_in_c: true,
    },
    Change {
        what: "a message's name",
        file: "shared-types/src/message/heartbeat.rs",
        from: "\"pcc.v7.Heartbeat\"",
        to: "\"pcc.v7.Heart\"",
        is_in_c: false,
    },
    Change {
        what: "a service's name",
        file: "shared-types/src/ipc/topic.rs",
        from: "name: \"scene_status\"",
        to: "name: \"scene_state\"",
        is_in_c: false,
    },
    Change {
        what: "a field's meaning",
        file: "shared-types/src/message/trajectory.rs",
        from: "Time since the motion's begin, seconds.",
        to: "Time since the motion's begin, milliseconds.",
        is_in_c: false,
    },
];

pub(super) fn run(report: &mut Report) {
    report.group("wire: changes that it does not tell of", COMMAND, changes);
}

fn changes(report: &mut Report) -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let clone = folder.path().join("clone");
    clean_clone(&clone)?;
    let unchanged = description(&clone)?;
    report.check(
        "wire: its tests without a change",
        unchanged.status.to_string(),
        "exit status: 0",
        unchanged.status.success(),
    );
    let mut unnoticed = Vec::new();
    for change in &CHANGES {
        let file = clone.join(change.file);
        let before = fs::read_to_string(&file)?;
        ensure!(
            before.contains(change.from),
            "{}: no {:?}",
            change.file,
            change.from
        );
        fs::write(&file, before.replacen(change.from, change.to, 1))?;
        let tested = description(&clone)?;
        let said = String::from_utf8_lossy(&tested.stdout);
        let tests: &[&str] = if change.is_in_c { &[WIRE, C] } else { &[WIRE] };
        for test in tests {
            if !said.contains(&format!("test {test} ... FAILED")) {
                let errors = String::from_utf8_lossy(&tested.stderr);
                unnoticed.push(format!("{}, {test}: {}", change.what, last_line(&errors)));
            }
        }
        fs::write(&file, before)?;
    }
    let line = format!(
        "wire: changes of shared-types that are not in wire.json, of {}, that its test does not find, nor that of C's messages where they have them",
        CHANGES.len()
    );
    report.none_of(&line, &unnoticed);
    let test = fs::read_to_string(repository().join("scripts/test"))?;
    let is_step = |line: &str| line.starts_with("step ") && line.contains(ALL_TESTS);
    let runs_all = test.lines().any(is_step);
    report.check(
        "wire: scripts/test runs those tests",
        if runs_all {
            "with all others"
        } else {
            "not found"
        }
        .to_owned(),
        "with all others",
        runs_all,
    );
    Ok(())
}

fn description(clone: &Path) -> anyhow::Result<Output> {
    Command::new("cargo")
        .current_dir(clone)
        .args(["test", "--locked", "-p", "shared-types"])
        .args(["--test", "description"])
        .env(
            "CARGO_TARGET_DIR",
            repository().join("target/acceptance/wire-changes"),
        )
        .env_remove("UPDATE_EXPECT")
        .output()
        .context("cargo")
}

fn last_line(text: &str) -> &str {
    text.trim_end().lines().last().unwrap_or_default()
}
