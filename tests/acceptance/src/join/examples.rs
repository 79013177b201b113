//! The examples of a language: each plays its part against the real processes.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use client::ScenePublisher;
use shared_types::ipc::{IpcNode, newest, scene_service, subscriber};
use shared_types::message::SceneMessage;
use shared_types::valid::{ControllerState, Goal, PlanRequest};
use tests::process::{Process, wait_for};
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::{Settings, World};

use super::lines::{self, COLUMNS};
use crate::report::Report;

/// The examples of each language.
pub(super) const NAMES: [&str; 5] = ["plan", "watch", "scene", "drive", "follow"];
/// A tip that the unit robot reaches from rest.
pub(super) const TIP_M: [f64; 3] = [1.0, 0.5, 2.3];
/// How long an example may take that ends by itself.
pub(super) const LIMIT: Duration = Duration::from_secs(30);
/// Centre, m, radius, m, and velocity, m/s, of the ball that `scene` publishes, and for how long, s.
const BALL: [f64; 8] = [3.0, 0.0, 1.0, 0.1, 0.2, 0.05, -0.1, 2.0];
/// How far from its way rounding may tell a ball, m.
const ROUNDING_M: f64 = 1e-12;

/// An example by its name, without its ending.
pub(super) struct Program {
    pub(super) path: PathBuf,
    /// What is told to it before its own arguments.
    pub(super) arguments: Vec<String>,
}

impl Program {
    /// A script for a Python.
    pub(super) fn script(python: PathBuf, script: &Path) -> Self {
        Self {
            path: python,
            arguments: vec!["-u".to_owned(), script.display().to_string()],
        }
    }
}

/// The examples of a language.
pub(super) struct Examples {
    pub(super) language: &'static str,
    /// What the figures come from.
    pub(super) command: &'static str,
    pub(super) folder: PathBuf,
    /// The ending of an example's file.
    pub(super) ending: &'static str,
    /// How a line begins that is none of the example's own: a comment, the naming of what is used, the end of a block.
    pub(super) of_all: &'static [&'static str],
    /// The file that all examples share, if there is one.
    pub(super) shared: Option<&'static str>,
    /// Lines of its own that each example may have.
    pub(super) most_lines: usize,
    /// Those that do nothing without arguments.
    pub(super) need_arguments: &'static [&'static str],
    /// What `watch` tells of a motion, and afterwards of its end.
    pub(super) watched: [&'static str; 2],
    /// Builds what is missing of an example.
    pub(super) program: fn(&str) -> anyhow::Result<Program>,
    /// Builds the program `asks` beside this file.
    pub(super) asks: fn() -> anyhow::Result<Program>,
    /// How that program is told its robot file.
    pub(super) told_robot: fn(&Path) -> anyhow::Result<String>,
}

impl Examples {
    /// The groups of checks that all languages have.
    pub(super) fn run(&self, report: &mut Report) {
        let group = |part: &str| format!("{}: {part}", self.language);
        report.group(&group("plan and watch"), self.command, |report| {
            self.plan_and_watch(report)
        });
        report.group(&group("publish a scene"), self.command, |report| {
            self.publish_scene(report)
        });
        report.group(&group("drive motors"), self.command, |report| {
            self.drive(report)
        });
        report.group(&group("follow trajectories"), self.command, |report| {
            self.follow(report)
        });
        report.group(&group("no arguments"), self.command, |report| {
            self.usage(report)
        });
        report.group(&group("lines of each example"), self.command, |report| {
            self.lines(report)
        });
    }

    pub(super) fn line(&self, what: &str) -> String {
        format!("{}: {what}", self.language)
    }

    pub(super) fn start(
        &self,
        world: &World,
        name: &str,
        arguments: &[&str],
    ) -> anyhow::Result<Process> {
        let program = (self.program)(name)?;
        let before = program.arguments.iter().map(String::as_str);
        let all: Vec<&str> = before.chain(arguments.iter().copied()).collect();
        Ok(Process::start_program(world, &program.path, &all))
    }

    /// Runs an example to its end; what it says.
    pub(super) fn said(
        &self,
        world: &World,
        name: &str,
        arguments: &[&str],
    ) -> anyhow::Result<String> {
        let mut process = self.start(world, name, arguments)?;
        let status = process.wait(LIMIT)?;
        ensure!(status.success(), "{name}: {status}: {}", process.log());
        Ok(process.log())
    }

