//! The results of trajectories, with a loop and a daemon that the test plays.

use std::path::Path;

use iceoryx2::port::update_connections::UpdateConnections;
use shared_types::{
    PROTOCOL_VERSION,
    codes::{MotionOutcome, Refusal, StopCause},
    ipc::{self, IpcNode, Publisher, Subscriber},
    message::{self, Knot},
    valid::MotionResult,
};

use super::*;
use crate::{
    arena::MemoryCounts,
    executive::StopOrigin,
    fixtures::{MS, World, curved_motion, target_configuration},
    service::link::{LoopEnd, Report, link},
};

/// A relay, the loop's end of its rings, and the daemon's ports.
struct Bench {
    relay: Relay,
    at_loop: LoopEnd,
    world: World,
    trajectories: Publisher<TrajectoryMessage>,
    results: Subscriber<message::MotionResult>,
    _node: IpcNode,
    _folder: tempfile::TempDir,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let options = IpcOptions {
            prefix: "test-relay".to_owned(),
            root: folder.path().join("root"),
        };
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/controller.toml");
        let config = ControllerConfig::from_file(&file).unwrap();
        let (at_loop, _guard, at_relay) = link();
        at_loop.shared.daemon_alive.store(true, Ordering::Relaxed);
        let node = IpcNode::create(&options, "test").unwrap();
        let trajectory = ipc::trajectory_service(&node).unwrap();
        let result = ipc::motion_result_service(&node).unwrap();
        let bench = Self {
            trajectories: ipc::publisher(&node, &trajectory).unwrap(),
            results: ipc::subscriber(&node, &result).unwrap(),
            relay: Relay::open(Arc::new(config), &options, at_relay).unwrap(),
            at_loop,
            world: World::holding(),
            _node: node,
            _folder: folder,
        };
        bench.trajectories.update_connections().unwrap();
        bench
    }

    /// The loop reports a cycle in which it holds.
    fn report_cycle(&mut self) {
        let report = Report {
            sequence: 1,
            output: self.world.last.unwrap(),
            lateness_ns: 0,
            setpoints_sent: 1,
            memory: MemoryCounts::default(),
        };
        assert!(self.at_loop.reports.push(report).is_ok());
    }

    /// Sends a trajectory that begins in a second, but for a change.
    fn send(&self, id: u32, change: impl Fn(&mut TrajectoryMessage)) {
        let from = self.world.commanded();
        let motion = curved_motion(id, 0, from, target_configuration());
        let mut wire = TrajectoryMessage {
            protocol_version: PROTOCOL_VERSION,
            trajectory_id: id,
            plan_id: 100 + u64::from(id),
            controller_instance: self.relay.view.instance(),
            robot_hash: self.relay.config.robot.hash(),
            requested_mono_ns: mono_now_ns(),
            begin_mono_ns: mono_now_ns() + 1_000 * MS,
            knot_count: motion.knots.len() as u32,
            path_tolerance_rad: 0.02,
            ..TrajectoryMessage::ZEROED
        };
        for (slot, knot) in wire.knots.iter_mut().zip(&motion.knots) {
            *slot = Knot {
                time_s: knot.time,
                configuration_rad: knot.position.into(),
                velocity_rad_s: knot.velocity.into(),
                acceleration_rad_s2: knot.acceleration.into(),
            };
        }
        change(&mut wire);
        self.trajectories.send_copy(wire).unwrap();
    }

    /// Sends a trajectory that begins in a second, which the loop is handed.
    fn hand_over(&mut self, id: u32) -> Motion {
        self.send(id, |_| ());
        self.relay.round();
        let mut handed_over = self.handed_over();
        assert_eq!(handed_over.len(), 1);
        handed_over.remove(0)
    }

    /// The trajectories that the loop was handed.
    fn handed_over(&mut self) -> Vec<Motion> {
        std::iter::from_fn(|| self.at_loop.motions.pop().ok()).collect()
    }

    fn give_back(&mut self, motion: Motion, ending: Ending) {
        self.give_back_at(mono_now_ns(), motion, ending);
    }

    fn give_back_at(&mut self, stamp_ns: i64, motion: Motion, ending: Ending) {
        let path_time_s = match ending {
            Ending::Reached => motion.duration_s(),
            _ => 0.0,
        };
        let ended = EndedMotion {
            motion,
            ending,
            path_time_s,
            stamp_ns,
        };
        assert!(self.at_loop.returns.push(Return::Ended(ended)).is_ok());
    }

    fn results(&self) -> Vec<MotionResult> {
        let next = || self.results.receive().unwrap().map(|sample| *sample);
        let results = std::iter::from_fn(next);
        results
            .map(|result| MotionResult::try_from(&result).unwrap())
            .collect()
    }
}

