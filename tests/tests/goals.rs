//! The goal that stays, through daemon, controller and robot as they are.
#![allow(clippy::unwrap_used)]

use std::thread::sleep;
use std::time::Duration;

use client::{ClientError, GoalSender};
use shared_types::clock::mono_now_ns;
use shared_types::codes::{GoalState, LoopFault, LoopState, Outcome};
use shared_types::ipc::*;
use shared_types::message;
use shared_types::valid::{Command, Goal, GoalStatus, PlanRequest, StandingGoal};
use tests::listener::Listener;
use tests::process::wait_for;
use tests::stack::{NO_DEADLINE, PATIENCE, Part, Stack};
use tests::world::Settings;

/// Three tips that can be reached, m.
const TIPS_M: [[f64; 3]; 3] = [[1.0, 0.6, 2.2], [1.0, -0.6, 2.2], [-0.6, 0.9, 2.2]];
/// Longer than a plan, a period of the states and a stop: whoever was to move does within it.
const A_WHILE: Duration = Duration::from_millis(600);

fn given(goal: Goal) -> StandingGoal {
    let now = mono_now_ns();
    StandingGoal {
        given_mono_ns: now,
        stamp_mono_ns: now,
        goal,
        tip_velocity_m_s: [0.0; 3],
        limits_scale: 1.0,
        robot_hash: None,
        is_withdrawn: false,
    }
}

/// A sender that sends whatever it is told to, and hears all statuses.
struct RawSender {
    goals: Publisher<message::StandingGoal>,
    statuses: Subscriber<message::GoalStatus>,
    asked: EventNotifier,
    _node: IpcNode,
}

impl RawSender {
    fn connect(options: &IpcOptions) -> Self {
        let node = IpcNode::create(options, "raw-goals").unwrap();
        Self {
            goals: publisher(&node, &goal_service(&node).unwrap()).unwrap(),
            statuses: subscriber(&node, &goal_status_service(&node).unwrap()).unwrap(),
            asked: event_notifier(&node, &plan_asked_event(&node).unwrap()).unwrap(),
            _node: node,
        }
    }

    fn send(&self, goal: message::StandingGoal) {
        self.goals.send_copy(goal).unwrap();
        self.asked.notify().unwrap();
    }

    /// Waits for a status.
    fn expect(&self, what: &str, is_so: impl Fn(&GoalStatus) -> bool) -> GoalStatus {
        let heard = wait_for(what, PATIENCE, || {
            let sample = self.statuses.receive().unwrap()?;
            let status = GoalStatus::try_from(&*sample).unwrap();
            is_so(&status).then_some(status)
        });
        heard.unwrap()
    }
}

fn sender(stack: &Stack) -> GoalSender {
    GoalSender::connect(&stack.world.options).unwrap()
}

fn expect(goal: &mut GoalSender, state: GoalState) -> GoalStatus {
    let status = goal.wait_for(PATIENCE, |status| status.state == state);
    let last = goal.status().unwrap().map(|status| status.to_string());
    status
        .unwrap()
        .unwrap_or_else(|| panic!("not {state} but {last:?}"))
}

fn assert_at(stack: &mut Stack, position_m: [f64; 3]) {
    let configuration = stack.commanded().into();
    let error_m = stack.world.body().tip_error(&configuration, &position_m);
    assert!(error_m <= 0.01, "{error_m} m from {position_m:?}");
}

/// A goal whose motion is well under way.
fn underway(stack: &mut Stack, position_m: [f64; 3]) -> GoalSender {
    let mut goal = sender(stack);
    goal.give(Goal::tip(position_m), 1.0).unwrap();
    let status = expect(&mut goal, GoalState::Underway);
    let id = status.values.trajectory_id;
    stack.wait_for_progress(id, 0.2).unwrap();
    goal
}

/// Waits until the robot rests; where.
fn rests(stack: &mut Stack) -> [f64; 6] {
    wait_for("the robot rests", PATIENCE, || {
        (stack.controller_state().state == LoopState::Holding).then_some(())
    })
    .unwrap();
    stack.commanded().into()
}

