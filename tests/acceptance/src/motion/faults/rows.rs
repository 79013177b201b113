//! The rows of the fault table: what is done, what the controller is to do, and what makes everything go on.

use std::thread::sleep;
use std::time::Duration;

use client::ScenePublisher;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{CommandRefusal, LoopFault, Refusal};
use shared_types::message::TrajectoryMessage;
use shared_types::valid::Command;
use tests::bridge::Bridge;
use tests::process::wait_for;
use tests::raw_scene::Flood;
use tests::stack::{PATIENCE, Part};

use super::floods::CommandFlood;
use super::messages::BAD_MESSAGES;
use super::stand::{Joining, Stand, Way};

/// A reply to an order comes within this.
const PROMPT: Duration = Duration::from_secs(2);
/// Between two messages, so that the controller's relay comes to each.
const BETWEEN: Duration = Duration::from_millis(4);
/// How long a frozen process stands still.
const FROZEN: Duration = Duration::from_millis(600);
/// Ids of messages that no daemon has sent, above those of the daemon.
const FOREIGN_IDS: u32 = 100_000;
/// How long a flood lasts: until the switch is passed, and longer.
const FLOODED: Duration = Duration::from_millis(800);
/// Messages that are a flood.
const A_FLOOD: u64 = 1_000;
/// Publishers of scenes that flood: a request takes the balls of two beside its own.
const FLOODING: usize = 2;

/// How a fault is injected; says when, nanoseconds by the clock of the messages.
pub(super) type Inject = fn(&mut Stand, &Joining) -> anyhow::Result<i64>;
/// What an operator does afterwards.
pub(super) type Mend = fn(&mut Stand) -> anyhow::Result<()>;

