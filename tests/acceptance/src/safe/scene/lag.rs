//! A robot that comes late (a pause, a begin that is late, a begin in the past) where a ball crosses its way behind it.

use std::fs;
use std::sync::atomic::{AtomicI64, Ordering};
use std::thread;
use std::time::Duration;

use anyhow::Context;
use pcc_model::Robot;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopFault, Outcome};
use shared_types::ipc::IpcOptions;
use shared_types::message::{Cycle, MovingBall};
use shared_types::valid::PlanRequest;
use tests::brute_force::{Ball, Body};
use tests::listener::Listener;
use tests::programs::repository;
use tests::raw_scene::RawScenes;
use tests::stack::{MoveError, Part, Stack};
use tests::world::shipped_number;
use trajectory::Trajectory;

use super::crossing::Crossing;
use super::executed::{clearance, moves};
use super::scenario::{SECOND_NS, comes_to, request, running_with};
use crate::report::Report;
use crate::safe::on_path::Along;
use crate::scale::Scale;

/// Lifetime of the ball's scenes, and time between two of them.
const LIFETIME_NS: i64 = 200_000_000;
const PERIOD_MS: u64 = 20;
/// The robot begins to lag so long before the tip is where the ball crosses, s.
const BEFORE_CROSSING_S: f64 = 0.15;
const SPEEDS_M_S: [f64; 3] = [0.5, 1.0, 2.0];
/// Lags that the motions have room for, s, and whether the ball turns up only once the robot moves: those with little room are refused
/// where it is known beforehand.
const ROOMS_S: [(f64, bool); 7] = [
    (0.0, true),
    (0.12, true),
    (0.7, true),
    (0.0, false),
    (0.12, false),
    (0.7, false),
    (1.5, false),
];
/// With so much room nothing stands in the way of executing a motion, s.
const PLENTY_S: f64 = 1.5;
/// A ball that turns up does so when the motion has gone on for this, s: there is time to stop before the crossing.
const TURNS_UP_S: f64 = 0.4;
/// From then to a pause that makes the robot late.
const ACTED_UPON: [Duration; 2] = [Duration::ZERO, Duration::from_millis(5)];
const MS_NS: i64 = 1_000_000;
/// Until the ball's source is heard.
const CONNECTING_NS: i64 = 60 * MS_NS;
/// In place of a time: a ball that has not turned up.
const NOT_YET: i64 = i64::MAX;
/// In place of a time: nobody needs to be told of the ball any more.
const QUIT: i64 = -1;

/// What makes the robot late.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Late {
    /// All processes stand still, shortly before the tip is where the ball crosses.
    Paused,
    /// They stand still when the motion is to begin.
    PausedAtBegin,
    /// The controller hears of the motion when its begin has passed.
    BegunInThePast,
}

impl Late {
    const ALL: [Self; 3] = [Self::Paused, Self::PausedAtBegin, Self::BegunInThePast];

    /// How late, ms: what was seen to hurt began at 42 ms, and 190 ms is just under the age at which a state says nothing any more.
    fn lags_ms(self) -> &'static [i64] {
        match self {
            Self::Paused | Self::PausedAtBegin => &[40, 90, 140, 190],
            // It is silent for so long and for the way to the begin, 200 ms at most; 100 ms is what the controller allows.
            Self::BegunInThePast => &[5, 30, 60, 80],
        }
    }

    /// From the request to the begin.
    fn ahead_ns(self) -> i64 {
        match self {
            Self::Paused | Self::PausedAtBegin => 600 * MS_NS,
            Self::BegunInThePast => 70 * MS_NS,
        }
    }

    fn lags_before_crossing_s(self) -> f64 {
        match self {
            Self::Paused => BEFORE_CROSSING_S,
            Self::PausedAtBegin | Self::BegunInThePast => f64::INFINITY,
        }
    }
}

/// One try.
#[derive(Clone, Copy, Debug)]
struct Try {
    late: Late,
    lag_ms: i64,
    speed_m_s: f64,
    room_s: f64,
    /// The ball turns up once the robot moves, so that it is not refused beforehand.
    turns_up: bool,
    acted_upon: Duration,
}

