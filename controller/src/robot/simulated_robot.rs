//! Reference, motors and sensors together: the robot as its process drives it.

use pcc_model::{Configuration, TendonMap};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::{Pcg64, rand_core::SeedableRng};
use shared_types::clock::seconds;
use shared_types::message::Setpoint;

use super::{Motor, MotorLimits, MotorTarget, Reference, RememberedPose, RobotConfig};
use crate::{TENDONS, TendonVector};

/// Longest step of the motor model, s; longer cycles are cut into such steps.
const MOTOR_STEP_S: f64 = 1e-3;

/// Reference, motors and sensors of all tendons, driven cycle by cycle.
#[derive(Clone)]
pub struct SimulatedRobot {
    tendons: TendonMap,
    reference: Reference,
    motors: [Motor; TENDONS],
    limits: MotorLimits,
    noise_m: f64,
    random: Pcg64,
    stepped_ns: i64,
    /// The longest time that the motors are simulated for after a pause: the reference goes on for no longer.
    longest_catch_up_s: f64,
}

/// The robot's measurements after a cycle.
#[derive(Clone, Copy, Debug)]
pub struct Measurement {
    /// Tendon lengths relative to straight, with noise, m.
    pub tendon_m: TendonVector,
    /// The configuration that fits the measured tendon lengths best, rad.
    pub configuration_rad: Configuration,
}

impl SimulatedRobot {
    /// A robot at `pose` at `now_ns`: where that pose moves, the robot begins with a ramp to rest.
    #[must_use]
    pub fn new(config: &RobotConfig, now_ns: i64, pose: &RememberedPose) -> Self {
        Self {
            tendons: config.robot.tendons.clone(),
            reference: Reference::new(config.reference, now_ns, pose.position_m, pose.velocity_m_s),
            // Motors at rest would start behind a reference that moves, and swing about it for seconds.
            motors: std::array::from_fn(|tendon| {
                Motor::at(pose.position_m[tendon]).moving(pose.velocity_m_s[tendon])
            }),
            limits: config.motor,
            noise_m: config.noise_m,
            random: Pcg64::seed_from_u64(config.seed),
            stepped_ns: now_ns,
            longest_catch_up_s: seconds(config.reference.lost_after_ns),
        }
    }

    /// The reference that the motors track.
    #[must_use]
    pub fn reference(&self) -> &Reference {
        &self.reference
    }

    /// One cycle: takes `target` where one arrived, moves reference and motors on to `now_ns`, and measures. The motor of the tendon
    /// `stuck_tendon` (0-based) does not move: a fault injected from outside.
    pub fn step(
        &mut self,
        now_ns: i64,
        target: Option<&Setpoint>,
        stuck_tendon: Option<usize>,
    ) -> Measurement {
        if let Some(target) = target {
            // A refusal is kept in the reference's mode and counter.
            let _ = self.reference.offer(now_ns, target);
        }
        self.reference.advance(now_ns);
        self.move_motors(now_ns, stuck_tendon);
        self.measure()
    }

    fn move_motors(&mut self, now_ns: i64, stuck_tendon: Option<usize>) {
        let elapsed_s = seconds((now_ns - self.stepped_ns).max(0));
        self.stepped_ns = now_ns;
        let mut left_s = elapsed_s.min(self.longest_catch_up_s);
        let velocity_m_s = self.reference.velocity_m_s();
        let acceleration_m_s2 = self.reference.acceleration_m_s2();
        while left_s > 0.0 {
            let step_s = left_s.min(MOTOR_STEP_S);
            left_s -= step_s;
            for (tendon, motor) in self.motors.iter_mut().enumerate() {
                if stuck_tendon == Some(tendon) {
                    motor.stick();
                    continue;
                }
                let target = MotorTarget {
                    position_m: self.reference.position_m()[tendon] - velocity_m_s[tendon] * left_s,
                    velocity_m_s: velocity_m_s[tendon],
                    acceleration_m_s2: acceleration_m_s2[tendon],
                };
                motor.step(&target, &self.limits, step_s);
            }
        }
    }

    fn measure(&mut self) -> Measurement {
        let count = self.tendons.count();
        let mut tendon_m = [0.0; TENDONS];
        for (measured_m, motor) in tendon_m.iter_mut().zip(&self.motors).take(count) {
            let noise: f64 = StandardNormal.sample(&mut self.random);
            *measured_m = motor.tendon_m() + self.noise_m * noise;
        }
        Measurement {
            tendon_m,
            configuration_rad: self.tendons.configuration(&tendon_m[..count]),
        }
    }
}
