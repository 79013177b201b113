//! Replans while the loop is slowed down, held, behind its time, or paused with the whole machine: continuous, or refused by name with
//! the old motion going on.

mod disturbance;
mod fates;

use std::time::Duration;

use anyhow::Context;
use rand_pcg::Pcg64;
use shared_types::clock::mono_now_ns;
use shared_types::codes::LoopState;
use shared_types::message::RobotState;
use shared_types::valid::{Command, PlanRequest};
use tests::brute_force::{Ball, Body, Tendons};
use tests::geometry::seeded;
use tests::judge::Judge;
use tests::listener::{Heard, Listener};
use tests::replans::{ReplanScene, random_pause, replan};
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::Settings;

use self::disturbance::{Disturbance, Schedule};
use self::fates::{Fates, Replan};
use super::figures::{Figures, lower, quantile};
use super::joins::show_curves;
use super::paths::OffPath;
use super::replan_run::{balls, refusal};
use crate::report::Report;
use crate::scale::Scale;

pub(super) use self::fates::{is_whole, named};

/// Seed of scenes, tips, pauses and disturbances.
const SEED: u64 = 9_301;
/// Replans in one scene.
const IN_A_SCENE: usize = 5;
/// Shortest and longest time between two replans.
const PAUSES: [Duration; 2] = [Duration::from_millis(60), Duration::from_millis(900)];
/// How far from its path rounding may bring a set-point, rad.
const ON_PATH_RAD: f64 = 1e-9;
const PROMPT: Duration = Duration::from_secs(2);
/// A switch that is passed so much later than foreseen was passed by a loop that was disturbed, ms.
const LATE_MS: f64 = 2.0;

/// A group for each disturbance.
pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "requests to planner-daemon from a moving robot whose loop is disturbed";
    for disturbance in [
        Disturbance::Speed,
        Disturbance::LoopHeld,
        Disturbance::Lag,
        Disturbance::MachinePause,
    ] {
        let name = format!("disturbed replans, {}", disturbance.name());
        report.group(&name, command, |report| {
            let run = Run::of(disturbance, scale.pick(20, 200))?;
            run.show(report, &name);
            Ok(())
        });
    }
}

/// A request, by what it found.
enum Asked {
    InMotion(Replan),
    AtRest,
    /// Nothing leads away from where the robot rests.
    NoWay,
}

/// What one population showed.
struct Run {
    disturbance: Disturbance,
    figures: Figures,
    fates: Fates,
    off_path: OffPath,
    /// Requests that found the robot at rest, and those of them that led nowhere.
    at_rest: [usize; 2],
    /// Orders of speed, pauses and their ends that the controller took.
    orders_taken: usize,
    /// Least clearance of what the robot's own reference did, m.
    reference_clearance_m: f64,
    /// What the robot said of its ramps to rest.
    ramps_said: Vec<String>,
}

impl Run {
    fn of(disturbance: Disturbance, replans: usize) -> anyhow::Result<Self> {
        let mut stack = Stack::running(&Settings::default())?;
        let body = stack.world.body();
        let listener = Listener::start(&stack.world.options);
        let mut judge = Judge::new(stack.world.robot.tendon_limits);
        let mut run = Self {
            disturbance,
            figures: Figures::of(&stack.world.robot.tendon_limits),
            fates: Fates::default(),
            off_path: OffPath::default(),
            at_rest: [0; 2],
            orders_taken: 0,
            reference_clearance_m: f64::INFINITY,
            ramps_said: Vec::new(),
        };
        let (mut random, mut index) = (seeded(SEED), 0);
        while run.figures.in_motion < replans {
            let unit = stack.world.unit_robot();
            let scene = ReplanScene::around(&unit, &stack.commanded(), SEED, &mut index);
            run.figures.scenes += 1;
            run.figures.scenes_drawn = index;
            let until = replans.min(run.figures.in_motion + IN_A_SCENE);
            let asked = run.in_scene(&mut stack, &scene, until, &mut random)?;
            std::thread::sleep(Duration::from_millis(100));
            let heard = listener.take();
            judge.look(&heard);
            run.look(&stack, &body, &heard, &asked, &balls(&scene));
            println!("  {} of {replans} replans", run.figures.in_motion);
        }
        run.figures.sent = judge.verdict().clone();
        let said = stack.process(Part::Robot).log();
        let ramps = said.lines().filter(|line| line.contains("ramping to rest"));
        run.ramps_said = ramps.map(str::to_owned).collect();
        Ok(run)
    }