impl Try {
    /// The least by which its path time falls behind the clock, ms: a cycle after a pause goes on by as much as the step cap.
    fn lags_at_least_ms(self) -> f64 {
        (self.lag_ms as f64 - shipped_number("controller.toml", "step_cap_ms")).max(0.0)
    }
}

/// What became of a motion beside a ball.
struct Passed {
    /// Whether the robot moved.
    executed: bool,
    /// Least clearance from the begin until the ball has passed, moving or at rest, m.
    clearance_m: f64,
    end: String,
    fault: LoopFault,
    /// The most by which path time fell behind the clock from one cycle to the next, its begin included, ms.
    lagged_ms: f64,
    /// Whether the motion that was executed would have touched the ball if it had gone on to its end, as late as it was.
    would_touch: bool,
}

/// What became of all motions that are late in one way.
struct Tally {
    touched: Vec<String>,
    faults: Vec<String>,
    /// Not executed, though nothing stood in their way.
    unmoved: Vec<String>,
    /// Not executed, which those with little room need not be.
    refused: Vec<String>,
    /// Executed without the lag that they were to have.
    in_time: Vec<String>,
    least_m: f64,
    /// Those with little room, and the executed ones among them.
    tight: usize,
    tight_executed: usize,
    would_touch: usize,
}

impl Tally {
    fn new() -> Self {
        Self {
            touched: Vec::new(),
            faults: Vec::new(),
            unmoved: Vec::new(),
            refused: Vec::new(),
            in_time: Vec::new(),
            least_m: f64::INFINITY,
            tight: 0,
            tight_executed: 0,
            would_touch: 0,
        }
    }

    fn add(&mut self, wanted: Try, passed: &Passed) {
        let text = format!("{wanted:?}: {:.3} m, {}", passed.clearance_m, passed.end);
        if passed.fault != LoopFault::None {
            self.faults.push(format!("{text}, {}", passed.fault));
        }
        if passed.clearance_m < 0.0 {
            self.touched.push(text.clone());
        }
        self.least_m = self.least_m.min(passed.clearance_m);
        let is_tight = wanted.room_s < PLENTY_S;
        let may_be_refused = is_tight && !wanted.turns_up;
        self.tight += usize::from(is_tight);
        self.would_touch += usize::from(passed.would_touch);
        self.tight_executed += usize::from(is_tight && passed.executed);
        if passed.executed && passed.lagged_ms < wanted.lags_at_least_ms() {
            let lag = format!("{:.1} ms: {wanted:?}", passed.lagged_ms);
            self.in_time.push(lag);
        }
        if !passed.executed && may_be_refused {
            self.refused.push(text);
        } else if !passed.executed {
            self.unmoved.push(text);
        }
    }

    fn report(&self, report: &mut Report, name: &str) {
        report.none_of(
            &format!("{name}: touched it, moving or at rest"),
            &self.touched,
        );
        report.none_of(&format!("{name}: faults"), &self.faults);
        report.none_of(
            &format!("{name}: should have been executed and were not"),
            &self.unmoved,
        );
        let first = self.refused.first().cloned().unwrap_or_default();
        let refused = format!("{} {first}", self.refused.len());
        report.shown(&format!("{name}: refused beforehand"), refused);
        report.none_of(
            &format!("{name}: whose path time did not lag as it was to (the premise)"),
            &self.in_time,
        );
        let (executed, tight) = (self.tight_executed, self.tight);
        report.check(
            &format!("{name}: executed, of those with little room"),
            format!("{executed} of {tight}"),
            "a third",
            executed > 0 && 3 * executed >= tight,
        );
        report.check(
            &format!("{name}: which would have touched it, late as they were, had nobody acted"),
            self.would_touch.to_string(),
            ">= 1",
            self.would_touch > 0,
        );
        let name = format!("{name}: least clearance, m");
        report.shown(&name, format!("{:.4}", self.least_m));
    }
}

/// Balls of 0.5 to 2 m/s beside motions that are 15 to 190 ms late.
pub(super) fn late_beside_a_ball(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let file = fs::read_to_string(repository().join("config/robots/unit.toml"))?;
    let body = Body::from_robot_file(&file);
    for late in Late::ALL {
        let mut stack = running_with(&[])?;
        let mut tally = Tally::new();
        let tries = tries(late, scale);
        for wanted in &tries {
            let passed = pass(&mut stack, &body, *wanted)?;
            tally.add(*wanted, &passed);
        }
        let count = tries.len();
        let name = format!("defect 6: {late:?}, {count} motions beside a moving ball");
        tally.report(report, &name);
    }
    Ok(())
}

