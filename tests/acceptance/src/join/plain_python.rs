//! Every service joined, and each part played, from Python with iceoryx2's own bindings and what `wire.json` says.

use std::path::PathBuf;

use anyhow::ensure;
use pcc_model::Robot;
use shared_types::ipc::{EVENTS, TOPICS};
use tests::process::Process;
use tests::programs::repository;
use tests::stack::Stack;
use tests::world::Settings;

use super::examples::{Examples, LIMIT, Program};
use super::languages::beside;
use super::{client_kills, other_robots, other_services};
use crate::paper_python::python_with;
use crate::report::Report;
use crate::scale::Scale;

/// How long the program listens that joins every service: longer than all that is sent takes.
const LISTENS_S: &str = "20";
/// A ball far from the robot, for two seconds.
const BALL: [&str; 8] = ["3", "0", "1", "0.1", "0.1", "0", "0", "2"];

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

/// Joins every service, and hears something of each while all that is sent is sent: a scene, a plan that is executed, a goal that stays.
fn every_service(examples: &Examples, report: &mut Report) -> anyhow::Result<()> {
    let stack = Stack::running(&Settings::default())?;
    let mut joined = examples.start(&stack.world, "services", &[LISTENS_S])?;
    examples.said(&stack.world, "scene", &BALL)?;
    examples.plan(&stack.world)?;
    let keep = ["goal", "--tip", "1", "-0.5", "2.3", "--wait"];
    let kept = Process::start(&stack.world, "pcc", &keep).wait(LIMIT)?;
    ensure!(kept.success(), "pcc goal: {kept}");
    let status = joined.wait(LIMIT)?;
    let said = joined.log();
    ensure!(status.success(), "services: {status}: {said}");
    let of_service = |name: &str| {
        let begin = format!("{name}: ");
        said.lines().find_map(|line| line.strip_prefix(&begin))
    };
    let topics = TOPICS.iter().map(|topic| topic.settings.name);
    let events = EVENTS.iter().map(|event| event.name);
    let lacking = |names: &mut dyn Iterator<Item = &'static str>, is_so: &dyn Fn(&str) -> bool| {
        let lacks = |name: &&str| !of_service(name).is_some_and(is_so);
        names.filter(lacks).map(str::to_owned).collect::<Vec<_>>()
    };
    let mut all = topics
        .clone()
        .chain(events.clone())
        .chain(["plan", "command"]);
    let missing = lacking(&mut all, &|_| true);
    report.none_of("plain Python: services that were not joined", &missing);
    let unheard = lacking(&mut events.clone(), &|it| {
        it.starts_with("heard ") && it != "heard None of its own"
    });
    report.none_of(
        "plain Python: events that did not reach a listener",
        &unheard,
    );
    let came = |it: &str| it.strip_suffix(" samples")?.parse::<u64>().ok();
    let silent = lacking(&mut topics.clone(), &|it| came(it).is_some_and(|it| it > 0));
    report.none_of("plain Python: services of which no sample came", &silent);
    let samples = topics.map(|name| format!("{name}: {}", of_service(name).unwrap_or("?")));
    report.shown(
        "plain Python: what came",
        samples.collect::<Vec<_>>().join(", "),
    );
    Ok(())
}

/// What the daemon says of each scene, as the example hears it.
fn verdicts(examples: &Examples, report: &mut Report) -> anyhow::Result<()> {
    let stack = Stack::running(&Settings::default())?;
    let told = examples.said(&stack.world, "scene", &BALL)?;
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
