//! Motions that nobody supervises while a daemon's heart beats: none may begin, and one that runs is stopped.

use std::fs;
use std::thread::sleep;
use std::time::{Duration, Instant};

use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopState, Outcome, Refusal};
use shared_types::valid::{Command, Goal, PlanRequest};
use tests::disturbance::threads;
use tests::outside::thread_named;
use tests::played_controller::PlayedController;
use tests::process::wait_for;
use tests::stack::{PATIENCE, Part, Stack};
use tests::system_calls::HeldThread;
use tests::world::{Settings, World};

use crate::report::Report;
use crate::scale::Scale;

const FAR: [f64; 6] = [0.9, -0.6, 0.5, 0.7, -0.7, 0.9];
/// Longest time from a state that shows a motion of nobody's to the order to stop it, ms.
const ORDER_MS: f64 = 100.0;
/// An id that no daemon has given.
const FOREIGN: u32 = 4_294_000_000;

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "acceptance safe, unsupervised";
    report.group("unsupervised: late trajectories", command, |report| {
        let tries = scale.pick(1, 5);
        never_begun(
            report,
            "defect 3: a dead daemon's trajectory, heard with the next daemon there",
            tries,
            Refusal::OtherDaemon,
            of_a_dead_daemon,
        )?;
        never_begun(
            report,
            "defect 3: a trajectory heard 400 ms after its begin (begin_past_ms = 1000)",
            tries,
            Refusal::RequestedBefore,
            long_after_its_begin,
        )?;
        never_begun(
            report,
            "defect 3: a trajectory heard after `stop` had nothing to do",
            tries,
            Refusal::RequestedBefore,
            before_a_stop,
        )?;
        for (name, thread, forbid) in [
            (
                "a motion that was still being planned when `stop` had nothing to do",
                "/planning ",
                stop as Forbid,
            ),
            (
                "a request that the daemon had not read when `stop` had nothing to do",
                "/planner-daemon ",
                stop,
            ),
            (
                "a motion that was still being planned when a reset was ordered",
                "/planning ",
                reset,
            ),
            (
                "a motion that was still being planned when the controller was started again",
                "/planning ",
                restart_controller,
            ),
        ] {
            never_begun(
                report,
                &format!("defect 3: {name}"),
                tries,
                Refusal::RequestedBefore,
                || requested_before(thread, forbid),
            )?;
        }
        Ok(())
    });
    report.group("unsupervised: states", command, |report| {
        foreign_motions(report)?;
        refused_and_executed(report)?;
        forged_times(report)
    });
}

/// A trajectory that was published and must not be executed, and how long to look.
struct Published {
    stack: Stack,
    /// None where the daemon has refused it by name.
    id: Option<u32>,
    look: Duration,
}

/// None of the trajectories may move the robot, and each refusal is named.
fn never_begun(
    report: &mut Report,
    name: &str,
    tries: usize,
    refusal: Refusal,
    publish: impl Fn() -> anyhow::Result<Published>,
) -> anyhow::Result<()> {
    let (mut moved, mut named) = (Vec::new(), 0);
    for _ in 0..tries {
        let Published {
            mut stack,
            id,
            look,
        } = publish()?;
        let begin = Instant::now();
        // The daemon has refused what it has not published.
        let mut refused = id.is_none().then_some(refusal);
        while begin.elapsed() < look {
            let state = stack.controller_state();
            if id == Some(state.values.refused_trajectory_id) {
                refused = Some(state.refusal);
            }
            if matches!(state.state, LoopState::Executing | LoopState::Stopping) {
                let time_s = state.values.trajectory_time_s;
                moved.push(format!("{} at {time_s:.3} s", state.state));
                break;
            }
            sleep(Duration::from_millis(5));
        }
        named += usize::from(refused == Some(refusal));
    }
    report.none_of(&format!("{name}: executed"), &moved);
    report.all_of(&format!("{name}: refused as \"{refusal}\""), named, tries);
    Ok(())
}

/// A request for a motion that begins `ahead` from now.
fn request(stack: &mut Stack, ahead: Option<Duration>) -> PlanRequest {
    let start = stack.commanded();
    let begin = |ahead: Duration| mono_now_ns() + i64::try_from(ahead.as_nanos()).unwrap_or(0);
    PlanRequest {
        sampler: shared_types::codes::Sampler::Straight,
        candidate_count: 1,
        deadline: Some(Duration::from_secs(10)),
        execute: true,
        begin_mono_ns: ahead.map(begin),
        ..PlanRequest::new(start.into(), Goal::Configuration(FAR))
    }
}

/// Has a motion published that begins `ahead` from now; its id.
fn publish(stack: &mut Stack, ahead: Option<Duration>) -> anyhow::Result<u32> {
    let request = request(stack, ahead);
    Ok(stack.try_motion(&request)?)
}

fn hold_relay(stack: &mut Stack) -> anyhow::Result<HeldThread> {
    let controller = stack.process(Part::Controller).pid();
    Ok(HeldThread::hold(thread_named(controller, "relay"))?)
}