    /// Replans in one scene until there were so many, and lets the last motion end.
    fn in_scene(
        &mut self,
        stack: &mut Stack,
        scene: &ReplanScene,
        until: usize,
        random: &mut Pcg64,
    ) -> anyhow::Result<Vec<Replan>> {
        let mut asked = Vec::new();
        while self.figures.in_motion < until {
            self.figures.faults.reset(stack)?;
            match self.ask(stack, scene, random)? {
                Asked::InMotion(replan) => asked.push(replan),
                Asked::AtRest => self.at_rest[0] += 1,
                Asked::NoWay => {
                    self.at_rest[0] += 1;
                    self.at_rest[1] += 1;
                    break;
                }
            }
            std::thread::sleep(random_pause(PAUSES[0], PAUSES[1], random));
        }
        stack.controller.command(Command::SetSpeed(1.0), PROMPT)?;
        self.figures.faults.reset(stack)?;
        let held = stack.wait_until_held();
        held.with_context(|| format!("{:?}", stack.controller_state().values))?;
        Ok(asked)
    }

    /// Asks once, and disturbs the loop meanwhile where the robot moves.
    fn ask(
        &mut self,
        stack: &mut Stack,
        scene: &ReplanScene,
        random: &mut Pcg64,
    ) -> anyhow::Result<Asked> {
        let tip = scene.tip(&stack.world.unit_robot(), random);
        let request = replan(tip.into(), &scene.balls, self.figures.requests as u64);
        self.figures.requests += 1;
        if stack.controller_state().state != LoopState::Executing {
            let answer = stack.client.plan(&request, PATIENCE)?;
            let begins = answer.report().trajectory_id.is_some();
            return Ok(if begins { Asked::AtRest } else { Asked::NoWay });
        }
        self.figures.in_motion += 1;
        let mut schedule = self.disturbance.begin(random);
        let replan = ask_in_motion(stack, &request, &mut schedule)?;
        self.orders_taken += schedule.orders_taken();
        Ok(Asked::InMotion(replan))
    }

    fn look(
        &mut self,
        stack: &Stack,
        body: &Body,
        heard: &Heard,
        asked: &[Replan],
        balls: &[Ball],
    ) {
        self.figures.look(body, heard, balls);
        self.fates.look(asked, heard);
        self.off_path.look(&stack.world.robot, heard);
        let reference = |state: &RobotState| (state.stamp_mono_ns, state.accepted_setpoint_m);
        let references: Vec<(i64, Tendons)> = heard.robot.iter().map(reference).collect();
        let clearance = body.least_clearance(&references, |_| balls).at_least_m();
        lower(&mut self.reference_clearance_m, clearance);
    }