#[test]
fn a_goal_is_reached_and_one_that_moves_under_way_is_reached_without_a_stop_between() {
    let mut stack = Stack::running(&Settings::default().patient()).unwrap();
    let mut goal = sender(&stack);
    goal.give(Goal::tip(TIPS_M[0]), 1.0).unwrap();
    expect(&mut goal, GoalState::Reached);
    assert_at(&mut stack, TIPS_M[0]);
    goal.move_to(Goal::tip(TIPS_M[1]), [0.0; 3]).unwrap();
    let status = expect(&mut goal, GoalState::Underway);
    let id = status.values.trajectory_id;
    stack.wait_for_progress(id, 0.2).unwrap();
    let listener = Listener::start(&stack.world.options);
    goal.move_to(Goal::tip(TIPS_M[2]), [0.0; 3]).unwrap();
    expect(&mut goal, GoalState::Reached);
    assert_at(&mut stack, TIPS_M[2]);
    let heard = listener.take();
    let states: Vec<u32> = heard.cycles.iter().map(|cycle| cycle.state).collect();
    let [executing, holding] = [LoopState::Executing, LoopState::Holding].map(LoopState::code);
    let last_move = states
        .iter()
        .rposition(|state| *state == executing)
        .unwrap();
    let moving = &states[..=last_move];
    assert!(
        moving.len() > 100,
        "the premise, it moved: {}",
        moving.len()
    );
    assert!(!moving.contains(&holding), "it rested in between");
    assert!(heard.motions.iter().any(|motion| motion.leaves.is_some()));
}

#[test]
fn a_stop_by_a_program_ends_a_goal_however_often_it_is_sent_again_and_only_another_one_moves_the_robot()
 {
    let mut stack = Stack::running(&Settings::default().patient()).unwrap();
    let mut goal = underway(&mut stack, TIPS_M[0]);
    stack.controller.command(Command::Stop, PATIENCE).unwrap();
    let rested = rests(&mut stack);
    let status = expect(&mut goal, GoalState::Ended);
    assert!(status.to_string().contains("stop"), "{status}");
    for _ in 0..20 {
        goal.move_to(Goal::tip(TIPS_M[1]), [0.0; 3]).unwrap();
        sleep(A_WHILE / 20);
    }
    assert_eq!(rests(&mut stack), rested);
    goal.give(Goal::tip(TIPS_M[1]), 1.0).unwrap();
    expect(&mut goal, GoalState::Reached);
    // And at rest.
    stack.controller.command(Command::Stop, PATIENCE).unwrap();
    expect(&mut goal, GoalState::Ended);
    goal.move_to(Goal::tip(TIPS_M[0]), [0.0; 3]).unwrap();
    sleep(A_WHILE);
    assert_at(&mut stack, TIPS_M[1]);
}

#[test]
fn a_goal_that_is_withdrawn_brakes_the_robot_and_another_one_may_be_given_at_once() {
    let mut stack = Stack::running(&Settings::default().patient()).unwrap();
    let mut goal = underway(&mut stack, TIPS_M[0]);
    goal.withdraw().unwrap();
    expect(&mut goal, GoalState::Ended);
    let rested = rests(&mut stack);
    let error_m = stack.world.body().tip_error(&rested, &TIPS_M[0]);
    assert!(
        error_m > 0.05,
        "the premise, it was on its way: {error_m} m"
    );
    sleep(A_WHILE);
    assert_eq!(rests(&mut stack), rested);
    let mut goal = underway(&mut stack, TIPS_M[0]);
    goal.withdraw().unwrap();
    goal.give(Goal::tip(TIPS_M[1]), 1.0).unwrap();
    expect(&mut goal, GoalState::Reached);
    assert_at(&mut stack, TIPS_M[1]);
}

#[test]
fn of_two_senders_the_later_given_goal_counts_and_a_clients_motion_ends_it() {
    let mut stack = Stack::running(&Settings::default().patient()).unwrap();
    let mut first = underway(&mut stack, TIPS_M[0]);
    let mut second = sender(&stack);
    second.give(Goal::tip(TIPS_M[1]), 1.0).unwrap();
    expect(&mut second, GoalState::Underway);
    first.move_to(Goal::tip(TIPS_M[2]), [0.0; 3]).unwrap();
    expect(&mut first, GoalState::Ended);
    first.withdraw().unwrap();
    expect(&mut second, GoalState::Reached);
    assert_at(&mut stack, TIPS_M[1]);
    let request = PlanRequest {
        execute: true,
        deadline: Some(NO_DEADLINE),
        ..PlanRequest::from_robot(Goal::tip(TIPS_M[2]))
    };
    let id = stack.try_motion(&request).unwrap();
    let status = expect(&mut second, GoalState::Ended);
    assert!(status.to_string().contains(&id.to_string()), "{status}");
    stack.wait_for_end(id).unwrap();
    second.move_to(Goal::tip(TIPS_M[0]), [0.0; 3]).unwrap();
    sleep(A_WHILE);
    assert_at(&mut stack, TIPS_M[2]);
}