#[test]
fn each_trajectory_has_one_result_in_order_also_where_the_relay_was_held_up() {
    let mut bench = Bench::new();
    bench.report_cycle();
    bench.send(7, |wire| wire.knot_count = 1);
    bench.send(8, |_| ());
    bench.send(9, |wire| wire.controller_instance += 1);
    bench.send(0, |_| ());
    bench.relay.round();
    let mut taken = bench.handed_over();
    assert_eq!(taken.len(), 1);
    let told = bench.results();
    let refusals: Vec<_> = told
        .iter()
        .map(|result| (result.values.trajectory_id, result.refusal))
        .collect();
    assert_eq!(
        refusals,
        [(7, Refusal::Malformed), (9, Refusal::OtherController)]
    );
    assert_eq!(
        (told[0].values.plan_id, told[0].values.duration_s),
        (107, 0.0)
    );
    assert!(told[1].values.duration_s > 0.0);

    // While the relay is held up: the motion ends, and more trajectories come.
    bench.give_back(taken.remove(0), Ending::Reached);
    bench.send(10, |wire| wire.daemon_instance = 5);
    bench.send(11, |_| ());
    bench.relay.round();
    let told = bench.results();
    let row = |result: &MotionResult| {
        let values = &result.values;
        (values.trajectory_id, values.sequence, result.outcome)
    };
    let rows: Vec<_> = told.iter().map(row).collect();
    assert_eq!(rows, [(8, 3, MotionOutcome::Reached)]);
    assert_eq!(told[0].values.path_time_s, told[0].values.duration_s);
    assert_eq!(bench.handed_over().len(), 2);
}

#[test]
fn a_trajectory_that_comes_again_has_no_second_result() {
    let mut bench = Bench::new();
    bench.report_cycle();
    let begin_ns = mono_now_ns() + 1_000 * MS;
    for _ in 0..2 {
        bench.send(8, |wire| wire.begin_mono_ns = begin_ns);
        bench.relay.round();
    }
    assert_eq!(bench.results(), []);
    bench.send(8, |wire| wire.begin_mono_ns = begin_ns - 10_000 * MS);
    bench.relay.round();
    assert_eq!(bench.results(), [], "its motion is under way");
    let told = bench.relay.view.message(&bench.relay.link.shared);
    assert_eq!(
        told.refused_trajectory_id, 0,
        "the daemon would take it for the motion's refusal"
    );
    let motion = bench.handed_over().remove(0);
    bench.give_back(motion, Ending::SetAside(StopOrigin::Suspension));
    bench.relay.round();
    let told = bench.results();
    assert_eq!(told.len(), 1);
    assert_eq!(
        told[0].to_string(),
        "set aside before its begin: the machine was suspended"
    );
}

#[test]
fn a_motion_that_no_cycle_names_is_named_in_the_state() {
    let mut bench = Bench::new();
    bench.report_cycle();
    for (id, ending, named) in [
        (8, Ending::Reached, 8),
        (9, Ending::SetAside(StopOrigin::Signal), 8),
        (10, Ending::Stopped(StopOrigin::Signal), 10),
    ] {
        let motion = bench.hand_over(id);
        bench.give_back(motion, ending);
        bench.relay.round();
        let told = bench.relay.view.message(&bench.relay.link.shared);
        assert_eq!(told.trajectory_id, named);
    }
}

