//! A follower or a driver that is told to end in motion: it brings its motors to rest first.

use std::time::Duration;

use anyhow::Context;
use shared_types::codes::MotionOutcome;
use shared_types::message::{Cycle, RobotState};
use shared_types::valid::Goal;
use tests::judge::ALLOWED_USE;
use tests::listener::{Heard, Listener};
use tests::motion::{largest, raise};
use tests::process::wait_for;
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::Settings;

use super::examples::{Examples, LIMIT, TIP_M};
use crate::report::Report;

/// How far into its motion the loop is told to end, s.
const INTO_MOTION_S: f64 = 0.8;
/// Ctrl-C, and what a service manager sends.
const SIGNALS: [(&str, libc::c_int); 2] = [("SIGINT", libc::SIGINT), ("SIGTERM", libc::SIGTERM)];
/// A tendon faster than this moves, m/s.
const MOVING_M_S: f64 = 0.01;
/// A tendon slower than this rests, m/s.
const AT_REST_M_S: f64 = 1e-9;
/// How long the last cycles take to be heard.
const HEARD_WITHIN: Duration = Duration::from_millis(500);

/// An example that is a loop.
struct Loop {
    example: &'static str,
    file: &'static str,
    /// What else moves the robot.
    beside: &'static [Part],
    /// What it has the tendons do, as it tells.
    moves: fn(&Heard) -> Vec<TendonMotion>,
}

const LOOPS: [Loop; 2] = [
    Loop {
        example: "follow",
        file: "controller.toml",
        beside: &[Part::Daemon],
        moves: |heard| heard.cycles.iter().map(TendonMotion::from).collect(),
    },
    Loop {
        example: "drive",
        file: "robots/unit.toml",
        beside: &[Part::Daemon, Part::Controller],
        moves: since_the_last_setpoint,
    },
];

/// What the tendons do at an instant.
struct TendonMotion {
    stamp_ns: i64,
    velocity_m_s: [f64; 9],
}

impl From<&Cycle> for TendonMotion {
    fn from(cycle: &Cycle) -> Self {
        Self {
            stamp_ns: cycle.stamp_mono_ns,
            velocity_m_s: cycle.setpoint_velocity_m_s,
        }
    }
}

impl From<&RobotState> for TendonMotion {
    fn from(state: &RobotState) -> Self {
        Self {
            stamp_ns: state.stamp_mono_ns,
            velocity_m_s: state.accepted_velocity_m_s,
        }
    }
}

/// What a driver has the tendons do by itself: before that each velocity is a set-point's, at the set-point's own instant.
fn since_the_last_setpoint(heard: &Heard) -> Vec<TendonMotion> {
    let last = heard.robot.last().map(|it| it.accepted_sequence);
    let by_itself = heard
        .robot
        .iter()
        .skip_while(|it| Some(it.accepted_sequence) != last);
    by_itself.map(TendonMotion::from).collect()
}

pub(super) fn run(examples: &Examples, report: &mut Report) {
    for ended in &LOOPS {
        let group = format!("{}: {} until it is ended", examples.language, ended.example);
        report.group(&group, examples.command, |report| {
            for (name, signal) in SIGNALS {
                ended.end_in_motion(examples, report, name, signal)?;
            }
            Ok(())
        });
    }
}

impl Loop {
    fn end_in_motion(
        &self,
        examples: &Examples,
        report: &mut Report,
        name: &str,
        signal: libc::c_int,
    ) -> anyhow::Result<()> {
        let mut stack = Stack::new(&Settings::default());
        for part in self.beside {
            stack.start(*part);
        }
        stack.client.wait_for_daemon(PATIENCE)?;
        let listener = Listener::start(&stack.world.options);
        let file = stack.world.config(self.file).display().to_string();
        let mut process = examples.start(&stack.world, self.example, &[&file])?;
        stack.wait_until_held().with_context(|| process.log())?;
        let id = stack.begin_motion(Goal::tip(TIP_M))?;
        stack.wait_for_progress(id, INTO_MOTION_S)?;
        process.signal(signal);
        let status = process.wait(LIMIT).with_context(|| process.log())?;
        let has_ended = |heard: &Heard| {
            let rests = (self.moves)(heard).last().is_some_and(TendonMotion::rests);
            rests && heard.results.iter().any(|it| it.trajectory_id == id)
        };
        let heard_end = wait_for(
            "its last cycle and the motion's result",
            HEARD_WITHIN,
            || listener.with(has_ended).then_some(()),
        );
        let heard = listener.take();
        let result = heard.results.iter().find(|it| it.trajectory_id == id);
        let is_stopped = result.is_some_and(|it| it.outcome == MotionOutcome::Stopped.code());
        let result = result.map_or_else(|| "no result".to_owned(), |it| it.reason.to_string());
        let moves = (self.moves)(&heard);
        let used = acceleration_use(&moves, stack.world.robot.tendon_limits.acceleration);
        let fastest = moves
            .iter()
            .map(TendonMotion::speed_m_s)
            .fold(0.0, f64::max);
        let rests = moves.last().is_some_and(TendonMotion::rests);
        report.check(
            &examples.line(&format!(
                "{}: {name} {INTO_MOTION_S} s into a motion: its end, the motion's, and the largest step of velocity ÷ (acceleration limit × time)",
                self.example
            )),
            format!(
                "{status}; {}: {result}; {used:.4}, {}",
                if is_stopped { "stopped" } else { "not stopped" },
                if rests { "at rest" } else { "in motion" }
            ),
            &format!("success, stopped, <= {ALLOWED_USE}, at rest"),
            status.success() && heard_end.is_ok() && is_stopped && rests && fastest > MOVING_M_S && used <= ALLOWED_USE,
        );
        Ok(())
    }
}

impl TendonMotion {
    fn speed_m_s(&self) -> f64 {
        largest(&self.velocity_m_s)
    }

    fn rests(&self) -> bool {
        self.speed_m_s() < AT_REST_M_S
    }
}

/// The largest change of a tendon's velocity by what the limit allows in that time.
fn acceleration_use(moves: &[TendonMotion], limit_m_s2: f64) -> f64 {
    let mut used = 0.0;
    for pair in moves.windows(2) {
        let [before, after] = [&pair[0], &pair[1]];
        let elapsed_s = (after.stamp_ns - before.stamp_ns) as f64 * 1e-9;
        for (from, to) in before.velocity_m_s.iter().zip(after.velocity_m_s) {
            raise(&mut used, (to - from).abs() / (limit_m_s2 * elapsed_s));
        }
    }
    used
}