#[test]
fn malformed_goals_are_refused_by_name_and_the_one_before_goes_on() {
    type Spoil = fn(&mut message::StandingGoal);
    let mut stack = Stack::running(&Settings::default().patient()).unwrap();
    let raw = RawSender::connect(&stack.world.options);
    let mut goal = underway(&mut stack, TIPS_M[0]);
    let cases: [(&str, Spoil); 6] = [
        ("goal.tip_m is NaN", |goal| goal.goal.tip_m[0] = f64::NAN),
        ("tip_velocity_m_s", |goal| {
            goal.tip_velocity_m_s[2] = f64::INFINITY;
        }),
        ("protocol_version", |goal| goal.protocol_version = 3),
        ("another clock", |goal| {
            goal.stamp_mono_ns += 3_600_000_000_000;
        }),
        ("given_mono_ns", |goal| {
            goal.given_mono_ns = goal.stamp_mono_ns + 1;
        }),
        ("goal.kind", |goal| goal.goal.kind = 99),
    ];
    for (text, spoil) in cases {
        let mut wire = given(Goal::tip(TIPS_M[1])).to_wire();
        spoil(&mut wire);
        raw.send(wire);
        let of_it = |status: &GoalStatus| status.values.given_mono_ns == wire.given_mono_ns;
        let status = raw.expect(text, of_it);
        assert_eq!(status.state, GoalState::Refused, "{status}");
        assert!(status.to_string().contains(text), "{status}");
    }
    expect(&mut goal, GoalState::Reached);
    assert_at(&mut stack, TIPS_M[0]);
}

#[test]
fn a_killed_daemons_goal_is_over_and_one_that_is_given_to_the_next_daemon_moves_the_robot() {
    let mut stack = Stack::running(&Settings::default().patient()).unwrap();
    let mut goal = underway(&mut stack, TIPS_M[0]);
    stack.kill9(Part::Daemon);
    let rested = rests(&mut stack);
    stack.start(Part::Daemon);
    wait_for("the next daemon hears goals", PATIENCE, || {
        goal.move_to(Goal::tip(TIPS_M[0]), [0.0; 3]).ok()
    })
    .unwrap();
    wait_for("it says that the goal is over", PATIENCE, || {
        let _ = goal.move_to(Goal::tip(TIPS_M[0]), [0.0; 3]);
        let status = goal.status().unwrap()?;
        (status.state == GoalState::Ended).then_some(())
    })
    .unwrap();
    assert_eq!(rests(&mut stack), rested);
    goal.give(Goal::tip(TIPS_M[0]), 1.0).unwrap();
    expect(&mut goal, GoalState::Reached);
    assert_at(&mut stack, TIPS_M[0]);
}

#[test]
fn a_request_right_after_a_daemons_start_is_executed() {
    let mut stack = Stack::running(&Settings::fast_robot().patient()).unwrap();
    for round in 0..4 {
        stack.process(Part::Daemon).sigterm(PATIENCE).unwrap();
        stack.start(Part::Daemon);
        stack.client.wait_for_daemon(PATIENCE).unwrap();
        let request = PlanRequest {
            execute: true,
            deadline: Some(NO_DEADLINE),
            ..PlanRequest::from_robot(Goal::tip(TIPS_M[round % 3]))
        };
        let id = stack.try_motion(&request).unwrap();
        stack.wait_for_end(id).unwrap();
    }
}

#[test]
fn a_controller_in_fault_is_told_by_name_and_the_goal_is_over() {
    let mut stack = Stack::running(&Settings::default()).unwrap();
    let mut goal = underway(&mut stack, TIPS_M[0]);
    stack.kill9(Part::Robot);
    let status = expect(&mut goal, GoalState::Ended);
    assert!(status.to_string().contains("robot lost"), "{status}");
    goal.give(Goal::tip(TIPS_M[1]), 1.0).unwrap();
    let status = expect(&mut goal, GoalState::RobotNotReady);
    assert!(status.to_string().contains("robot lost"), "{status}");
    stack.start(Part::Robot);
    wait_for("the fault is reset", PATIENCE, || {
        let _ = stack.controller.command(Command::ResetFault, PATIENCE);
        (stack.controller_state().fault == LoopFault::None).then_some(())
    })
    .unwrap();
    let status = expect(&mut goal, GoalState::Ended);
    assert!(status.to_string().contains("a reset"), "{status}");
    rests(&mut stack);
    goal.give(Goal::tip(TIPS_M[1]), 1.0).unwrap();
    expect(&mut goal, GoalState::Reached);
}