#[test]
fn a_motion_that_was_left_is_not_named_after_the_one_that_is_followed() {
    let mut bench = Bench::new();
    bench.report_cycle();
    let motion = bench.hand_over(8);
    bench.give_back(motion, Ending::Joined(9));
    bench.world.last.as_mut().unwrap().trajectory_id = 9;
    bench.world.last.as_mut().unwrap().stamp_ns = mono_now_ns();
    bench.report_cycle();
    bench.relay.round();
    let told = bench.relay.view.message(&bench.relay.link.shared);
    assert_eq!(told.trajectory_id, 9);
}

#[test]
fn a_motion_that_was_left_is_not_named_for_the_cycle_of_its_switch_whichever_is_heard_first() {
    for is_reported_first in [false, true] {
        let mut bench = Bench::new();
        bench.report_cycle();
        let motion = bench.hand_over(8);
        let stamp_ns = mono_now_ns();
        let cycle = bench.world.last.as_mut().unwrap();
        (cycle.trajectory_id, cycle.stamp_ns) = (9, stamp_ns);
        if is_reported_first {
            bench.report_cycle();
            bench.relay.round();
        }
        bench.give_back_at(stamp_ns, motion, Ending::Joined(9));
        bench.relay.round();
        if !is_reported_first {
            bench.report_cycle();
            bench.relay.round();
        }
        let told = bench.relay.view.message(&bench.relay.link.shared);
        assert_eq!(told.trajectory_id, 9);
    }
}

#[test]
fn a_cycle_that_is_told_late_does_not_name_a_motion_before_the_one_that_has_ended() {
    let mut bench = Bench::new();
    bench.report_cycle();
    let motion = bench.hand_over(8);
    bench.world.last.as_mut().unwrap().trajectory_id = 7;
    bench.world.last.as_mut().unwrap().stamp_ns = mono_now_ns();
    bench.give_back(motion, Ending::Reached);
    bench.relay.round();
    bench.report_cycle();
    bench.relay.round();
    let told = bench.relay.view.message(&bench.relay.link.shared);
    assert_eq!(told.trajectory_id, 8);
}

#[test]
fn a_flood_of_trajectories_is_taken_some_at_a_time() {
    let mut bench = Bench::new();
    bench.report_cycle();
    for id in 1..=3 {
        bench.send(id, |wire| wire.knot_count = 1);
    }
    bench.relay.is_held = true;
    bench.relay.incoming.trajectory_id = 99;
    bench.relay.round();
    let ids: Vec<u32> = bench
        .results()
        .iter()
        .map(|result| result.values.trajectory_id)
        .collect();
    assert_eq!(ids, [99, 1, 2, 3]);
    assert_eq!(ids.len(), TRAJECTORIES_A_ROUND);
}

#[test]
fn what_the_loop_has_when_the_process_ends_is_set_aside() {
    let mut bench = Bench::new();
    bench.report_cycle();
    bench.hand_over(8);
    let ended = &bench.at_loop.shared.loop_has_ended;
    ended.store(true, Ordering::Release);
    bench.relay.end();
    let told = bench.results();
    assert_eq!(told.len(), 1);
    assert_eq!(
        (told[0].outcome, told[0].cause),
        (MotionOutcome::SetAside, StopCause::Shutdown)
    );
}

#[test]
fn a_result_that_cannot_be_sent_is_sent_later() {
    let mut results = Results::new(3);
    for trajectory_id in 1..=3 {
        let subject = Subject {
            trajectory_id,
            plan_id: 0,
            duration_s: 1.0,
        };
        results.refused(&subject, &TrajectoryRefusal::Waiting);
    }
    let mut sent = Vec::new();
    for most in [1, 0, 5] {
        let mut left = most;
        results.send(|result| {
            let is_sent = left > 0;
            if is_sent {
                left -= 1;
                sent.push(result.trajectory_id);
            }
            is_sent
        });
    }
    assert_eq!(sent, [1, 2, 3]);
}