    pub(super) fn plan(&self, world: &World) -> anyhow::Result<String> {
        let tip = TIP_M.map(|axis| axis.to_string());
        self.said(world, "plan", &tip.each_ref().map(String::as_str))
    }

    /// That a planned motion was reached, as its last line says.
    pub(super) fn is_reached(&self, report: &mut Report, what: &str, planned: &str) {
        let last = planned.lines().last().unwrap_or_default().to_owned();
        let result = last.split_once(": ").map(|(_, result)| result);
        let reached = result.is_some_and(|it| it.starts_with("reached"));
        report.check(&self.line(what), last, "reached", reached);
    }

    /// The same request from Rust has the same plan.
    fn plan_and_watch(&self, report: &mut Report) -> anyhow::Result<()> {
        let mut stack = Stack::running(&Settings::default())?;
        let request = PlanRequest {
            candidate_count: 10,
            ..PlanRequest::from_robot(Goal::tip(TIP_M))
        };
        let answer = stack.client.plan(&request, PATIENCE)?;
        let expected = format!("{:x}", answer.report().plan_hash);
        drop(answer);
        // Built before the other one watches.
        (self.program)("plan")?;
        let mut watching = self.start(&stack.world, "watch", &["12"])?;
        let planned = self.plan(&stack.world)?;
        let first = planned.lines().next().unwrap_or_default().to_owned();
        let hash = first.split("hash ").nth(1).unwrap_or_default();
        let same = hash.trim_start_matches('0') == expected;
        report.check(
            &self.line("plan_hash of the same request"),
            first,
            &expected,
            same,
        );
        self.is_reached(report, "the result of the motion", &planned);
        let status = watching.wait(LIMIT)?;
        ensure!(status.success(), "watch: {status}: {}", watching.log());
        let watched = watching.log();
        let [moving, ended] = self.watched;
        let after = watched.rsplit_once(moving).map(|(_, after)| after);
        let told = after.map_or(0, |after| after.matches(ended).count());
        let figure = match after {
            Some(_) => format!("`{ended}` {told} times after the last `{moving}`"),
            None => format!("no `{moving}`"),
        };
        report.check(
            &self.line("watch tells of the motion and then of its end"),
            figure,
            "at least once",
            told > 0,
        );
        Ok(())
    }

    fn publish_scene(&self, report: &mut Report) -> anyhow::Result<()> {
        let stack = Stack::running(&Settings::default())?;
        (self.program)("plan")?;
        let node = IpcNode::create(&stack.world.options, "scenes")?;
        let scenes = subscriber(&node, &scene_service(&node)?)?;
        let (begun, words) = (Instant::now(), BALL.map(|number| number.to_string()));
        let mut publishing =
            self.start(&stack.world, "scene", &words.each_ref().map(|it| &**it))?;
        let heard = wait_for("a scene", LIMIT, || newest(&scenes))?;
        self.show_ball(report, &heard, begun.elapsed());
        // While its scenes count nothing hinders a motion.
        let planned = self.plan(&stack.world)?;
        self.is_reached(report, "a motion beside its ball", &planned);
        let status = publishing.wait(LIMIT)?;
        ensure!(status.success(), "scene: {status}: {}", publishing.log());
        let said = publishing.log();
        let last = said.lines().last().unwrap_or_default().to_owned();
        let counted = last == "every scene counted";
        let line = self.line("what the daemon says of its scenes");
        report.check(&line, last, "every scene counted", counted);
        // It has taken its leave: another source alone decides now, and its scene must count.
        let mut other = ScenePublisher::connect(&stack.world.options, "other")?;
        other.publish(&[], Duration::from_secs(60))?;
        let planned = self.plan(&stack.world)?;
        self.is_reached(report, "a motion behind it", &planned);
        Ok(())
    }