    fn show(&self, report: &mut Report, name: &str) {
        let line = |what: &str| format!("{name}: {what}");
        let (figures, fates) = (&self.figures, &self.fates);
        let [at_rest, no_way] = self.at_rest;
        report.shown(
            &line("what was asked for"),
            format!(
                "{} requests found the robot in motion and {at_rest} at rest, {no_way} of these without a way on, after which another scene was drawn; \
                 {} scenes in which the robot had room, of {} drawn",
                figures.in_motion, figures.scenes, figures.scenes_drawn
            ),
        );
        report.shown(
            &line("what became of the replans"),
            format!("of {}: {:?}", figures.in_motion, fates.counts),
        );
        report.shown(
            &line("faults, reset before the next"),
            format!("{:?}", self.figures.faults),
        );
        report.shown(
            &line("what the robot said of its ramps to rest"),
            format!("{:?}", self.ramps_said),
        );
        let ramped: usize = fates.ramped.values().sum();
        report.shown(
            &line("replans of a controller that was held for longer than the robot bears, which came to rest by itself, within its limits"),
            format!("{ramped} of {}: {:?}", figures.in_motion, fates.ramped),
        );
        report.check(
            &line("joined motions that were begun"),
            figures.switched.to_string(),
            &format!("> a third of {}", figures.in_motion),
            3 * figures.switched > figures.in_motion,
        );
        self.show_effects(report, &line);
        let broken: usize = fates.broken.values().sum();
        report.check(
            &line("replans neither continuous nor refused by name with the old motion going on"),
            format!("{broken} of {}: {:?}", figures.in_motion, fates.broken),
            "0",
            broken == 0,
        );
        let [before, pending, later] = fates.disturbed;
        report.check(
            &line("actions before the request, from it until the switch or the refusal, later"),
            format!("{before}, {pending}, {later}"),
            "a twentieth until the switch",
            20 * pending >= before + pending + later,
        );
        if self.disturbance.holds_processes() {
            report.check(
                &line("replans whose switch was to be passed while processes were held"),
                fates.held_at_switch.to_string(),
                &format!("> a tenth of {}", figures.in_motion),
                10 * fates.held_at_switch > figures.in_motion,
            );
        }
        report.at_most(&line("results not heard"), fates.results_missed as f64, 0.0);
        show_curves(report, &line, figures);
        report.check(
            &line("distance of the set-points in motion from the path that they follow, rad"),
            format!(
                "{:.1e} of {} ({})",
                self.off_path.farthest_rad, self.off_path.looked_at, self.off_path.place
            ),
            &format!("<= {ON_PATH_RAD}"),
            self.off_path.farthest_rad <= ON_PATH_RAD && self.off_path.looked_at > 0,
        );
        report.check(
            &line("least clearance of what the robot's own reference did"),
            format!("{:.5} m", self.reference_clearance_m),
            ">= 0, with balls there",
            self.reference_clearance_m >= 0.0 && self.reference_clearance_m.is_finite(),
        );
    }
}

impl Run {
    /// Whether the loop was disturbed at all: what orders it took, and how late it came to switches.
    fn show_effects(&self, report: &mut Report, line: &dyn Fn(&str) -> String) {
        let orders = self.orders_taken;
        let late_ms = self.figures.times_ms.get("switch to first set-point");
        let late_ms = late_ms.map_or(&[] as &[f64], Vec::as_slice);
        let [median, most] = [0.5, 1.0].map(|share| quantile(late_ms, share));
        let late = late_ms.iter().filter(|it| **it > LATE_MS).count();
        let figure = format!(
            "{orders} orders of speed and pauses were taken; from the switch, as foreseen, to the first set-point {median:.1} ms in the median, {most:.1} \
             ms at most, later than {LATE_MS} ms {late} times of {}; the other replans were refused, or the robot had come to rest",
            late_ms.len()
        );
        let not_begun = self.figures.in_motion.saturating_sub(late_ms.len());
        let effects = match self.disturbance {
            Disturbance::Speed => orders,
            _ => late + not_begun,
        };
        let bar = format!("> a tenth of {}", self.figures.in_motion);
        let is_disturbed = 10 * effects > self.figures.in_motion;
        report.check(&line("what it did to the loop"), figure, &bar, is_disturbed);
    }
}

/// Asks a robot in motion while what is scheduled happens to its loop; returns when both are over.
fn ask_in_motion(
    stack: &mut Stack,
    request: &PlanRequest,
    schedule: &mut Schedule,
) -> anyhow::Result<Replan> {
    let mut disturbed_ns = Vec::new();
    while !schedule.is_request_due() {
        disturbed_ns.extend(schedule.carry_out(stack)?);
        disturbance::rest();
    }
    let asked_ns = mono_now_ns();
    let mut pending = stack.client.submit(request)?;
    let mut answered = None;
    loop {
        disturbed_ns.extend(schedule.carry_out(stack)?);
        if answered.is_none()
            && let Some(answer) = stack.client.poll(&mut pending)?
        {
            let report = answer.report();
            let refused = || refusal(report.outcome, &report.reason);
            answered = Some((mono_now_ns(), report.trajectory_id.ok_or_else(refused)));
        }
        if schedule.is_over()
            && let Some((answered_ns, answer)) = answered.take()
        {
            return Ok(Replan {
                asked_ns,
                answered_ns,
                answer,
                long_holds_ns: schedule.long_holds_ns().to_vec(),
                disturbed_ns,
            });
        }
        disturbance::rest();
    }
}
