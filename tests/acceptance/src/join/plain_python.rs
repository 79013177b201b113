//! Every service joined, and each part played, from Python with iceoryx2's own bindings and what `wire.json` says.

use std::path::PathBuf;

use pcc_model::Robot;
use shared_types::ipc::{EVENTS, TOPICS};
use tests::programs::repository;
use tests::stack::Stack;
use tests::world::Settings;

use super::examples::{Examples, Program};
use super::languages::beside;
use super::{client_kills, other_robots, other_services};
use crate::paper_python::python_with;
use crate::report::Report;
use crate::scale::Scale;

pub(super) fn run(report: &mut Report, scale: Scale) {
    let examples = examples();
    let group = |part: &str| format!("{}: {part}", examples.language);
    let command = examples.command;
    report.group(&group("every service"), command, |report| {
        every_service(&examples, report)
    });
    examples.run(report);
    other_robots::run(&examples, report);
    other_services::run(&examples, report);
    client_kills::run(&examples, report, scale);
    report.group(&group("verdicts on scenes"), command, |report| {
        verdicts(&examples, report)
    });
}

fn examples() -> Examples {
    Examples {
        language: "plain Python",
        command: "clients/plain-python",
        folder: repository().join("clients/plain-python"),
        ending: "py",
        of_all: &["\"\"\"", "import ", "from ", "#"],
        shared: Some("wire.py"),
        most_lines: 60,
        need_arguments: &["plan", "scene"],
        watched: ["executing", ": reached"],
        program: |name| {
            let script = repository().join(format!("clients/plain-python/{name}.py"));
            Ok(Program::script(plain_python()?, &script))
        },
        asks: || {
            let script = beside("asks_by_wire.py");
            Ok(Program::script(plain_python()?, &script))
        },
        // It has no robot files: it is told the hash.
        told_robot: |file| Ok(format!("{:016x}", Robot::from_file(file)?.hash())),
    }
}

/// A Python with iceoryx2's own bindings.
fn plain_python() -> anyhow::Result<PathBuf> {
    python_with(
        "venv-plain",
        "clients/plain-python/requirements.txt",
        "iceoryx2 and numpy",
    )
}

fn every_service(examples: &Examples, report: &mut Report) -> anyhow::Result<()> {
    let stack = Stack::running(&Settings::default())?;
    let said = examples.said(&stack.world, "services", &["2"])?;
    let topics = TOPICS.iter().map(|topic| topic.settings.name);
    let events = EVENTS.iter().map(|event| event.name);
    let names: Vec<&str> = topics.chain(events).chain(["plan", "command"]).collect();
    let missing: Vec<String> = names
        .iter()
        .filter(|name| {
            !said
                .lines()
                .any(|line| line.starts_with(&format!("{name}: ")))
        })
        .map(|name| (*name).to_owned())
        .collect();
    report.none_of("plain Python: services that were not joined", &missing);
    let unheard: Vec<&str> = said
        .lines()
        .filter(|line| line.contains("heard None"))
        .collect();
    report.check(
        "plain Python: events that did not reach a listener",
        format!("{unheard:?} of {}", EVENTS.len()),
        "none",
        unheard.is_empty() && said.matches(": heard ").count() == EVENTS.len(),
    );
    // What is sent all the time while the robot holds.
    for name in [
        "setpoint",
        "robot_state",
        "controller_state",
        "cycle",
        "heartbeat",
        "robot_description",
    ] {
        let line = said
            .lines()
            .find(|line| line.starts_with(&format!("{name}: ")));
        let count: usize = line
            .and_then(|line| line.split(' ').nth(1)?.parse().ok())
            .unwrap_or(0);
        report.check(
            &format!("plain Python: samples of {name} in 2 s"),
            count.to_string(),
            "> 0",
            count > 0,
        );
    }
    Ok(())
}

/// What the daemon says of each scene, as the example hears it.
fn verdicts(examples: &Examples, report: &mut Report) -> anyhow::Result<()> {
    let stack = Stack::running(&Settings::default())?;
    let ball = ["3", "0", "1", "0.1", "0.1", "0", "0", "2"];
    let told = examples.said(&stack.world, "scene", &ball)?;
    let verdicts = told.lines().filter(|line| line.starts_with("scene "));
    let refused = verdicts.clone().filter(|line| !line.contains(": none"));
    let refused: Vec<String> = refused.map(str::to_owned).collect();
    report.none_of("plain Python: scenes that do not count", &refused);
    let count = verdicts.count();
    report.check(
        "plain Python: scenes that count",
        count.to_string(),
        "> 20",
        count > 20,
    );
    Ok(())
}