    /// Whether a scene that was heard so long after the program began is the ball that it was given, as far as it has moved since.
    fn show_ball(&self, report: &mut Report, heard: &SceneMessage, longest: Duration) {
        let [x, y, z, radius_m, vx, vy, vz, _] = BALL;
        let ball = heard.balls[0];
        let moved_s = (ball.centre_m[0] - x) / vx;
        let way = [[x, vx], [y, vy], [z, vz]].into_iter().zip(ball.centre_m);
        let off_m = way.map(|([from, velocity], at)| (from + velocity * moved_s - at).abs());
        let is_there = (0.0..=longest.as_secs_f64()).contains(&moved_s)
            && off_m.fold(0.0, f64::max) < ROUNDING_M;
        let is_same = (ball.radius_m, ball.velocity_m_s) == (radius_m, [vx, vy, vz]);
        report.check(
            &self.line("the ball of its scene: centre after a time, s; radius, velocity"),
            format!(
                "{} balls: {:?} after {moved_s:.4}; {}, {:?}",
                heard.ball_count, ball.centre_m, ball.radius_m, ball.velocity_m_s
            ),
            &format!(
                "{:?} and as far as it has moved; {radius_m}, {:?}",
                [x, y, z],
                [vx, vy, vz]
            ),
            heard.ball_count == 1 && is_there && is_same,
        );
    }

    /// A driver in the simulated robot's place.
    fn drive(&self, report: &mut Report) -> anyhow::Result<()> {
        let mut stack = Stack::new(&Settings::default());
        stack.start(Part::Daemon);
        stack.start(Part::Controller);
        let state = self.moves(report, &mut stack, "drive", "robots/unit.toml")?;
        let measured_rad = &state.values.measured_configuration_rad;
        let error = stack.world.body().tip_error(measured_rad, &TIP_M);
        report.at_most(&self.line("tip error as measured, m"), error, 0.03);
        Ok(())
    }

    /// A controller in ours' place, with motors of its own.
    fn follow(&self, report: &mut Report) -> anyhow::Result<()> {
        let mut stack = Stack::new(&Settings::default());
        stack.start(Part::Daemon);
        let state = self.moves(report, &mut stack, "follow", "controller.toml")?;
        let commanded_rad = &state.values.commanded_configuration_rad;
        let error = stack.world.body().tip_error(commanded_rad, &TIP_M);
        report.at_most(&self.line("tip error as commanded, m"), error, 0.01);
        Ok(())
    }

    /// An example moves the robot to a tip, by a file of the configuration; what the controller says then.
    fn moves(
        &self,
        report: &mut Report,
        stack: &mut Stack,
        name: &str,
        file: &str,
    ) -> anyhow::Result<ControllerState> {
        stack.client.wait_for_daemon(PATIENCE)?;
        (self.program)("plan")?;
        let file = stack.world.config(file).display().to_string();
        let mut process = self.start(&stack.world, name, &[&file])?;
        stack.wait_until_held().with_context(|| process.log())?;
        let planned = self.plan(&stack.world).with_context(|| process.log())?;
        self.is_reached(report, &format!("a motion by {name}"), &planned);
        let state = stack.controller_state();
        process.kill9();
        Ok(state)
    }

    /// Without arguments each says in a line what it wants, and ends.
    fn usage(&self, report: &mut Report) -> anyhow::Result<()> {
        let world = World::new(&Settings::default());
        for name in self.need_arguments {
            let mut process = self.start(&world, name, &[])?;
            let status = process.wait(LIMIT)?;
            let told = process.log();
            let is_usage = status.code() == Some(2) && told.lines().count() == 1;
            let line = self.line(&format!("{name} without arguments"));
            let figure = format!("{status}: {}", told.trim());
            report.check(&line, figure, "exit status 2, a line of usage", is_usage);
        }
        Ok(())
    }

    fn lines(&self, report: &mut Report) -> anyhow::Result<()> {
        let counted = lines::count(&self.folder, self.ending, self.shared, self.of_all)?;
        let is_counted = |name: &str| {
            counted
                .iter()
                .any(|it| it.name == format!("{name}.{}", self.ending))
        };
        let missing = NAMES.iter().filter(|name| !is_counted(name));
        let missing: Vec<String> = missing.map(|name| (*name).to_owned()).collect();
        report.none_of(&self.line("examples that are not there"), &missing);
        let bar = format!("<= {}", self.most_lines);
        for example in counted {
            let figure = match example.from_shared.as_slice() {
                [] => example.lines.to_string(),
                parts => format!(
                    "{} with {} of what is shared",
                    example.lines,
                    parts.join(", ")
                ),
            };
            let what = format!("lines of {}, of {COLUMNS} columns", example.name);
            let line = self.line(&what);
            report.check(&line, figure, &bar, example.lines <= self.most_lines);
        }
        Ok(())
    }
}
