//! The shipped state machine with a clock and a robot of the test's own.

use std::sync::LazyLock;

use controller::executive::{
    CycleInput, CycleOutput, Executive, ExecutiveSettings, Motion, RobotSample, RobotUpdate,
    StopOrigin,
};
use controller::service::ControllerConfig;
use pcc_model::{Configuration, Robot};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use shared_types::codes::{LoopFault, LoopState, MotorState};
use tests::programs::repository;
use tests::world::shipped_number;
use trajectory::Trajectory;

use super::extrapolating_law::ExtrapolatingLaw;
use super::judge::{Figures, Judge, Sent};

/// The settings of the shipped controller.
static SHIPPED: LazyLock<ExecutiveSettings> = LazyLock::new(|| {
    let file = repository().join("config/controller.toml");
    let config = ControllerConfig::from_file(&file).expect("the shipped configuration is good");
    config.executive
});
/// One cycle in so many is late, by up to [`LATEST_NS`].
const LATE_ONE_IN: u32 = 60;
const LATEST_NS: i64 = 30_000_000;
/// No stop lasts longer, s: v ÷ a of the robot is 0.2 s.
const PATIENCE_S: f64 = 10.0;
const START_NS: i64 = 1_000_000_000;

/// What a number of orders led to.
#[derive(Default)]
pub(super) struct Run {
    pub(super) stops: usize,
    /// Those given while the motion went on.
    pub(super) speed_changes: usize,
    pub(super) let_go: Vec<String>,
    pub(super) unrested: Vec<String>,
    pub(super) figures: Figures,
    /// Durations of stops at full rate, now and with the law of before, s, and of those after changes of speed.
    durations_s: [Vec<[f64; 2]>; 2],
}

/// What a stop interrupts.
#[derive(Clone, Copy)]
pub(super) enum Before {
    FullRate,
    SpeedChanges,
}

impl Before {
    pub(super) const ALL: [Self; 2] = [Self::FullRate, Self::SpeedChanges];

    pub(super) fn text(self) -> &'static str {
        match self {
            Self::FullRate => "at full rate",
            Self::SpeedChanges => "after speed changes",
        }
    }
}

impl Run {
    pub(super) fn merge(&mut self, other: Self) {
        self.stops += other.stops;
        self.speed_changes += other.speed_changes;
        self.let_go.extend(other.let_go);
        self.unrested.extend(other.unrested);
        self.figures.merge(&other.figures);
        for (own, others) in self.durations_s.iter_mut().zip(other.durations_s) {
            own.extend(others);
        }
    }

    /// The median stop ÷ that of the law of before; NaN where there is none.
    pub(super) fn median_ratio(&self, before: Before) -> f64 {
        let durations_s = &self.durations_s[before as usize];
        let median = |law: usize| {
            let mut values: Vec<f64> = durations_s.iter().map(|pair| pair[law]).collect();
            values.sort_unstable_by(f64::total_cmp);
            values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
        };
        median(0) / median(1)
    }
}

/// The state machine, and a robot that does what it is told.
#[derive(Clone)]
struct Driven {
    executive: Executive,
    period_ns: i64,
    now_ns: i64,
    robot: RobotSample,
    last: Option<CycleOutput>,
    random: Pcg64,
}

impl Driven {
    fn new(robot: &Robot, start: &Configuration, period_ns: i64, seed: u64) -> Self {
        let settings = ExecutiveSettings {
            period_ns,
            ..*SHIPPED
        };
        let mut position_m = [0.0; 9];
        robot.tendons.lengths(start, &mut position_m);
        Self {
            executive: Executive::new(settings, robot),
            period_ns,
            now_ns: START_NS,
            robot: RobotSample {
                stamp_ns: START_NS,
                robot_hash: robot.hash(),
                state: MotorState::Idle,
                accepted_m: position_m,
                accepted_velocity_m_s: [0.0; 9],
                measured_m: position_m,
                measured_rad: *start,
            },
            last: None,
            random: Pcg64::seed_from_u64(seed),
        }
    }

