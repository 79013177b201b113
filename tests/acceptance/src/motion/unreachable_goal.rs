//! A goal that cannot be reached any more: said by name, the robot at rest, and on again once it can be reached.

use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::Context;
use client::{ClientError, GoalSender, ScenePublisher};
use shared_types::clock::mono_now_ns;
use shared_types::codes::{CommandSender, GoalState, LoopState, StopCause};
use shared_types::message::{MotionResult, MovingBall};
use shared_types::valid::{Goal, GoalStatus};
use tests::brute_force::{Ball, Body, Tendons};
use tests::judge::Judge;
use tests::listener::{Heard, Listener};
use tests::process::wait_for;
use tests::stack::{PATIENCE, Stack};
use tests::world::Settings;

use super::disturbed::{is_whole, named};
use super::setpoints::{no_offences, within_limits};
use crate::report::Report;
use crate::scale::Scale;

/// Lifetime of a scene that stays.
const LONG: Duration = Duration::from_secs(3600);
/// Bar of the time until it is said, ms.
const SAID_WITHIN_MS: f64 = 100.0;
/// Two tips that can be reached, m.
const NEAR_M: [[f64; 3]; 2] = [[1.0, 0.6, 2.2], [1.0, -0.6, 2.2]];
/// Tips that cannot, m, and what is said of them: one beyond the robot's length, and one in an obstacle of the live scene.
const LOST: [([f64; 3], &str); 2] = [
    ([2.5, 0.5, 2.5], "out of reach"),
    ([-1.4, 0.0, 2.2], "goal in collision"),
];
/// What is said of a tip to which an obstacle comes: that it is there, or, so near to it that the robot must stop at once, that it is in the way.
const BARRED: [&str; 2] = ["goal in collision", "the live scene is in the way"];
/// An obstacle that rests, and one that comes where the first tip is, and goes again.
const OBSTACLE: MovingBall = ball([-1.4, 0.0, 2.2], 0.3);
const COMES: MovingBall = ball(NEAR_M[0], 0.2);

const fn ball(centre_m: [f64; 3], radius_m: f64) -> MovingBall {
    MovingBall {
        centre_m,
        radius_m,
        velocity_m_s: [0.0; 3],
    }
}

pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "goals to planner-daemon";
    report.group("goals, out of reach", command, |report| {
        let mut stack = Stack::running(&Settings::default())?;
        let listener = Listener::start(&stack.world.options);
        let mut goal = GoalSender::connect(&stack.world.options)?;
        let mut scenes = ScenePublisher::connect(&stack.world.options, "obstacle")?;
        scenes.publish(&[OBSTACLE], LONG)?;
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
            match LOST.get(round % 3) {
                Some(&(tip_m, name)) => {
                    let goes = |goal: &mut GoalSender| goal.move_to(Goal::tip(tip_m), [0.0; 3]);
                    figures.lose(&mut stack, &mut goal, [name, name], goes)?;
                    goal.move_to(Goal::tip(NEAR_M[1]), [0.0; 3])?;
                    figures.find_again(&mut stack, &mut goal, NEAR_M[1])?;
                }
                None => {
                    let from_ns = mono_now_ns();
                    let comes = |_: &mut GoalSender| scenes.publish(&[OBSTACLE, COMES], LONG);
                    figures.lose(&mut stack, &mut goal, BARRED, comes)?;
                    figures.obstructed_ns.push([from_ns, mono_now_ns()]);
                    scenes.publish(&[OBSTACLE], LONG)?;
                    figures.find_again(&mut stack, &mut goal, NEAR_M[0])?;
                    go_back(&mut goal)?;
                }
            }
        }
        let mut judge = Judge::new(stack.world.robot.tendon_limits);
        sleep(Duration::from_millis(50));
        let heard = listener.take();
        judge.look(&heard);
        figures.look(&stack.world.body(), &heard);
        figures.show(report, &judge);
        Ok(())
    });
}

