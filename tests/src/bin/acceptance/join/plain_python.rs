//! Every service joined, and each part played, from Python with iceoryx2's own bindings and what `wire.json` says.

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, ensure};
use client::ScenePublisher;
use shared_types::codes::LoopState;
use shared_types::ipc::{EVENTS, TOPICS};
use shared_types::valid::{Goal, PlanRequest};
use tests::process::{Process, TimedOut, wait_for};
use tests::programs::repository;
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::{Settings, World};

use crate::paper_python::python_with;
use crate::report::Report;

/// Lines that each example may have.
const LINES: usize = 60;
/// A tip that the unit robot reaches from rest.
const TIP_M: [f64; 3] = [1.0, 0.5, 2.3];
/// How long an example may take that ends by itself.
const LIMIT: Duration = Duration::from_secs(30);

pub(super) fn run(report: &mut Report) {
    let command = "clients/plain-python";
    report.group("plain Python: every service", command, every_service);
    report.group("plain Python: plan and watch", command, plan_and_watch);
    report.group("plain Python: publish a scene", command, publish_scene);
    report.group("plain Python: drive motors", command, drive);
    report.group("plain Python: follow trajectories", command, follow);
    report.group("plain Python: lines of each example", command, lines);
}

fn folder() -> PathBuf {
    repository().join("clients/plain-python")
}

fn python() -> anyhow::Result<PathBuf> {
    python_with(
        "venv-plain",
        "clients/plain-python/requirements.txt",
        "iceoryx2 and numpy",
    )
}

fn start(world: &World, script: &str, arguments: &[&str]) -> anyhow::Result<Process> {
    let script = folder().join(script);
    let script = script
        .to_str()
        .context("the repository's path is no text")?;
    let all: Vec<&str> = ["-u", script]
        .into_iter()
        .chain(arguments.iter().copied())
        .collect();
    Ok(Process::start_program(world, &python()?, &all))
}

/// Runs an example to its end; what it says.
fn said(world: &World, script: &str, arguments: &[&str]) -> anyhow::Result<String> {
    let mut process = start(world, script, arguments)?;
    let status = process.wait(LIMIT)?;
    ensure!(status.success(), "{script}: {status}: {}", process.log());
    Ok(process.log())
}

fn tip() -> [String; 3] {
    TIP_M.map(|axis| axis.to_string())
}

fn plan(world: &World) -> anyhow::Result<String> {
    let tip = tip();
    said(world, "plan.py", &tip.each_ref().map(String::as_str))
}

/// That a planned motion was reached, as its last line says.
fn is_reached(report: &mut Report, what: &str, planned: &str) {
    let last = planned.lines().last().unwrap_or_default().to_owned();
    let reached = last.contains("reached");
    report.check(what, last, "reached", reached);
}

fn wait_until_held(stack: &mut Stack) -> Result<(), TimedOut> {
    wait_for("a controller that holds", PATIENCE, || {
        let state = stack.controller.latest_state().ok().flatten()?;
        (state.state == LoopState::Holding).then_some(())
    })
}

