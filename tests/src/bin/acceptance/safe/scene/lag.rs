//! A ball that crosses the way behind the robot, and a robot that comes late.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use anyhow::Context;
use pcc_model::{Configuration, Point, Robot};
use shared_types::clock::mono_now_ns;
use shared_types::codes::Outcome;
use shared_types::ipc::IpcOptions;
use shared_types::message::{Cycle, MovingBall};
use shared_types::valid::PlanRequest;
use tests::brute_force::{Ball, Body};
use tests::listener::Listener;
use tests::programs::repository;
use tests::raw_scene::RawScenes;
use tests::stack::{MoveError, PATIENCE, Stack};
use trajectory::{Knot, Trajectory};

use super::executed::clearance;
use super::{SECOND_NS, pause_all, request, resume_all, settings};
use crate::{Report, Scale};

/// Lifetime of the ball's scenes, and time between two of them.
const LIFETIME_NS: i64 = 200_000_000;
const PERIOD: Duration = Duration::from_millis(20);
/// The pause of all processes.
const PAUSE: Duration = Duration::from_millis(190);
/// It begins so long before the tip is where the ball crosses, s.
const BEFORE_CROSSING_S: f64 = 0.15;
/// From the request to the begin of its motion.
const AHEAD_NS: i64 = 600_000_000;
const RADIUS_M: f64 = 0.1;
/// Clearance of a motion that lags as much as it is meant to be able to, m.
const SPARE_M: f64 = 0.02;
/// Lags that the motions are meant to be able to have, s. With the last one nothing stands in the way of executing them.
const LAGS_S: [f64; 3] = [0.0, 0.12, 1.5];

/// A motion, and a ball that crosses its way when the tip has passed.
struct Crossing {
    motion: Trajectory,
    /// When the tip is at the crossing, s of the motion.
    tip_s: f64,
    /// When the ball is, s of the motion if that does not lag.
    ball_s: f64,
    place: Point,
    velocity: Point,
}

impl Crossing {
    /// The ball comes across the plane of the tip's way, as soon after the tip as leaves room for every lag up to this.
    fn new(
        (robot, body): (&Robot, &Body),
        motion: Trajectory,
        speed_m_s: f64,
        lag_s: f64,
    ) -> anyhow::Result<Self> {
        let tip_s = 0.5 * motion.duration();
        let tip = |time| robot.tip(&motion.at(time).position);
        let (place, onward) = (tip(tip_s), tip(tip_s + 0.05) - tip(tip_s));
        let velocity = onward.cross(&place).normalize() * speed_m_s;
        let mut crossing = Self {
            motion,
            tip_s,
            ball_s: tip_s,
            place,
            velocity,
        };
        for step in 0..300 {
            crossing.ball_s = tip_s + 0.02 * f64::from(step);
            let mut lags = (0..=20).map(|i| lag_s * f64::from(i) / 20.0);
            let clear = |lag_s| crossing.clearance(body, lag_s) > SPARE_M;
            if lags.all(clear) {
                return Ok(crossing);
            }
        }
        anyhow::bail!("no time at which the ball could cross");
    }

    fn ball(&self, begin_ns: i64) -> Ball {
        Ball {
            centre_m: self.place.into(),
            radius_m: RADIUS_M,
            velocity_m_s: self.velocity.into(),
            stamp_ns: begin_ns + (self.ball_s * SECOND_NS as f64) as i64,
        }
    }

    /// Clearance of the motion if it lags by this much from the pause on, seen fifty times a second.
    fn clearance(&self, body: &Body, lag_s: f64) -> f64 {
        let ball = [self.ball(0)];
        let clearance = |i: i32| {
            let time_s = 0.02 * f64::from(i);
            let is_late = time_s > self.tip_s - BEFORE_CROSSING_S;
            let late_s = time_s + if is_late { lag_s } else { 0.0 };
            let shape = self.motion.at(time_s).position.into();
            body.clearance(&shape, &ball, (late_s * SECOND_NS as f64) as i64)
        };
        let count = (self.motion.duration() * 50.0) as i32;
        (0..=count).map(clearance).fold(f64::INFINITY, f64::min)
    }
}

/// What became of a motion beside a ball.
struct Passed {
    executed: bool,
    /// Least clearance while it moved, m.
    clearance_m: f64,
    end: String,
}

