//! For tests: the unit robot, motions at its limits, and a controller with a simulated robot, cycle by cycle.

use std::path::Path;

use pcc_model::{Configuration, Robot};
use robot_driver::{Reference, TendonState};
use shared_types::codes::MotorState;
use shared_types::message::Setpoint;
use trajectory::{
    Knot, MovingStart, ParameterizationOptions, TimeParameterizer, Trajectory, evaluate, limit_use,
    stopping_motion,
};

use crate::{
    TENDONS, TendonVector,
    executive::{
        CycleInput, CycleOutput, Departure, Ending, Executive, ExecutiveSettings, Motion,
        RobotSample, RobotUpdate, StopOrigin,
    },
    robot::{RobotConfig, SimulatedMotors},
};

pub(crate) const MS: i64 = 1_000_000;

pub(crate) fn unit_robot() -> Robot {
    robot_config().robot
}

pub(crate) fn robot_config() -> RobotConfig {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../config/simulated-robot.toml");
    RobotConfig::from_file(&path).unwrap()
}

pub(crate) const SETTINGS: ExecutiveSettings = ExecutiveSettings {
    period_ns: MS,
    step_cap_ns: 20 * MS,
    late_run_ns: 100 * MS,
    robot_lost_ns: 20 * MS,
    tracking_filter_s: 0.01,
    hold_tolerance_rad: 0.02,
};

/// A curved rest-to-rest motion of `count` knots that uses the first of its limits fully.
pub(crate) fn curved_motion(
    id: u32,
    begin_ns: i64,
    from: Configuration,
    to: Configuration,
) -> Motion {
    let bulge = Configuration::from([0.2, -0.1, 0.15, 0.1, -0.2, 0.1]);
    let at = |u: f64, duration: f64| {
        let s = u.powi(3) * (10.0 - 15.0 * u + 6.0 * u * u);
        let ds = 30.0 * (u * (1.0 - u)).powi(2) / duration;
        let dds = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / duration.powi(2);
        let (sine, cosine) = (std::f64::consts::PI * s).sin_cos();
        let slope = (to - from) + bulge * (std::f64::consts::PI * cosine);
        let curvature = bulge * (-std::f64::consts::PI.powi(2) * sine);
        Knot {
            time: u * duration,
            position: from + (to - from) * s + bulge * sine,
            velocity: slope * ds,
            acceleration: curvature * (ds * ds) + slope * dds,
        }
    };
    let knots = |duration: f64| (0..48).map(|k| at(f64::from(k) / 47.0, duration)).collect();
    let robot = unit_robot();
    let used = |duration: f64| {
        limit_use(
            &Trajectory::new(knots(duration)).unwrap(),
            &robot.tendons,
            &robot.tendon_limits,
        )
    };
    let mut duration = used(1.0).time_scale();
    duration *= used(duration).time_scale();
    let mut motion = Motion::empty();
    motion.id = id;
    motion.begin_ns = begin_ns;
    motion.path_tolerance_rad = 0.02;
    motion.knots.extend(knots(duration));
    motion
}

/// A motion of the time parameterization through `path`: its jerk steps, as that of every planned motion.
pub(crate) fn timed_motion(id: u32, begin_ns: i64, path: &[Configuration]) -> Motion {
    let robot = unit_robot();
    let options = ParameterizationOptions::default();
    let timed = TimeParameterizer::default()
        .parameterize(path, &robot.tendons, &robot.tendon_limits, &options)
        .unwrap();
    let mut motion = Motion::empty();
    motion.id = id;
    motion.begin_ns = begin_ns;
    motion.path_tolerance_rad = 0.02;
    motion.knots.extend(timed.knots());
    motion
}

/// A motion to rest in `to` that leaves another one at a path time of that, s.
pub(crate) fn joined_motion(id: u32, left: &Motion, switch_s: f64, to: Configuration) -> Motion {
    let robot = unit_robot();
    let (tendons, limits) = (&robot.tendons, &robot.tendon_limits);
    let at = evaluate(&left.knots, &mut 0, switch_s);
    let state = Knot::of(0.0, &at);
    let stop = stopping_motion(&state, tendons, limits).unwrap();
    let start = MovingStart {
        state,
        path: &[stop.end(), to],
        braking_shares: &[0.9, 0.5],
    };
    let options = ParameterizationOptions::default();
    let mut parameterizer = TimeParameterizer::default();
    let joined = parameterizer
        .parameterize_from(&start, tendons, limits, &options)
        .unwrap();
    let mut motion = Motion::empty();
    motion.id = id;
    motion.path_tolerance_rad = 0.02;
    motion.leaves = Some(Departure {
        trajectory_id: left.id,
        path_time_s: switch_s,
    });
    motion.knots.extend(joined.knots());
    motion
}

