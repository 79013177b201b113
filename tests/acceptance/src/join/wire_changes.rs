//! A change of `shared-types` that `wire.json` does not tell of fails a test that `scripts/test` runs.

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use anyhow::{Context, ensure};
use tests::programs::repository;

use crate::demo::clean_clone;
use crate::report::Report;

const COMMAND: &str =
    "cargo test --locked -p shared-types --test description -- --exact, in a changed clone";

/// The test that compares `wire.json` with the types.
const TEST: &str = "wire_json_is_what_the_types_say";

/// A change of the source.
struct Change {
    what: &'static str,
    file: &'static str,
    from: &'static str,
    to: &'static str,
}

const CHANGES: [Change; 8] = [
    Change {
        what: "a service's buffer",
        file: "shared-types/src/ipc/topic.rs",
        from: "    buffer: 4,\n",
        to: "    buffer: 5,\n",
    },
    Change {
        what: "an event's listeners",
        file: "shared-types/src/ipc/event.rs",
        from: "listeners: NODES",
        to: "listeners: NODES - 1",
    },
    Change {
        what: "a constant",
        file: "shared-types/src/capacity.rs",
        from: "RECENT_PLANS: usize = 16",
        to: "RECENT_PLANS: usize = 17",
    },
    Change {
        what: "a code of an enumeration",
        file: "crates/codes/src/plan.rs",
        from: "Early = 13 \"early\"",
        to: "Early = 33 \"early\"",
    },
    Change {
        what: "two fields in another order",
        file: "shared-types/src/message/plan.rs",
        from: "Length of the tip's path, metres.\n        pub tip_path_m: f64,\n        /// Least distance of the body's surface to an obstacle, metres; infinite without obstacles.\n        pub clearance_m: f64,",
        to: "Least distance of the body's surface to an obstacle, metres; infinite without obstacles.\n        pub clearance_m: f64,\n        /// Length of the tip's path, metres.\n        pub tip_path_m: f64,",
    },
    Change {
        what: "a message's name",
        file: "shared-types/src/message/heartbeat.rs",
        from: "\"pcc.v7.Heartbeat\"",
        to: "\"pcc.v7.Heart\"",
    },
    Change {
        what: "a service's name",
        file: "shared-types/src/ipc/topic.rs",
        from: "name: \"scene_status\"",
        to: "name: \"scene_state\"",
    },
    Change {
        what: "a field's meaning",
        file: "shared-types/src/message/trajectory.rs",
        from: "Time since the motion's begin, seconds.",
        to: "Time since the motion's begin, milliseconds.",
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
        "wire: its test without a change",
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
        if !said.contains(&format!("test {TEST} ... FAILED")) {
            let errors = String::from_utf8_lossy(&tested.stderr);
            unnoticed.push(format!("{}: {}", change.what, last_line(&errors)));
        }
        fs::write(&file, before)?;
    }
    let line = format!(
        "wire: changes of shared-types that are not in wire.json, of {}, that its test does not find",
        CHANGES.len()
    );
    report.none_of(&line, &unnoticed);
    let test = fs::read_to_string(repository().join("scripts/test"))?;
    let runs_all = test.contains("cargo test --workspace --locked");
    report.check(
        "wire: scripts/test runs that test",
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
        .args(["--test", "description", "--", "--exact", TEST])
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
