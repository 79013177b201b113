//! Clients, drivers and controllers that are set up for another robot file are refused by name, with the hashes of both.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use pcc_model::Robot;
use shared_types::codes::{LoopState, Outcome};
use shared_types::valid::{Goal, PlanRequest};
use tests::fnv1a;
use tests::process::{Process, wait_for};
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::{Settings, World};

use super::examples::{Examples, LIMIT, Program, TIP_M};
use crate::report::Report;

/// The robot file of all processes, in the folder of their configuration.
const OWN: &str = "robots/unit.toml";

pub(super) fn run(examples: &Examples, report: &mut Report) {
    let command = format!("tests/acceptance/src/join/asks*; {}", examples.command);
    report.group(&examples.line("another robot"), &command, |report| {
        client(examples, report, &(examples.asks)()?)?;
        driver(examples, report)?;
        follower(examples, report)
    });
}

/// Two robot files that differ by the robot's name, and their hashes.
struct Robots {
    files: [PathBuf; 2],
    hashes: [u64; 2],
}

impl Robots {
    fn of(world: &World) -> anyhow::Result<Self> {
        let own = world.config(OWN);
        let other = own.with_file_name("other.toml");
        let robot = fs::read_to_string(&own)?;
        fs::write(&other, robot.replace("name = \"", "name = \"another "))?;
        let files = [own, other];
        let hashes = [
            Robot::from_file(&files[0])?.hash(),
            Robot::from_file(&files[1])?.hash(),
        ];
        Ok(Self { files, hashes })
    }
}

/// A client that states its robot file is refused by a daemon of another one, which names both; by one of the same it receives the
/// bytes that a client in Rust receives for the same request.
fn client(examples: &Examples, report: &mut Report, program: &Program) -> anyhow::Result<()> {
    let mut stack = Stack::new(&Settings::default());
    let Robots {
        files: [own, other],
        hashes,
    } = Robots::of(&stack.world)?;
    stack.start(Part::Daemon);
    stack.client.wait_for_daemon(PATIENCE)?;
    let request = PlanRequest {
        candidate_count: 10,
        ..PlanRequest::new([0.0; 6], Goal::tip(TIP_M))
    };
    let answer = stack.client.plan(&request, PATIENCE)?;
    let received = format!("\n10 candidates {:016x}", fnv1a::of_knots(&answer));
    drop(answer);
    let told = asked(examples, &stack.world, program, &own)?;
    let line = examples.line("bytes of the candidates' knots as received");
    let is_same = told.starts_with("ok") && told.ends_with(&received);
    let bar = format!("ok, {} as in Rust", received.trim());
    report.check(&line, told, &bar, is_same);
    let told = asked(examples, &stack.world, program, &other)?;
    let names = format!(
        "wrong robot: the request is for robot {:016x}, this daemon plans for robot {:016x}",
        hashes[1], hashes[0]
    );
    let line = examples.line("outcome for a client of another robot file");
    let is_refused = told.starts_with(&names)
        && told.ends_with(&format!("\n0 candidates {:016x}", fnv1a::OF_NOTHING));
    report.check(&line, told, &names, is_refused);
    Ok(())
}

/// What the program `asks` says as a client of a robot file.
fn asked(
    examples: &Examples,
    world: &World,
    program: &Program,
    file: &Path,
) -> anyhow::Result<String> {
    let before = program.arguments.iter().cloned();
    let all: Vec<String> = before.chain([(examples.told_robot)(file)?]).collect();
    let all: Vec<&str> = all.iter().map(String::as_str).collect();
    let mut asking = Process::start_program(world, &program.path, &all);
    let status = asking.wait(LIMIT)?;
    ensure!(status.success(), "asks: {status}: {}", asking.log());
    Ok(asking.log().trim().to_owned())
}

/// The path of a program's settings that are the shipped ones but for the robot, whose file [`Robots::of`] has written.
fn settings_of_other(world: &World, program: &str) -> anyhow::Result<String> {
    let text = fs::read_to_string(world.config(&format!("{program}.toml")))?;
    let of_other = world.config(&format!("{program}-of-other.toml"));
    fs::write(&of_other, text.replace(OWN, "robots/other.toml"))?;
    Ok(of_other.display().to_string())
}

/// A daemon of the other robot: a program without a robot file takes the robot from what its daemon describes.
fn daemon_of_other(stack: &mut Stack) -> anyhow::Result<Process> {
    let settings = settings_of_other(&stack.world, "planner-daemon")?;
    let daemon = Process::start(&stack.world, "planner-daemon", &["--config", &settings]);
    let is_ready = stack.client.wait_for_daemon(PATIENCE);
    is_ready.with_context(|| daemon.log())?;
    Ok(daemon)
}

/// A controller does not take hold of a driver's motors that are another robot's, and says so.
fn driver(examples: &Examples, report: &mut Report) -> anyhow::Result<()> {
    let mut stack = Stack::new(&Settings::default());
    let robots = Robots::of(&stack.world)?;
    let _daemon = daemon_of_other(&mut stack)?;
    stack.start(Part::Controller);
    let other = robots.files[1].display().to_string();
    let _driving = examples.start(&stack.world, "drive", &[&other])?;
    let names = format!(
        "another robot: {:016x}, this controller's is {:016x}",
        robots.hashes[1], robots.hashes[0]
    );
    let mut told = String::new();
    let is_named = wait_for("the controller names both robots", LIMIT, || {
        let state = stack.controller.latest_state().ok().flatten()?;
        told = format!("{}: {}", state.state, state.values.reason.text());
        (state.state == LoopState::Starting && told.contains(&names)).then_some(())
    });
    let line = examples.line("what the controller says of a driver of another robot file");
    report.check(&line, told, &names, is_named.is_ok());
    Ok(())
}

/// A daemon that takes the place of the other robot's has no motion executed by the controller that is left, and says so.
fn follower(examples: &Examples, report: &mut Report) -> anyhow::Result<()> {
    let mut stack = Stack::new(&Settings::default());
    let robots = Robots::of(&stack.world)?;
    let daemon = daemon_of_other(&mut stack)?;
    let of_other = settings_of_other(&stack.world, "controller")?;
    let following = examples.start(&stack.world, "follow", &[&of_other])?;
    stack.wait_until_held().with_context(|| following.log())?;
    drop(daemon);
    stack.start(Part::Daemon);
    // The client's places are with the daemon before.
    stack.disconnect_client();
    stack.client.wait_for_daemon(PATIENCE)?;
    let request = PlanRequest {
        execute: true,
        ..PlanRequest::from_robot(Goal::tip(TIP_M))
    };
    let answer = stack.client.plan(&request, PATIENCE)?;
    let refusal = answer.report();
    let names = format!(
        "the controller's robot is {:016x}, this daemon's {:016x}",
        robots.hashes[1], robots.hashes[0]
    );
    let is_refused =
        refusal.outcome == Outcome::ExecutionRefused && refusal.reason.contains(&names);
    let line = examples.line("outcome of a motion for a follower of another robot file");
    let told = format!("{}: {}", refusal.outcome, refusal.reason);
    report.check(&line, told, &names, is_refused);
    Ok(())
}