pub(crate) fn target_configuration() -> Configuration {
    Configuration::from([0.6, -0.4, 0.3, 0.5, -0.5, 0.7])
}

/// Controller and robot joined without IPC; every cycle checks continuity and limits of what is sent.
#[derive(Clone)]
pub(crate) struct World {
    pub(crate) robot: Robot,
    pub(crate) config: RobotConfig,
    pub(crate) executive: Executive,
    pub(crate) reference: Reference,
    motors: SimulatedMotors,
    pub(crate) now_ns: i64,
    pub(crate) daemon_alive: bool,
    pub(crate) robot_silent: bool,
    /// The robot's driver sends its last state again and again.
    pub(crate) repeats_state: bool,
    /// What the robot's stamps are ahead of the clock.
    pub(crate) stamp_offset_ns: i64,
    /// The guard makes no rounds.
    pub(crate) guard_held_up: bool,
    /// A stop that the next cycle finds.
    pub(crate) stop: Option<StopOrigin>,
    pub(crate) stuck_tendon: Option<usize>,
    pub(crate) last: Option<CycleOutput>,
    /// The motions that ended in a cycle: their ids, and how they ended.
    pub(crate) ended: Vec<(u32, Ending)>,
    /// When the last one of them ended, by its own stamp.
    pub(crate) last_ended_ns: i64,
    sample: Option<RobotSample>,
    settings: ExecutiveSettings,
    sequence: u64,
    guard_rounds: u64,
}

impl World {
    pub(crate) fn new() -> Self {
        Self::with_period(MS)
    }

    /// A world whose controller expects cycles of `period_ns`.
    pub(crate) fn with_period(period_ns: i64) -> Self {
        let config = robot_config();
        let settings = ExecutiveSettings {
            period_ns,
            ..SETTINGS
        };
        let now_ns = 1_000 * MS;
        Self {
            robot: config.robot.clone(),
            executive: Executive::new(settings, &config.robot),
            reference: Reference::new(config.reference, now_ns, &config.start_pose()),
            motors: SimulatedMotors::new(&config, now_ns, &config.start_pose()),
            config,
            now_ns,
            daemon_alive: true,
            robot_silent: false,
            repeats_state: false,
            stamp_offset_ns: 0,
            guard_held_up: false,
            stop: None,
            stuck_tendon: None,
            last: None,
            ended: Vec::new(),
            last_ended_ns: 0,
            sample: None,
            settings,
            sequence: 0,
            guard_rounds: 0,
        }
    }

    /// A world whose controller holds and whose robot follows.
    pub(crate) fn holding() -> Self {
        let mut world = Self::new();
        world.run(10);
        world
    }

    pub(crate) fn begin_motion(&mut self, id: u32) {
        let motion = curved_motion(
            id,
            self.now_ns + 3 * MS,
            self.commanded(),
            target_configuration(),
        );
        self.executive
            .execute(motion)
            .map_err(|(reason, _)| reason)
            .unwrap();
    }

    pub(crate) fn commanded(&self) -> Configuration {
        self.last.as_ref().unwrap().commanded.position
    }

    /// `cycles` cycles of a millisecond.
    pub(crate) fn run(&mut self, cycles: u64) {
        for _ in 0..cycles {
            self.cycle(MS);
        }
    }

    /// A new controller process.
    pub(crate) fn restart_controller(&mut self) {
        self.executive = Executive::new(self.settings, &self.robot);
    }

    /// A new robot process, standing where the old one's motors do.
    pub(crate) fn restart_robot(&mut self) {
        let pose = TendonState {
            position_m: *self.reference.position_m(),
            velocity_m_s: self.reference.velocity_m_s(),
        };
        self.reference = Reference::new(self.config.reference, self.now_ns, &pose);
        self.motors = SimulatedMotors::new(&self.config, self.now_ns, &pose);
    }

    /// The robot alone, for `elapsed_ns` in steps of a millisecond.
    pub(crate) fn without_controller(&mut self, elapsed_ns: i64) {
        let end_ns = self.now_ns + elapsed_ns;
        while self.now_ns < end_ns {
            let before = (self.reference_m(), self.reference.velocity_m_s());
            self.now_ns += MS;
            self.move_robot(None);
            assert_step(
                &self.robot,
                MS,
                &before,
                &(self.reference_m(), self.reference.velocity_m_s()),
            );
        }
    }

    /// A cycle of the robot without a set-point.
    pub(crate) fn robot_alone(&mut self) {
        self.move_robot(None);
    }