/// Every room, with speeds and lags in turn.
fn tries(late: Late, scale: Scale) -> Vec<Try> {
    let lags_ms = late.lags_ms();
    let rounds = 0..scale.pick(1, 6);
    let rooms = rounds.flat_map(|round| {
        let rooms = ROOMS_S.into_iter().enumerate();
        rooms.map(move |(place, room)| (round, place, room))
    });
    rooms
        .map(|(round, place, (room_s, turns_up))| Try {
            late,
            lag_ms: lags_ms[(round + 3 - place % 4) % lags_ms.len()],
            speed_m_s: SPEEDS_M_S[(round + place) % SPEEDS_M_S.len()],
            room_s,
            turns_up,
            acted_upon: ACTED_UPON[round % ACTED_UPON.len()],
        })
        .collect()
}

fn pass(stack: &mut Stack, body: &Body, wanted: Try) -> anyhow::Result<Passed> {
    stack.wait_until_ready()?;
    let robot = stack.world.robot.clone();
    let request = request(stack);
    let motion = stack.planned(&request)?.context("nothing was planned")?;
    let late = wanted.late;
    let crossing = Crossing::new(
        (&robot, body),
        motion,
        wanted.speed_m_s,
        wanted.room_s,
        late.lags_before_crossing_s(),
    )?;
    let options = stack.world.options.clone();
    let told = AtomicI64::new(if wanted.turns_up { NOT_YET } else { 0 });
    let begin_ns = mono_now_ns() + CONNECTING_NS + late.ahead_ns();
    let ball = crossing.ball(begin_ns);
    thread::scope(|scope| {
        scope.spawn(|| tell(&options, &ball, &told));
        let moment = Moment {
            wanted,
            begin_ns,
            crossing: &crossing,
            told: &told,
        };
        let passed = moment.execute(stack, &request);
        told.store(QUIT, Ordering::Relaxed);
        passed
    })
    .map(|(end, fault, cycles)| {
        let executed = cycles.iter().any(moves);
        let lagged_ms = lagged_ms(&robot, &crossing.motion, begin_ns, &cycles);
        Passed {
            executed,
            clearance_m: clearance(body, &cycles, &ball),
            lagged_ms,
            would_touch: executed && crossing.clearance(body, 1e-3 * lagged_ms) < 0.0,
            end,
            fault,
        }
    })
}

/// The most by which path time fell behind the clock from one cycle of a motion to the next, the time until its first one included, ms.
fn lagged_ms(robot: &Robot, motion: &Trajectory, begin_ns: i64, cycles: &[Cycle]) -> f64 {
    let mut along = Along::new(robot, motion);
    let (mut lag_ms, mut most_ms) = (0.0, 0.0_f64);
    for cycle in cycles.iter().filter(|cycle| moves(cycle)) {
        let clock_ms = (cycle.stamp_mono_ns - begin_ns) as f64 * 1e-6;
        let now_ms = clock_ms - along.nearest(cycle).time_s * 1e3;
        most_ms = most_ms.max(now_ms - lag_ms);
        lag_ms = now_ms;
    }
    most_ms
}

/// A try with its times.
struct Moment<'a> {
    wanted: Try,
    begin_ns: i64,
    crossing: &'a Crossing,
    /// From when on the ball is told of, ns of CLOCK_MONOTONIC, or [`NOT_YET`], or [`QUIT`].
    told: &'a AtomicI64,
}

