//! A goal that cannot be reached any more: said by name, the robot at rest, and on again once it can be reached.

use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::Context;
use client::{GoalSender, ScenePublisher};
use shared_types::codes::{GoalState, LoopState};
use shared_types::message::{MotionResult, MovingBall};
use shared_types::valid::{Goal, GoalStatus};
use tests::judge::Judge;
use tests::listener::Listener;
use tests::process::wait_for;
use tests::stack::{PATIENCE, Stack};
use tests::world::Settings;

use super::disturbed::{is_whole, named};
use super::setpoints::{no_offences, within_limits};
use crate::report::Report;
use crate::scale::Scale;

/// Bar of the time until it is said, ms.
const SAID_WITHIN_MS: f64 = 100.0;
/// Two tips that can be reached, m.
const NEAR_M: [[f64; 3]; 2] = [[1.0, 0.6, 2.2], [1.0, -0.6, 2.2]];
/// Tips that cannot, m, and what is said of them: one beyond the robot's length, and one in an obstacle of the live scene.
const LOST: [([f64; 3], &str); 2] = [
    ([2.5, 0.5, 2.5], "out of reach"),
    ([-1.4, 0.0, 2.2], "goal in collision"),
];
/// An obstacle that rests.
const OBSTACLE: MovingBall = MovingBall {
    centre_m: [-1.4, 0.0, 2.2],
    radius_m: 0.3,
    velocity_m_s: [0.0; 3],
};

pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "goals to planner-daemon";
    report.group("goals, out of reach", command, |report| {
        let mut stack = Stack::running(&Settings::default())?;
        let listener = Listener::start(&stack.world.options);
        let mut goal = GoalSender::connect(&stack.world.options)?;
        let mut scenes = ScenePublisher::connect(&stack.world.options, "obstacle")?;
        scenes.publish(&[OBSTACLE], Duration::from_secs(3600))?;
        scenes.confirm(PATIENCE)?;
        let mut figures = Figures::default();
        for round in 0..scale.pick(6, 60) {
            goal.give(Goal::tip(NEAR_M[0]), 1.0)?;
            let moving = |status: &GoalStatus| status.state == GoalState::Underway;
            expect(&mut goal, "on the way", moving)?;
            let moves = || (stack.controller_state().state == LoopState::Executing).then_some(());
            wait_for("the robot moves", PATIENCE, moves)?;
            // At another instant of the motion each time.
            sleep(Duration::from_millis(40 + 97 * round as u64 % 700));
            figures.lose(&mut stack, &mut goal, LOST[round % 2])?;
            figures.find_again(&mut stack, &mut goal, NEAR_M[1])?;
        }
        let mut judge = Judge::new(stack.world.robot.tendon_limits);
        let heard = listener.take();
        judge.look(&heard);
        figures.show(report, &judge, &heard.results);
        Ok(())
    });
}

fn expect(
    goal: &mut GoalSender,
    what: &str,
    is_so: impl FnMut(&GoalStatus) -> bool,
) -> anyhow::Result<GoalStatus> {
    let status = goal.wait_for(Duration::from_secs(10), is_so)?;
    let last = goal.status()?.map(|status| status.to_string());
    status.with_context(|| format!("the goal was not {what} within 10 s: {last:?}"))
}

#[derive(Default)]
struct Figures {
    said_ms: Vec<f64>,
    reasons: Vec<String>,
    /// What was said by another name.
    unnamed: Vec<String>,
    lost_in_motion: usize,
    rested: usize,
    went_on: usize,
}

impl Figures {
    /// The goal goes where it cannot be reached.
    fn lose(
        &mut self,
        stack: &mut Stack,
        goal: &mut GoalSender,
        (tip_m, name): ([f64; 3], &str),
    ) -> anyhow::Result<()> {
        let sent = Instant::now();
        let is_moving = stack.controller_state().state == LoopState::Executing;
        self.lost_in_motion += usize::from(is_moving);
        goal.move_to(Goal::tip(tip_m), [0.0; 3])?;
        let status = expect(goal, "said to be lost", |status| {
            status.state == GoalState::Unreachable
        })?;
        self.said_ms.push(sent.elapsed().as_secs_f64() * 1e3);
        let said = status.to_string();
        if !said.contains(name) {
            self.unnamed.push(said.clone());
        }
        self.reasons.push(said);
        let rests = || (stack.controller_state().state == LoopState::Holding).then_some(());
        wait_for("the robot rests", PATIENCE, rests)?;
        self.rested += 1;
        Ok(())
    }

    /// The goal comes back, without being given anew.
    fn find_again(
        &mut self,
        stack: &mut Stack,
        goal: &mut GoalSender,
        position_m: [f64; 3],
    ) -> anyhow::Result<()> {
        goal.move_to(Goal::tip(position_m), [0.0; 3])?;
        expect(goal, "reached", |status| status.state == GoalState::Reached)?;
        let configuration = stack.commanded();
        let robot = stack.world.robot.clone();
        let error = tests::stack::tip_error(&robot, &configuration.into(), &position_m);
        self.went_on += usize::from(error <= 0.01);
        Ok(())
    }

    fn show(&self, report: &mut Report, judge: &Judge, results: &[MotionResult]) {
        let line = |what: &str| format!("goals, out of reach: {what}");
        let rounds = self.said_ms.len();
        let slowest = self.said_ms.iter().copied().fold(0.0, f64::max);
        report.shown(&line("what is said"), self.reasons.join(" | "));
        report.at_most(
            &line("slowest time until it is said, ms"),
            slowest,
            SAID_WITHIN_MS,
        );
        report.none_of(&line("said by another name"), &self.unnamed);
        report.all_of(
            &line("the goal was lost while the robot moved"),
            self.lost_in_motion,
            rounds,
        );
        report.all_of(&line("came to rest"), self.rested, rounds);
        let cut_short = results.iter().filter(|result| !is_whole(result));
        let ends: Vec<String> = cut_short.map(named).collect();
        report.none_of(
            &line("motions that ended neither at their certified end nor joined by another"),
            &ends,
        );
        report.all_of(
            &line("went on by itself and reached it once it could"),
            self.went_on,
            rounds,
        );
        within_limits(report, &line, judge.verdict());
        no_offences(report, &line, judge.verdict());
    }
}