fn of_a_dead_daemon() -> anyhow::Result<Published> {
    const AHEAD: Duration = Duration::from_secs(8);
    let mut stack = Stack::running(&Settings::default())?;
    let relay = hold_relay(&mut stack)?;
    let id = publish(&mut stack, Some(AHEAD))?;
    stack.kill9(Part::Daemon);
    stack.start(Part::Daemon);
    // Its heart beats before it serves; the client's own places are of the daemon before.
    stack.disconnect_client();
    stack.client.wait_for_daemon(PATIENCE)?;
    sleep(Duration::from_millis(500));
    relay.release()?;
    Ok(Published {
        stack,
        id: Some(id),
        look: AHEAD + Duration::from_secs(2),
    })
}

fn long_after_its_begin() -> anyhow::Result<Published> {
    let world = World::new(&Settings::default());
    let file = world.config("controller.toml");
    let (shipped, patient) = ("begin_past_ms = 100", "begin_past_ms = 1000");
    let text = fs::read_to_string(&file)?;
    anyhow::ensure!(text.contains(shipped), "the premise: {shipped}");
    fs::write(&file, text.replace(shipped, patient))?;
    let mut stack = Stack::within(world);
    for part in Part::ALL {
        stack.start(part);
    }
    stack.wait_until_ready()?;
    let relay = hold_relay(&mut stack)?;
    let id = publish(&mut stack, None)?;
    // begin_lead_ms = 50
    sleep(Duration::from_millis(450));
    relay.release()?;
    Ok(Published {
        stack,
        id: Some(id),
        look: Duration::from_secs(2),
    })
}

fn before_a_stop() -> anyhow::Result<Published> {
    const AHEAD: Duration = Duration::from_secs(1);
    let mut stack = Stack::running(&Settings::default())?;
    stack.controller.prepare_to_command()?;
    let relay = hold_relay(&mut stack)?;
    let id = publish(&mut stack, Some(AHEAD))?;
    let reply = stack.controller.command(Command::Stop, PATIENCE)?;
    relay.release()?;
    anyhow::ensure!(
        !reply.accepted,
        "the premise: the loop has nothing to stop yet"
    );
    Ok(Published {
        stack,
        id: Some(id),
        look: AHEAD + Duration::from_secs(2),
    })
}

/// What forbids the execution of all that was requested before it.
type Forbid = fn(&mut Stack) -> anyhow::Result<()>;

fn stop(stack: &mut Stack) -> anyhow::Result<()> {
    let reply = stack.controller.command(Command::Stop, PATIENCE)?;
    anyhow::ensure!(!reply.accepted, "the premise: nothing to stop");
    Ok(())
}

fn reset(stack: &mut Stack) -> anyhow::Result<()> {
    let reply = stack.controller.command(Command::ResetFault, PATIENCE)?;
    anyhow::ensure!(!reply.accepted, "the premise: nothing to reset");
    Ok(())
}

fn restart_controller(stack: &mut Stack) -> anyhow::Result<()> {
    stack.kill9(Part::Controller);
    stack.start(Part::Controller);
    Ok(stack.wait_until_ready()?)
}

/// A motion that is asked for while threads of the daemon are held that begin with this name, and published when they go on.
fn requested_before(thread: &str, forbid: Forbid) -> anyhow::Result<Published> {
    let mut stack = Stack::running(&Settings::default())?;
    stack.controller.prepare_to_command()?;
    let request = request(&mut stack, None);
    let daemon = stack.process(Part::Daemon).pid();
    let workers = threads("", daemon);
    let workers = workers
        .iter()
        .filter(|worker| worker.name.starts_with(thread));
    let held = workers.map(|worker| HeldThread::hold(worker.id));
    let held = held.collect::<Result<Vec<_>, _>>()?;
    anyhow::ensure!(!held.is_empty(), "the premise: threads named {thread}");
    let mut pending = stack.client.submit(&request)?;
    sleep(Duration::from_millis(100));
    forbid(&mut stack)?;
    let is_planned = stack.client.poll(&mut pending)?.is_some();
    anyhow::ensure!(!is_planned, "the premise: no plan yet");
    for worker in held {
        worker.release()?;
    }
    let answer = stack.client.wait(pending, PATIENCE)?;
    let (id, reason) = (answer.report().trajectory_id, &answer.report().reason);
    anyhow::ensure!(
        id.is_some() || reason.contains("came after the request"),
        "not published: {reason}"
    );
    drop(answer);
    Ok(Published {
        id,
        stack,
        look: Duration::from_secs(2),
    })
}