/// Goes where the next round begins.
fn go_back(goal: &mut GoalSender) -> anyhow::Result<()> {
    goal.give(Goal::tip(NEAR_M[1]), 1.0)?;
    expect(goal, "reached", |status| status.state == GoalState::Reached).map(drop)
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
    /// When the obstacle that comes and goes was there, nanoseconds of `CLOCK_MONOTONIC`.
    obstructed_ns: Vec<[i64; 2]>,
    /// Motions that ended neither at their certified end, nor joined by another, nor stopped by supervision for the obstacle that came.
    cut_short: Vec<String>,
    /// Motions without exactly one result.
    miscounted: Vec<String>,
    clearance_m: f64,
}

impl Figures {
    /// The goal cannot be reached any more, which is said by one of these names.
    fn lose(
        &mut self,
        stack: &mut Stack,
        goal: &mut GoalSender,
        names: [&str; 2],
        happens: impl FnOnce(&mut GoalSender) -> Result<(), ClientError>,
    ) -> anyhow::Result<()> {
        let sent = Instant::now();
        let is_moving = stack.controller_state().state == LoopState::Executing;
        self.lost_in_motion += usize::from(is_moving);
        happens(goal)?;
        let status = expect(goal, "said to be lost", |status| {
            status.state == GoalState::Unreachable
        })?;
        self.said_ms.push(sent.elapsed().as_secs_f64() * 1e3);
        let said = status.to_string();
        if !names.iter().any(|name| said.contains(name)) {
            self.unnamed.push(said.clone());
        }
        self.reasons.push(said);
        let rests = || (stack.controller_state().state == LoopState::Holding).then_some(());
        wait_for("the robot rests", PATIENCE, rests)?;
        self.rested += 1;
        Ok(())
    }

    /// The goal can be reached again, without being given anew.
    fn find_again(
        &mut self,
        stack: &mut Stack,
        goal: &mut GoalSender,
        position_m: [f64; 3],
    ) -> anyhow::Result<()> {
        expect(goal, "reached", |status| status.state == GoalState::Reached)?;
        let configuration = stack.commanded();
        let body = stack.world.body();
        let error = body.tip_error(&configuration.into(), &position_m);
        self.went_on += usize::from(error <= 0.01);
        Ok(())
    }

    /// Looks at everything that was heard.
    fn look(&mut self, body: &Body, heard: &Heard) {
        let results = |id: u32| {
            let of_it = heard.results.iter().filter(|it| it.trajectory_id == id);
            of_it.count()
        };
        let ids = heard.motions.iter().map(|motion| motion.id);
        let miscounted = ids.filter(|id| results(*id) != 1);
        self.miscounted = miscounted.map(|id| format!("trajectory {id}")).collect();
        let resting = |ball: &MovingBall| Ball::resting(ball.centre_m, ball.radius_m);
        let both = [OBSTACLE, COMES].map(|ball| resting(&ball));
        let is_there = |stamp_ns: i64| {
            let mut times = self.obstructed_ns.iter();
            times.any(|[from, to]| (*from..*to).contains(&stamp_ns))
        };
        let ends_certified = |result: &&MotionResult| {
            let by_supervision = result.cause == StopCause::Command.code()
                && result.sender == CommandSender::Supervision.code();
            is_whole(result) || by_supervision && is_there(result.stamp_mono_ns)
        };
        let cut_short = heard.results.iter().filter(|it| !ends_certified(it));
        self.cut_short = cut_short.map(named).collect();
        let balls = |stamp_ns: i64| {
            if is_there(stamp_ns) {
                &both[..]
            } else {
                &both[..1]
            }
        };
        let setpoints: Vec<(i64, Tendons)> = heard
            .cycles
            .iter()
            .map(|cycle| (cycle.stamp_mono_ns, cycle.setpoint_m))
            .collect();
        self.clearance_m = body.least_clearance(&setpoints, balls).at_least_m();
    }

    fn show(&self, report: &mut Report, judge: &Judge) {
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
        report.none_of(
            &line("motions that ended neither at their certified end, nor joined by another, nor stopped by supervision for the obstacle that came"),
            &self.cut_short,
        );
        report.none_of(
            &line("motions without exactly one result"),
            &self.miscounted,
        );
        report.check(
            &line("least clearance of what was executed from the obstacles that were there, dense sampling"),
            format!("{:.5} m", self.clearance_m),
            ">= 0",
            (0.0..f64::INFINITY).contains(&self.clearance_m),
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