    /// The length of the next cycle, ns: half a period to one and a half, and now and then late.
    fn draw_elapsed_ns(&mut self) -> i64 {
        let jittered = self
            .random
            .random_range(self.period_ns / 2..=3 * self.period_ns / 2);
        if self.random.random_ratio(1, LATE_ONE_IN) {
            jittered + self.random.random_range(0..LATEST_NS)
        } else {
            jittered
        }
    }

    fn cycle(&mut self) -> CycleOutput {
        self.now_ns += self.draw_elapsed_ns();
        let update = RobotUpdate::State(&self.robot);
        self.executive.hear_robot(self.now_ns, update);
        let output = self.executive.step(&CycleInput {
            daemon_alive: true,
            guard_rounds: self.now_ns.unsigned_abs(),
        });
        self.executive.take_finished();
        if output.send {
            self.robot = RobotSample {
                stamp_ns: self.now_ns,
                robot_hash: self.robot.robot_hash,
                state: MotorState::Following,
                accepted_m: output.tendon_m,
                accepted_velocity_m_s: output.tendon_velocity_m_s,
                measured_m: output.tendon_m,
                measured_rad: output.commanded.position,
            };
        } else {
            self.robot.stamp_ns = self.now_ns;
        }
        self.last = Some(output);
        output
    }
}

/// Orders `orders` stops (a half of them after changes of speed), evenly over the cycles of the motions.
pub(super) fn stop_everywhere(
    robot: &Robot,
    motions: &[Trajectory],
    period_ns: i64,
    orders: usize,
) -> anyhow::Result<Run> {
    let mut run = Run::default();
    let law = ExtrapolatingLaw::new(robot, period_ns as f64 * 1e-9);
    for (index, motion) in motions.iter().enumerate() {
        let share = orders * (index + 1) / motions.len() - orders * index / motions.len();
        let (seed, start) = (index as u64, motion.knots()[0].position);
        let mut driven = Driven::new(robot, &start, period_ns, seed);
        while driven.cycle().state != LoopState::Holding {}
        driven.execute(motion)?;
        let trial = Trial {
            robot,
            law: &law,
            motion,
        };
        trial.along(driven, share, &mut run);
    }
    Ok(run)
}

impl Driven {
    fn is_executing(&self) -> bool {
        let state = self.last.as_ref().map(|last| last.state);
        state == Some(LoopState::Executing)
    }

    fn execute(&mut self, motion: &Trajectory) -> anyhow::Result<()> {
        let mut filled = Motion::empty();
        filled.id = 1;
        filled.begin_ns = self.now_ns + self.period_ns;
        filled.path_tolerance_rad = shipped_number("planner-daemon.toml", "path_tolerance_rad");
        filled.knots.extend_from_slice(motion.knots());
        let taken = self.executive.execute(filled);
        taken.map_err(|(reason, _)| anyhow::anyhow!("{reason}"))
    }
}

/// Orders on one motion.
struct Trial<'a> {
    robot: &'a Robot,
    law: &'a ExtrapolatingLaw,
    motion: &'a Trajectory,
}