fn every_service(report: &mut Report) -> anyhow::Result<()> {
    let stack = Stack::running(&Settings::default())?;
    let said = said(&stack.world, "services.py", &["2"])?;
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

/// The same request from Rust has the same plan.
fn plan_and_watch(report: &mut Report) -> anyhow::Result<()> {
    let mut stack = Stack::running(&Settings::default())?;
    let request = PlanRequest {
        candidate_count: 10,
        ..PlanRequest::from_robot(Goal::tip(TIP_M))
    };
    let answer = stack.client.plan(&request, PATIENCE)?;
    let expected = format!("hash {:016x}", answer.report().plan_hash);
    drop(answer);
    let mut watching = start(&stack.world, "watch.py", &["12"])?;
    let planned = plan(&stack.world)?;
    let first = planned.lines().next().unwrap_or_default().to_owned();
    report.check(
        "plain Python: plan_hash of the same request",
        first.clone(),
        &expected,
        first.contains(&expected),
    );
    is_reached(report, "plain Python: the result of the motion", &planned);
    let status = watching.wait(LIMIT)?;
    ensure!(status.success(), "watch.py: {status}: {}", watching.log());
    let watched = watching.log();
    let sees = watched.contains("executing") && watched.contains(": reached");
    report.check(
        "plain Python: watch.py tells of the motion and its result",
        sees.to_string(),
        "true",
        sees,
    );
    Ok(())
}

fn publish_scene(report: &mut Report) -> anyhow::Result<()> {
    let stack = Stack::running(&Settings::default())?;
    let ball = ["3", "0", "1", "0.1", "0.1", "0", "0", "2"];
    let told = said(&stack.world, "scene.py", &ball)?;
    let verdicts: Vec<&str> = told
        .lines()
        .filter(|line| line.starts_with("scene "))
        .collect();
    let refused: Vec<String> = verdicts
        .iter()
        .filter(|line| !line.contains(": none"))
        .map(|line| (*line).to_owned())
        .collect();
    report.none_of("plain Python: scenes that do not count", &refused);
    let count = verdicts.len();
    report.check(
        "plain Python: scenes that count",
        count.to_string(),
        "> 20",
        count > 20,
    );
    // It has taken its leave: another source alone decides now, and its scene must count.
    let mut other = ScenePublisher::connect(&stack.world.options, "other")?;
    other.publish(&[], Duration::from_secs(60))?;
    let planned = plan(&stack.world)?;
    is_reached(report, "plain Python: a motion behind it", &planned);
    Ok(())
}

/// A driver in Python in the simulated robot's place.
fn drive(report: &mut Report) -> anyhow::Result<()> {
    let mut stack = Stack::new(&Settings::default());
    stack.start(Part::Daemon);
    stack.start(Part::Controller);
    stack.client.wait_for_daemon(PATIENCE)?;
    let mut driver = start(&stack.world, "drive.py", &[])?;
    wait_until_held(&mut stack).with_context(|| driver.log())?;
    let planned = plan(&stack.world)?;
    is_reached(report, "plain Python: a motion by a driver", &planned);
    let state = stack.controller_state();
    let error = tests::stack::tip_error(
        &stack.world.robot,
        &state.values.measured_configuration_rad,
        &TIP_M,
    );
    report.at_most("plain Python: tip error as measured, m", error, 0.03);
    driver.kill9();
    Ok(())
}

/// A controller in Python in ours' place.
fn follow(report: &mut Report) -> anyhow::Result<()> {
    let mut stack = Stack::new(&Settings::default());
    stack.start(Part::Daemon);
    stack.client.wait_for_daemon(PATIENCE)?;
    let mut follower = start(&stack.world, "follow.py", &[])?;
    wait_until_held(&mut stack).with_context(|| follower.log())?;
    let planned = plan(&stack.world).with_context(|| follower.log())?;
    is_reached(
        report,
        "plain Python: a motion followed by a controller",
        &planned,
    );
    let state = stack.controller.latest_state()?.context("no state")?;
    let error = tests::stack::tip_error(
        &stack.world.robot,
        &state.values.commanded_configuration_rad,
        &TIP_M,
    );
    report.at_most("plain Python: tip error as commanded, m", error, 0.01);
    follower.kill9();
    Ok(())
}

fn lines(report: &mut Report) -> anyhow::Result<()> {
    for entry in std::fs::read_dir(folder())? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        // What all of them share.
        if !name.ends_with(".py") || name == "wire.py" {
            continue;
        }
        let count = std::fs::read_to_string(folder().join(&name))?
            .lines()
            .count();
        let bar = format!("<= {LINES}");
        let line = format!("plain Python: lines of {name}");
        report.check(&line, count.to_string(), &bar, count <= LINES);
    }
    Ok(())
}