/// A daemon that runs, or starts, while the controller executes what it has not published.
fn foreign_motions(report: &mut Report) -> anyhow::Result<()> {
    for daemon_first in [true, false] {
        let mut stack = Stack::new(&Settings::default());
        let mut played = PlayedController::start(&stack.world.options, stack.world.robot.hash())?;
        played.state.trajectory_id = FOREIGN;
        if daemon_first {
            stack.start(Part::Daemon);
            stack.client.wait_for_daemon(PATIENCE)?;
            played.play(Duration::from_millis(200));
            played.state.state = LoopState::Executing.code();
        } else {
            played.state.state = LoopState::Executing.code();
            stack.start(Part::Daemon);
            let client = &mut stack.client;
            let ready = played.play_until(PATIENCE, |played| {
                let is_ready = client.wait_for_daemon(Duration::from_millis(1)).is_ok();
                (is_ready || played.stops > 0).then_some(())
            });
            anyhow::ensure!(ready.is_some(), "the premise: a daemon");
        }
        let begin = Instant::now();
        let ordered = played.play_until(PATIENCE / 12, |played| (played.stops > 0).then_some(()));
        let took_ms = ordered.map_or(f64::INFINITY, |()| begin.elapsed().as_secs_f64() * 1e3);
        let when = if daemon_first {
            "a daemon that runs"
        } else {
            "a daemon that starts"
        };
        let name = format!("defect 3: {when} orders what nobody supervises to stop, ms");
        report.at_most(&name, took_ms, ORDER_MS);
    }
    Ok(())
}

/// The motion published by the daemon that the played controller holds for.
fn published_for(stack: &mut Stack, played: &mut PlayedController) -> anyhow::Result<u32> {
    played.play(Duration::from_millis(100));
    let report = planned(stack, played)?;
    let id = report.1;
    id.ok_or_else(|| anyhow::anyhow!("not published: {} {}", report.0, report.2))
}

/// Outcome, id and reason of a request to plan and execute.
fn planned(
    stack: &mut Stack,
    played: &mut PlayedController,
) -> anyhow::Result<(Outcome, Option<u32>, String)> {
    let request = PlanRequest {
        sampler: shared_types::codes::Sampler::Straight,
        candidate_count: 1,
        deadline: Some(Duration::from_secs(10)),
        execute: true,
        ..PlanRequest::new([0.0; 6], Goal::Configuration(FAR))
    };
    let client = &mut stack.client;
    let mut pending = client.submit(&request)?;
    let answer = played.play_until(PATIENCE, |_| client.poll(&mut pending).transpose());
    let answer = answer.ok_or_else(|| anyhow::anyhow!("no answer"))??;
    let report = answer.report();
    Ok((report.outcome, report.trajectory_id, report.reason.clone()))
}

/// A controller that executes a motion and says that it has refused one of the same id.
fn refused_and_executed(report: &mut Report) -> anyhow::Result<()> {
    let mut stack = Stack::new(&Settings::default());
    stack.start(Part::Daemon);
    stack.client.wait_for_daemon(PATIENCE)?;
    let mut played = PlayedController::start(&stack.world.options, stack.world.robot.hash())?;
    let id = published_for(&mut stack, &mut played)?;
    let state = &mut played.state;
    (state.trajectory_id, state.state) = (id, LoopState::Executing.code());
    (state.refused_trajectory_id, state.refusal) = (id, Refusal::OldId.code());
    played.play(Duration::from_millis(200));
    let (_, _, reason) = planned(&mut stack, &mut played)?;
    let log = stack.process(Part::Daemon).log();
    let is_over = log.contains(&format!("trajectory {id} is over"));
    let passed = !is_over && reason.contains("still to be executed");
    let ordered = log.lines().find(|line| line.contains("ordered to stop"));
    let stops = ordered.unwrap_or("no stop ordered").trim().to_owned();
    report.shown(
        "defect 3: meanwhile (a played controller may be late on a busy machine)",
        stops,
    );
    report.check(
        "defect 3: a motion that is executed, and whose id was refused as well",
        reason,
        "supervised on: neither over nor unknown",
        passed,
    );
    Ok(())
}

/// States with times of no trajectory, while one is supervised.
fn forged_times(report: &mut Report) -> anyhow::Result<()> {
    for time_s in [-1e300, 1e300] {
        let mut stack = Stack::new(&Settings::default());
        stack.start(Part::Daemon);
        stack.client.wait_for_daemon(PATIENCE)?;
        let mut played = PlayedController::start(&stack.world.options, stack.world.robot.hash())?;
        let id = published_for(&mut stack, &mut played)?;
        let state = &mut played.state;
        (state.trajectory_id, state.state) = (id, LoopState::Executing.code());
        state.trajectory_time_s = time_s;
        played.play(Duration::from_millis(300));
        let daemon = stack.process(Part::Daemon);
        let told = wait_for("it is told", PATIENCE / 12, || {
            let log = daemon.log();
            (log.contains("state is refused") && log.contains("trajectory_time_s")).then_some(())
        });
        let figure = match (daemon.is_running(), told) {
            (true, Ok(())) => "refused by name",
            (true, Err(_)) => "believed",
            (false, _) => "the daemon has ended",
        };
        let name = format!("defect 3: a state at {time_s:e} s of its trajectory");
        report.check(
            &name,
            figure.to_owned(),
            "refused by name",
            figure == "refused by name",
        );
    }
    Ok(())
}