impl Trial<'_> {
    fn judge(&self) -> Judge<'_> {
        let limits = self.robot.tendon_limits;
        Judge::new(
            limits,
            self.motion.knots(),
            SHIPPED.step_cap_ns as f64 * 1e-9,
        )
    }

    /// Follows the motion to its end; `orders` times, at equal distances, a copy of everything is stopped.
    fn along(&self, mut driven: Driven, orders: usize, run: &mut Run) {
        let mut judge = self.judge();
        let mut done = 0;
        loop {
            let output = driven.cycle();
            judge.take(&sent(&output));
            self.note_loss(&output, "without an order", run);
            if output.state != LoopState::Executing && output.path_time_s > 0.0 {
                break;
            }
            let share = output.path_time_s / self.motion.duration();
            while output.state == LoopState::Executing
                && ((done + 1) as f64) <= share * orders as f64 + 0.5
            {
                done += 1;
                let mut copy = driven.clone();
                copy.random = Pcg64::seed_from_u64(driven.random.random());
                self.order(copy, done, run);
            }
        }
        run.figures.merge(&judge.figures);
    }

    fn note_loss(&self, output: &CycleOutput, what: &str, run: &mut Run) -> bool {
        let lost = !output.send || output.fault != LoopFault::None;
        if lost {
            let at = output.path_time_s;
            run.let_go.push(format!(
                "{what} at {at:.4} s: {}, {}",
                output.state, output.fault
            ));
        }
        lost
    }

    /// A stop at once, or after up to four changes of speed.
    fn order(&self, mut driven: Driven, number: usize, run: &mut Run) {
        let mut judge = self.judge();
        judge.take(&sent(driven.last.as_ref().unwrap()));
        let mut before = Before::FullRate;
        if number.is_multiple_of(2) {
            before = Before::SpeedChanges;
            for _ in 0..driven.random.random_range(1..=4) {
                let speed = match driven.random.random_range(0..4) {
                    0 => 0.0,
                    1 => 1.0,
                    _ => driven.random.random_range(0.0..1.0),
                };
                driven.executive.set_speed(speed).unwrap();
                run.speed_changes += usize::from(driven.is_executing());
                let for_ns = driven.now_ns + driven.random.random_range(0..300_000_000);
                while driven.now_ns < for_ns {
                    let output = driven.cycle();
                    judge.take(&sent(&output));
                    if self.note_loss(&output, "speed", run) {
                        return run.figures.merge(&judge.figures);
                    }
                }
            }
        }
        match (
            driven.is_executing(),
            driven.executive.stop(StopOrigin::Signal),
        ) {
            (true, Ok(())) => {
                run.stops += 1;
                self.stop(&mut driven, &mut judge, before, run);
            }
            (true, Err(refusal)) => {
                let at_s = driven.last.unwrap().path_time_s;
                run.unrested.push(format!("at {at_s:.4} s: {refusal}"));
            }
            // Its motion has come to its end at the ordered speeds.
            (false, _) => {}
        }
        run.figures.merge(&judge.figures);
    }

    fn stop(&self, driven: &mut Driven, judge: &mut Judge<'_>, before: Before, run: &mut Run) {
        let last = driven.last.unwrap();
        let (begin_ns, mut cycles_s) = (driven.now_ns, Vec::new());
        loop {
            let before_ns = driven.now_ns;
            let output = driven.cycle();
            judge.take(&sent(&output));
            cycles_s.push((driven.now_ns - before_ns).min(SHIPPED.step_cap_ns) as f64 * 1e-9);
            if self.note_loss(&output, "stop", run) {
                break;
            }
            if output.state == LoopState::Holding {
                break;
            }
            if (driven.now_ns - begin_ns) as f64 * 1e-9 > PATIENCE_S {
                let at = output.path_time_s;
                run.unrested
                    .push(format!("at {at:.4} s, rate {}", output.rate));
                break;
            }
        }
        let now_s: f64 = cycles_s.iter().sum();
        // It may have taken longer: in cycles of the mean length beyond those drawn.
        let mean_s = now_s / cycles_s.len() as f64;
        let cycles = cycles_s.iter().copied().chain(std::iter::repeat(mean_s));
        let place = [last.path_time_s, last.rate];
        let before_s = self.law.stop_s(self.motion.knots(), place, cycles);
        run.durations_s[before as usize].push([now_s, before_s]);
    }
}

fn sent(output: &CycleOutput) -> Sent {
    Sent {
        stamp_ns: output.stamp_ns,
        position: output.tendon_m,
        velocity: output.tendon_velocity_m_s,
        acceleration: output.tendon_acceleration_m_s2,
        configuration: output.commanded.position,
        path_time_s: output.path_time_s,
    }
}