/// Balls of 0.5 to 2 m/s; all processes stand still for 190 ms before the place where they cross.
pub(super) fn paused_beside_a_ball(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut stack = Stack::running(&settings(false))?;
    let file = std::fs::read_to_string(repository().join("config/robots/unit.toml"))?;
    let body = Body::from_robot_file(&file);
    let (mut touched, mut free, mut roomy) = (Vec::new(), Vec::new(), 0);
    let speeds = [0.5, 1.0, 2.0].repeat(scale.pick(1, 8));
    for speed_m_s in &speeds {
        for lag_s in LAGS_S {
            let passed = pass(&mut stack, &body, *speed_m_s, lag_s)?;
            let text = format!(
                "{speed_m_s} m/s, room for {lag_s} s: {:.3} m ({})",
                passed.clearance_m, passed.end
            );
            if passed.executed && lag_s == LAGS_S[2] {
                roomy += 1;
            }
            if passed.clearance_m < 0.0 {
                touched.push(text);
            } else {
                free.push(text);
            }
        }
    }
    report.none_of(
        "pause of 190 ms beside a moving ball: motions that touched it",
        &touched,
    );
    report.shown("the others", free.join("; "));
    let name = "motions with room for 1.5 s of lag that were executed";
    report.all_of(name, roomy, speeds.len());
    Ok(())
}

fn pass(stack: &mut Stack, body: &Body, speed_m_s: f64, lag_s: f64) -> anyhow::Result<Passed> {
    stack.wait_until_ready()?;
    let robot = stack.world.robot.clone();
    let wanted = request(stack);
    let motion = planned(stack, &wanted)?;
    let crossing = Crossing::new((&robot, body), motion, speed_m_s, lag_s)?;
    let begin_ns = mono_now_ns() + AHEAD_NS;
    let ball = crossing.ball(begin_ns);
    let quit = AtomicBool::new(false);
    let options = stack.world.options.clone();
    thread::scope(|scope| {
        scope.spawn(|| tell(&options, &ball, &quit));
        let passed = execute_and_pause(stack, &wanted, begin_ns, &crossing);
        quit.store(true, Ordering::Relaxed);
        passed
    })
    .map(|(executed, end, cycles)| Passed {
        executed,
        clearance_m: clearance(body, &cycles, &ball),
        end,
    })
}

/// The motion that a request will be answered with, without executing it.
fn planned(stack: &mut Stack, wanted: &PlanRequest) -> anyhow::Result<Trajectory> {
    let only_planned = PlanRequest {
        execute: false,
        ..wanted.clone()
    };
    let answer = stack.client.plan(&only_planned, PATIENCE)?;
    let selected = answer.selected().context("nothing was planned")?;
    let knots = selected.knots.iter().map(|knot| Knot {
        time: knot.time_s,
        position: Configuration::from(knot.configuration_rad),
        velocity: Configuration::from(knot.velocity_rad_s),
        acceleration: Configuration::from(knot.acceleration_rad_s2),
    });
    Ok(Trajectory::new(knots.collect())?)
}

/// Whether it was executed, how it ended, and its cycles.
fn execute_and_pause(
    stack: &mut Stack,
    wanted: &PlanRequest,
    begin_ns: i64,
    crossing: &Crossing,
) -> anyhow::Result<(bool, String, Vec<Cycle>)> {
    thread::sleep(Duration::from_millis(50));
    let listener = Listener::start(&stack.world.options);
    let later = PlanRequest {
        begin_mono_ns: Some(begin_ns),
        ..wanted.clone()
    };
    let id = match stack.try_motion(&later) {
        Ok(id) => id,
        Err(MoveError::Refused {
            outcome: Outcome::ExecutionRefused,
            reason,
        }) => {
            return Ok((false, format!("not executed: {reason}"), Vec::new()));
        }
        Err(error) => return Err(error.into()),
    };
    let pause_s = crossing.tip_s - BEFORE_CROSSING_S;
    let until_ns = begin_ns + (pause_s * SECOND_NS as f64) as i64 - mono_now_ns();
    thread::sleep(Duration::from_nanos(until_ns.max(0).unsigned_abs()));
    pause_all(stack, PAUSE);
    resume_all(stack);
    let end = match stack.wait_for_end(id) {
        Ok(end) => format!("ended at {:.2} s", end.values.trajectory_time_s),
        Err(MoveError::CutShort(text)) => text,
        Err(error) => return Err(error.into()),
    };
    let cycles = listener.with(|heard| heard.cycles.clone());
    Ok((true, end, cycles))
}

/// Tells of the ball 50 times a second, and in the end that it is gone.
fn tell(options: &IpcOptions, ball: &Ball, quit: &AtomicBool) {
    let mut scenes = RawScenes::connect(options, "camera");
    while !quit.load(Ordering::Relaxed) {
        let now_ns = mono_now_ns();
        let now_there = MovingBall {
            centre_m: ball.centre_at(now_ns),
            radius_m: ball.radius_m,
            velocity_m_s: ball.velocity_m_s,
        };
        scenes.send(now_ns, LIFETIME_NS, &[now_there]);
        thread::sleep(PERIOD);
    }
    scenes.send(mono_now_ns(), 60 * SECOND_NS, &[]);
}