impl Moment<'_> {
    /// How it ended, its fault, and its cycles until the ball has passed.
    fn execute(
        &self,
        stack: &mut Stack,
        request: &PlanRequest,
    ) -> anyhow::Result<(String, LoopFault, Vec<Cycle>)> {
        let listener = Listener::start(&stack.world.options);
        sleep_until(self.begin_ns - self.wanted.late.ahead_ns());
        let in_the_past = self.wanted.late == Late::BegunInThePast;
        if in_the_past {
            hold_robot(stack, libc::SIGSTOP);
        }
        let later = PlanRequest {
            begin_mono_ns: Some(self.begin_ns),
            ..request.clone()
        };
        let published = stack.try_motion(&later);
        if in_the_past {
            sleep_until(self.begin_ns + self.wanted.lag_ms * MS_NS);
            hold_robot(stack, libc::SIGCONT);
        }
        let id = match published {
            Ok(id) => id,
            Err(MoveError::Refused {
                outcome: Outcome::ExecutionRefused,
                reason,
            }) => {
                return Ok((
                    format!("not executed: {reason}"),
                    LoopFault::None,
                    Vec::new(),
                ));
            }
            Err(error) => return Err(error.into()),
        };
        self.be_late(stack, id)?;
        let (end, fault) = end(stack, id)?;
        let past_s = self.crossing.past_s(&stack.world.robot);
        sleep_until(self.begin_ns + (past_s * SECOND_NS as f64) as i64);
        let cycles = listener.with(|heard| heard.cycles.clone());
        Ok((end, fault, cycles))
    }

    fn be_late(&self, stack: &mut Stack, id: u32) -> anyhow::Result<()> {
        let pause = Duration::from_millis(self.wanted.lag_ms.unsigned_abs());
        match self.wanted.late {
            Late::Paused => {
                let pause_s = if self.wanted.turns_up {
                    TURNS_UP_S
                } else {
                    self.crossing.tip_s - BEFORE_CROSSING_S
                };
                sleep_until(self.begin_ns + (pause_s * SECOND_NS as f64) as i64);
                if self.wanted.turns_up {
                    self.told.store(mono_now_ns(), Ordering::Relaxed);
                    thread::sleep(self.wanted.acted_upon);
                }
                stack.pause(pause, || ());
            }
            Late::PausedAtBegin => {
                sleep_until(self.begin_ns - MS_NS);
                stack.pause(pause + Duration::from_millis(1), || ());
                self.turn_up_moving(stack, id)?;
            }
            Late::BegunInThePast => self.turn_up_moving(stack, id)?,
        }
        Ok(())
    }

    /// The ball turns up when the motion has gone on for a while, if it does.
    fn turn_up_moving(&self, stack: &mut Stack, id: u32) -> anyhow::Result<()> {
        if self.wanted.turns_up && comes_to(stack, id, TURNS_UP_S)? {
            self.told.store(mono_now_ns(), Ordering::Relaxed);
        }
        Ok(())
    }
}

fn sleep_until(mono_ns: i64) {
    let left_ns = (mono_ns - mono_now_ns()).max(0);
    thread::sleep(Duration::from_nanos(left_ns.unsigned_abs()));
}

/// Sends a signal to controller and robot, so that neither misses the other.
fn hold_robot(stack: &mut Stack, signal: libc::c_int) {
    for part in [Part::Controller, Part::Robot] {
        stack.process(part).signal(signal);
    }
}

/// How a motion ended, and the fault that it left.
fn end(stack: &mut Stack, id: u32) -> anyhow::Result<(String, LoopFault)> {
    match stack.wait_for_end(id) {
        Ok(end) => {
            let text = format!("ended at {:.2} s", end.values.trajectory_time_s);
            Ok((text, end.fault))
        }
        Err(MoveError::CutShort(text)) => Ok((text, stack.controller_state().fault)),
        Err(error) => Err(error.into()),
    }
}

/// Tells of an empty scene 50 times a second, or of the ball once that has turned up, and in the end that it is gone.
fn tell(options: &IpcOptions, ball: &Ball, told: &AtomicI64) {
    let mut scenes = RawScenes::connect(options, "camera");
    loop {
        let (from_ns, now_ns) = (told.load(Ordering::Relaxed), mono_now_ns());
        if from_ns == QUIT {
            break;
        }
        let now_there = MovingBall {
            centre_m: ball.centre_at(now_ns),
            radius_m: ball.radius_m,
            velocity_m_s: ball.velocity_m_s,
        };
        let balls = if now_ns < from_ns {
            &[][..]
        } else {
            &[now_there][..]
        };
        scenes.send(now_ns, LIFETIME_NS, balls);
        thread::sleep(Duration::from_millis(if from_ns == NOT_YET {
            1
        } else {
            PERIOD_MS
        }));
    }
    scenes.send(mono_now_ns(), 60 * SECOND_NS, &[]);
}
