//! Motors and sensors of all tendons, as the robot's process drives them.

use rand_distr::{Distribution, StandardNormal};
use rand_pcg::{Pcg64, rand_core::SeedableRng};
use robot_driver::{MotorTargets, TendonState};
use shared_types::clock::seconds;

use super::{Motor, MotorLimits, MotorTarget, RobotConfig};
use crate::{TENDONS, TendonVector};

/// Longest step of the motor model, s; longer cycles are cut into such steps.
const MOTOR_STEP_S: f64 = 1e-3;

/// Motors and sensors, driven cycle by cycle.
#[derive(Clone)]
pub struct SimulatedMotors {
    count: usize,
    motors: [Motor; TENDONS],
    limits: MotorLimits,
    noise_m: f64,
    random: Pcg64,
    stepped_ns: i64,
    /// The longest time that the motors are simulated for after a pause: the reference goes on for no longer.
    longest_catch_up_s: f64,
}

impl SimulatedMotors {
    /// Motors in this state at `now_ns`.
    #[must_use]
    pub fn new(config: &RobotConfig, now_ns: i64, state: &TendonState) -> Self {
        Self {
            count: config.robot.tendons.count(),
            // Motors at rest would start behind a reference that moves, and swing about it for seconds.
            motors: std::array::from_fn(|tendon| {
                Motor::at(state.position_m[tendon]).moving(state.velocity_m_s[tendon])
            }),
            limits: config.motor,
            noise_m: config.noise_m,
            random: Pcg64::seed_from_u64(config.seed),
            stepped_ns: now_ns,
            longest_catch_up_s: seconds(config.reference.lost_after_ns),
        }
    }

    /// One cycle: moves the motors towards their targets, and measures tendon lengths relative to straight, with noise, m. The motor of the
    /// tendon `stuck_tendon` (0-based) does not move: a fault injected from outside.
    pub fn step(&mut self, targets: &MotorTargets, stuck_tendon: Option<usize>) -> TendonVector {
        self.move_motors(targets, stuck_tendon);
        self.measure()
    }

    fn move_motors(&mut self, targets: &MotorTargets, stuck_tendon: Option<usize>) {
        let elapsed_s = seconds((targets.stamp_ns - self.stepped_ns).max(0));
        self.stepped_ns = targets.stamp_ns;
        let mut left_s = elapsed_s.min(self.longest_catch_up_s);
        while left_s > 0.0 {
            let step_s = left_s.min(MOTOR_STEP_S);
            left_s -= step_s;
            for (tendon, motor) in self.motors.iter_mut().enumerate() {
                if stuck_tendon == Some(tendon) {
                    motor.stick();
                    continue;
                }
                let target = MotorTarget {
                    position_m: targets.position_m[tendon] - targets.velocity_m_s[tendon] * left_s,
                    velocity_m_s: targets.velocity_m_s[tendon],
                    acceleration_m_s2: targets.acceleration_m_s2[tendon],
                };
                motor.step(&target, &self.limits, step_s);
            }
        }
    }

    fn measure(&mut self) -> TendonVector {
        let mut tendon_m = [0.0; TENDONS];
        for (measured_m, motor) in tendon_m.iter_mut().zip(&self.motors).take(self.count) {
            let noise: f64 = StandardNormal.sample(&mut self.random);
            *measured_m = motor.tendon_m() + self.noise_m * noise;
        }
        tendon_m
    }
}