    pub(crate) fn reference_m(&self) -> TendonVector {
        *self.reference.position_m()
    }

    /// One cycle of both, `elapsed_ns` after the one before.
    pub(crate) fn cycle(&mut self, elapsed_ns: i64) -> CycleOutput {
        self.now_ns += elapsed_ns;
        self.guard_rounds += u64::from(!self.guard_held_up);
        let sample = self.sample.filter(|_| !self.robot_silent);
        let update = sample
            .as_ref()
            .map_or(RobotUpdate::Nothing, RobotUpdate::State);
        let output = self.controller_cycle(update);
        while let Some(ended) = self.executive.take_finished() {
            self.last_ended_ns = ended.stamp_ns;
            self.ended.push((ended.motion.id, ended.ending));
        }
        if let Some(before) = self.last.filter(|before| before.send && output.send) {
            let state = |output: &CycleOutput| (output.tendon_m, output.tendon_velocity_m_s);
            assert_step(&self.robot, elapsed_ns, &state(&before), &state(&output));
        }
        let most = largest(&output.tendon_acceleration_m_s2);
        assert!(
            most <= self.robot.tendon_limits.acceleration * (1.0 + 1e-6),
            "{most}"
        );
        self.sequence += 1;
        let target = Setpoint {
            sequence: self.sequence,
            stamp_mono_ns: output.stamp_ns,
            position_m: output.tendon_m,
            velocity_m_s: output.tendon_velocity_m_s,
            acceleration_m_s2: output.tendon_acceleration_m_s2,
            ..Setpoint::ZEROED
        };
        self.move_robot(output.send.then_some(&target));
        self.last = Some(output);
        output
    }

    /// A cycle of the controller now.
    pub(crate) fn controller_cycle(&mut self, update: RobotUpdate<'_>) -> CycleOutput {
        self.executive.hear_robot(self.now_ns, update);
        if let Some(origin) = self.stop.take() {
            // An error says that there is nothing to stop.
            let _ = self.executive.stop(origin);
        }
        self.executive.step(&CycleInput {
            daemon_alive: self.daemon_alive,
            guard_rounds: self.guard_rounds,
        })
    }

    /// The robot's newest state.
    pub(crate) fn sample(&self) -> RobotSample {
        self.sample.unwrap()
    }

    fn move_robot(&mut self, target: Option<&Setpoint>) {
        let targets = self.reference.step(self.now_ns, target);
        let measured_m = self.motors.step(&targets, self.stuck_tendon);
        let reference = &self.reference;
        if self.repeats_state {
            return;
        }
        self.sample = Some(RobotSample {
            stamp_ns: self.now_ns + self.stamp_offset_ns,
            robot_hash: self.robot.hash(),
            state: MotorState::from(reference.mode()),
            accepted_m: *reference.position_m(),
            accepted_velocity_m_s: reference.velocity_m_s(),
            measured_m,
            measured_rad: self
                .robot
                .tendons
                .configuration(&measured_m[..self.robot.tendons.count()]),
        });
    }
}

fn largest(values: &TendonVector) -> f64 {
    values
        .iter()
        .fold(0.0, |most: f64, value| most.max(value.abs()))
}

/// Position and velocity changed by no more than the limits allow in `elapsed_ns`, and by what the velocities say.
pub(crate) fn assert_step(
    robot: &Robot,
    elapsed_ns: i64,
    before: &(TendonVector, TendonVector),
    after: &(TendonVector, TendonVector),
) {
    let (velocity, acceleration) = (
        robot.tendon_limits.velocity,
        robot.tendon_limits.acceleration,
    );
    let elapsed_s = elapsed_ns as f64 * 1e-9;
    let tolerance = 1.0 + 1e-6;
    for tendon in 0..TENDONS {
        let step_m = after.0[tendon] - before.0[tendon];
        assert!(
            after.1[tendon].abs() <= velocity * tolerance,
            "velocity {}",
            after.1[tendon]
        );
        assert!(
            step_m.abs() <= velocity * elapsed_s * tolerance + 1e-12,
            "step {step_m}"
        );
        let change_m_s = after.1[tendon] - before.1[tendon];
        assert!(
            change_m_s.abs() <= acceleration * elapsed_s * (1.0 + 1e-3) + 1e-12,
            "velocity change {change_m_s} in {elapsed_s} s"
        );
        let mean_m = 0.5 * (before.1[tendon] + after.1[tendon]) * elapsed_s;
        assert!(
            (step_m - mean_m).abs() <= 0.3 * acceleration * elapsed_s.powi(2) + 1e-12,
            "step {step_m}, by the velocities {mean_m}"
        );
    }
}