/// Where the state stays the same there is a status every 5 ms at most.
fn assert_no_flood(statuses: &[message::GoalStatus]) {
    let of = |status: &message::GoalStatus| (status.state, status.trajectory_id);
    let pairs = || statuses.iter().zip(&statuses[1..]);
    let changes = pairs().filter(|(a, b)| of(a) != of(b)).count();
    let span_ns = statuses[statuses.len() - 1].stamp_mono_ns - statuses[0].stamp_mono_ns;
    let most = changes + 2 + usize::try_from(span_ns / 5_000_000).unwrap();
    assert!(statuses.len() <= most, "{} of {most}", statuses.len());
}

/// Goals of a flood, sent at once.
const ROUND: u32 = 20;

#[test]
fn a_flood_of_goals_starves_neither_the_robot_nor_clients_and_makes_no_flood_of_statuses() {
    let mut stack = Stack::running(&Settings::default().patient()).unwrap();
    let raw = RawSender::connect(&stack.world.options);
    let first = given(Goal::tip(TIPS_M[0]));
    let (mut sent, mut sent_before, mut answered) = (0_u32, 0, 0);
    let mut statuses: Vec<message::GoalStatus> = Vec::new();
    raw.send(first.to_wire());
    let request = PlanRequest {
        candidate_count: 1,
        deadline: Some(NO_DEADLINE),
        ..PlanRequest::new([0.0; 6], Goal::tip(TIPS_M[1]))
    };
    let mut pending = Some(stack.client.submit(&request).unwrap());
    let mut is_reached = false;
    wait_for("plans and the goal", PATIENCE, || {
        for _ in 0..ROUND {
            let update = StandingGoal {
                stamp_mono_ns: mono_now_ns(),
                ..first
            };
            raw.send(update.to_wire());
            sent += 1;
        }
        while let Some(status) = raw.statuses.receive().unwrap() {
            is_reached |= status.state == GoalState::Reached.code();
            statuses.push(*status);
        }
        if let Some(answer) = stack.client.poll(pending.as_mut().unwrap()).unwrap() {
            assert_eq!(answer.report().outcome, Outcome::Ok);
            let meanwhile = sent - sent_before;
            assert!(
                meanwhile < 1_000 * ROUND,
                "goals beside one plan: {meanwhile}"
            );
            (sent_before, answered) = (sent, answered + 1);
            pending = Some(stack.client.submit(&request).unwrap());
        }
        sleep(Duration::from_millis(1));
        (answered >= 20 && is_reached).then_some(())
    })
    .unwrap();
    assert!(sent > 1_000, "the premise, a flood: {sent}");
    assert_no_flood(&statuses);
    assert_at(&mut stack, TIPS_M[0]);
}

#[test]
fn a_goal_for_a_daemon_that_has_died_is_refused_by_name_and_the_next_daemon_hears_the_next_goal() {
    let mut stack = Stack::running(&Settings::default().patient()).unwrap();
    let mut goal = GoalSender::connect(&stack.world.options).unwrap();
    goal.give(Goal::tip(TIPS_M[0]), 1.0).unwrap();
    goal.confirm(PATIENCE).unwrap();
    // A recorder hears goals, too, and keeps nobody on its way.
    let node = IpcNode::create(&stack.world.options, "recorder").unwrap();
    let _recorder = subscriber(&node, &goal_service(&node).unwrap()).unwrap();
    assert!(goal.status().unwrap().is_some());
    stack.kill9(Part::Daemon);
    sleep(A_WHILE);
    assert!(goal.status().unwrap().is_none(), "nobody keeps the goal");
    let refused = goal.give(Goal::tip(TIPS_M[1]), 1.0).unwrap_err();
    assert!(matches!(refused, ClientError::NoServer { .. }), "{refused}");
    stack.start(Part::Daemon);
    stack.wait_until_ready().unwrap();
    goal.give(Goal::tip(TIPS_M[1]), 1.0).unwrap();
    goal.confirm(PATIENCE).unwrap();
}