/// One fault.
pub(super) struct Row {
    pub(super) name: &'static str,
    /// What is set up before the joining motion is asked for, where its message is to be changed on its way.
    pub(super) intercept: Option<fn(&mut Stand)>,
    /// How daemon and controller speak with each other.
    pub(super) way: Way,
    /// Whether the joining motion is pending when the fault is injected.
    pub(super) is_pending: bool,
    pub(super) inject: Inject,
    /// How the motion that is to be left ends, and the joining one.
    pub(super) ends: [&'static str; 2],
    pub(super) mend: Mend,
    pub(super) recovery: &'static str,
}

const ROW: Row = Row {
    name: "",
    intercept: None,
    way: Way::Direct,
    is_pending: true,
    inject: |_, _| Ok(0),
    ends: ["joined by another trajectory", "reached"],
    mend: nothing,
    recovery: "nothing is to be done",
};

/// A row whose joining motion is changed on its way, and refused.
const CHANGED: Row = Row {
    way: Way::Bridge,
    is_pending: false,
    inject: |_, _| Ok(mono_now_ns()),
    ends: ["reached", "refused (discontinuous at its switch)"],
    ..ROW
};

/// All rows.
pub(super) const ROWS: &[Row] = &[
    Row {
        name: "bad messages while a switch is pending",
        way: Way::Bridge,
        inject: send_bad_messages,
        ..ROW
    },
    Row {
        name: "bad message under the id of the pending motion",
        way: Way::Bridge,
        inject: repeat_id,
        ..ROW
    },
    Row {
        name: "late: the joining motion comes after its switch",
        intercept: Some(|stand| stand.bridge().hold_joining()),
        inject: come_late,
        ends: ["reached", "refused (came after its switch)"],
        ..CHANGED
    },
    Row {
        name: "discontinuity of 2e-9 (rad)",
        intercept: Some(|stand| change(stand, |m| m.knots[0].configuration_rad[2] += 2e-9)),
        ..CHANGED
    },
    Row {
        name: "discontinuity of 2e-9 (rad/s)",
        intercept: Some(|stand| change(stand, |m| m.knots[0].velocity_rad_s[2] += 2e-9)),
        ..CHANGED
    },
    Row {
        name: "discontinuity of 2e-9 (rad/s²)",
        intercept: Some(|stand| change(stand, |m| m.knots[0].acceleration_rad_s2[2] += 2e-9)),
        ..CHANGED
    },
    Row {
        name: "flood of trajectories",
        way: Way::Bridge,
        inject: flood_trajectories,
        ..ROW
    },
    Row {
        name: "flood of commands",
        inject: flood_commands,
        ..ROW
    },
    Row {
        name: "flood of scenes",
        inject: flood_scenes,
        mend: sign_off_floods,
        recovery: "the sources are signed off (`pcc scene leave`): what they told counts for its lifetime",
        ..ROW
    },
    Row {
        name: "torn: the publisher of trajectories killed in the middle of writing one",
        way: Way::BridgeProcess,
        inject: tear,
        ends: [
            "stopped (the daemon was lost)",
            "set aside before its begin (the daemon was lost)",
        ],
        mend: bridge_again,
        recovery: "the publisher is started again",
        ..ROW
    },
    Row {
        name: "daemon killed",
        inject: |stand, _| kill(stand, Part::Daemon),
        ends: [
            "stopped (the daemon was lost)",
            "set aside before its begin (the daemon was lost)",
        ],
        mend: |stand| start(stand, Part::Daemon),
        recovery: "the daemon is started again",
        ..ROW
    },
    Row {
        name: "daemon frozen for 0.6 s",
        inject: |stand, _| freeze(stand, Part::Daemon),
        ends: [
            "stopped (the daemon was lost)",
            "set aside before its begin (the daemon was lost)",
        ],
        recovery: "nothing is to be done once it goes on",
        ..ROW
    },
    Row {
        name: "daemon ended",
        inject: end_daemon,
        ends: [
            "stopped (a command to stop)",
            "set aside before its begin (a command to stop)",
        ],
        mend: |stand| start(stand, Part::Daemon),
        recovery: "the daemon is started again",
        ..ROW
    },
    Row {
        name: "robot killed",
        inject: |stand, _| kill(stand, Part::Robot),
        ends: [
            "stopped (a fault, robot lost)",
            "set aside before its begin (a fault, robot lost)",
        ],
        mend: |stand| {
            start(stand, Part::Robot)?;
            reset(stand, LoopFault::RobotLost)
        },
        recovery: "the robot is started again, and a reset",
        ..ROW
    },
    Row {
        name: "robot frozen for 0.6 s",
        inject: |stand, _| freeze(stand, Part::Robot),
        ends: [
            "stopped (a fault, robot lost)",
            "set aside before its begin (a fault, robot lost)",
        ],
        mend: |stand| reset(stand, LoopFault::RobotLost),
        recovery: "a reset once it goes on",
        ..ROW
    },
    Row {
        name: "controller killed",
        inject: |stand, _| kill(stand, Part::Controller),
        ends: ["no result", "no result"],
        mend: |stand| start(stand, Part::Controller),
        recovery: "the controller is started again",
        ..ROW
    },
    Row {
        name: "controller frozen for 0.6 s",
        inject: |stand, _| freeze(stand, Part::Controller),
        ends: [
            "stopped (a fault, robot ramped to rest)",
            "set aside before its begin (a fault, robot ramped to rest)",
        ],
        mend: |stand| reset(stand, LoopFault::RobotRampedToRest),
        recovery: "a reset once it goes on",
        ..ROW
    },
];

fn nothing(_: &mut Stand) -> anyhow::Result<()> {
    Ok(())
}

fn change(stand: &mut Stand, change: fn(&mut TrajectoryMessage)) {
    stand.bridge().change_joining(change);
}

fn good(stand: &Stand) -> TrajectoryMessage {
    stand.bridge().joining().expect("it was waited for")
}

/// Each is refused by its own name, and the pending motion knows nothing of it.
fn send_bad_messages(stand: &mut Stand, _: &Joining) -> anyhow::Result<i64> {
    let good = good(stand);
    let fault_ns = mono_now_ns();
    let ids = good.trajectory_id + FOREIGN_IDS..;
    for (bad, id) in BAD_MESSAGES.iter().zip(ids.clone()) {
        stand.bridge().send(&[bad.of(&good, id)]);
        sleep(BETWEEN);
    }
    let expected: Vec<(u32, Refusal, &str)> = BAD_MESSAGES
        .iter()
        .zip(ids)
        .map(|(bad, id)| (id, bad.refusal, bad.what))
        .collect();
    stand.are_refused(&expected)?;
    Ok(fault_ns)
}

fn repeat_id(stand: &mut Stand, _: &Joining) -> anyhow::Result<i64> {
    let mut repeated = good(stand);
    repeated.knots[1].time_s = f64::NAN;
    let fault_ns = mono_now_ns();
    stand.bridge().send(&[repeated]);
    wait_for("it is refused in the log", PROMPT, || {
        let log = stand.stack.process(Part::Controller).log();
        log.contains("what repeats the id of a motion under way is refused")
            .then_some(())
    })?;
    Ok(fault_ns)
}

fn come_late(stand: &mut Stand, joining: &Joining) -> anyhow::Result<i64> {
    stand.wait_until(joining.left, joining.switch_s + 0.02)?;
    let fault_ns = mono_now_ns();
    stand.bridge().let_go();
    Ok(fault_ns)
}

fn flood_trajectories(stand: &mut Stand, _: &Joining) -> anyhow::Result<i64> {
    let mut message = good(stand);
    message.trajectory_id += FOREIGN_IDS;
    let first_id = message.trajectory_id;
    let fault_ns = mono_now_ns();
    stand.bridge().flood(Some(message));
    sleep(FLOODED);
    stand.bridge().flood(None);
    let (sent, refused) = (stand.bridge().flooded(), stand.refused_from(first_id));
    anyhow::ensure!(
        sent >= A_FLOOD && refused > 0,
        "{sent} sent, {refused} refused"
    );
    stand.note(format!("{sent} trajectories, {refused} of them refused"));
    Ok(fault_ns)
}

fn flood_commands(stand: &mut Stand, _: &Joining) -> anyhow::Result<i64> {
    let fault_ns = mono_now_ns();
    let flood = CommandFlood::start(&stand.stack.world.options);
    sleep(FLOODED);
    let sent = flood.end();
    anyhow::ensure!(sent >= A_FLOOD, "{sent} sent");
    stand.note(format!("{sent} commands"));
    Ok(fault_ns)
}

fn flood_scenes(stand: &mut Stand, _: &Joining) -> anyhow::Result<i64> {
    let fault_ns = mono_now_ns();
    let flood = Flood::start(&stand.stack.world.options, FLOODING);
    sleep(FLOODED);
    let (sent, alive) = (flood.sent(), flood.alive());
    anyhow::ensure!(
        sent >= A_FLOOD && alive == FLOODING,
        "{sent} sent, {alive} alive"
    );
    stand.note(format!("{sent} scenes of {alive} publishers"));
    Ok(fault_ns)
}

/// Without that nothing would be executed once what they told ends.
fn sign_off_floods(stand: &mut Stand) -> anyhow::Result<()> {
    for index in 0..FLOODING {
        let name = format!("flood {index}");
        let mut source = ScenePublisher::connect(&stand.stack.world.options, &name)?;
        source.take_leave()?;
        source.confirm(PROMPT)?;
    }
    Ok(())
}

fn tear(stand: &mut Stand, _: &Joining) -> anyhow::Result<i64> {
    let bridge = stand.bridge_process.as_mut();
    let bridge = bridge.expect("the row has a bridge that is a process");
    bridge.tear();
    let fault_ns = mono_now_ns();
    bridge.kill9();
    Ok(fault_ns)
}

fn bridge_again(stand: &mut Stand) -> anyhow::Result<()> {
    stand.bridge_process = None;
    let [near, far] = stand.stack.worlds();
    stand.bridge = Some(Bridge::start(&near.options, &far.options));
    // The controller hears the daemon again, and the daemon the controller.
    sleep(FROZEN);
    Ok(())
}

fn kill(stand: &mut Stand, part: Part) -> anyhow::Result<i64> {
    let fault_ns = mono_now_ns();
    stand.stack.kill9(part);
    Ok(fault_ns)
}

fn start(stand: &mut Stand, part: Part) -> anyhow::Result<()> {
    stand.stack.start(part);
    stand.stack.client.wait_for_daemon(PATIENCE)?;
    Ok(())
}

fn freeze(stand: &mut Stand, part: Part) -> anyhow::Result<i64> {
    let fault_ns = mono_now_ns();
    stand.stack.process(part).signal(libc::SIGSTOP);
    sleep(FROZEN);
    stand.stack.process(part).signal(libc::SIGCONT);
    Ok(fault_ns)
}

fn end_daemon(stand: &mut Stand, _: &Joining) -> anyhow::Result<i64> {
    let fault_ns = mono_now_ns();
    let status = stand.stack.process(Part::Daemon).sigterm(PATIENCE)?;
    anyhow::ensure!(status.success(), "the daemon ended with {status}");
    Ok(fault_ns)
}

/// Resets the fault that is expected, once.
fn reset(stand: &mut Stand, fault: LoopFault) -> anyhow::Result<()> {
    let view = &mut stand.stack.controller;
    wait_for("the fault", PATIENCE, || {
        let state = view.latest_state().ok().flatten()?;
        (state.fault == fault).then_some(())
    })?;
    let reply = view.command(Command::ResetFault, PROMPT)?;
    anyhow::ensure!(
        reply.accepted && reply.refusal == CommandRefusal::None,
        "the reset is refused: {}",
        reply.reason
    );
    Ok(())
}

#[cfg(test)]
mod documentation {
    use std::collections::BTreeSet;

    use super::super::documented::{table, without_detail};
    use super::ROWS;

    #[test]
    fn every_row_of_the_documented_table_is_injected_and_every_fault_is_documented() {
        let documented: BTreeSet<String> = table().unwrap().into_iter().map(|it| it.name).collect();
        let injected = ROWS.iter().map(|row| without_detail(row.name).to_owned());
        assert_eq!(documented, injected.collect());
    }
}
