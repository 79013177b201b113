//! One tendon's motor: second-order tracking with velocity and acceleration limits, and backlash behind it.

/// Limits and properties of a motor.
#[derive(Clone, Copy, Debug)]
pub struct MotorLimits {
    /// Largest speed, m/s.
    pub velocity_m_s: f64,
    /// Largest acceleration, m/s².
    pub acceleration_m_s2: f64,
    /// Natural frequency of the (critically damped) position loop, rad/s.
    pub natural_frequency_rad_s: f64,
    /// Play between motor and tendon, m (whole width).
    pub backlash_m: f64,
}

/// Share of the largest acceleration that catching up counts on for its own braking.
const CATCH_UP_SHARE: f64 = 0.4;

impl MotorLimits {
    /// How much faster than its target a motor turns that is `behind_m` behind it, m/s.
    ///
    /// Proportional where the motor is nearly there: with the damping of [`Motor::step`], a critically damped loop. Farther
    /// away only as fast as it can brake again, or it would swing about the target.
    fn catch_up_m_s(&self, behind_m: f64) -> f64 {
        let gain_per_s = 0.5 * self.natural_frequency_rad_s;
        let braking_m_s2 = CATCH_UP_SHARE * self.acceleration_m_s2;
        let near_m = braking_m_s2 / gain_per_s.powi(2);
        if behind_m.abs() <= near_m {
            return gain_per_s * behind_m;
        }
        let distance_m = behind_m.abs() - 0.5 * near_m;
        (2.0 * braking_m_s2 * distance_m).sqrt().copysign(behind_m)
    }
}

/// The state of one motor and its tendon.
#[derive(Clone, Copy, Debug)]
pub struct Motor {
    shaft_m: f64,
    velocity_m_s: f64,
    tendon_m: f64,
}

/// The position, velocity and acceleration that a motor is to track at an instant.
#[derive(Clone, Copy, Debug)]
pub struct MotorTarget {
    /// Position, m.
    pub position_m: f64,
    /// Velocity, m/s.
    pub velocity_m_s: f64,
    /// Acceleration, m/s².
    pub acceleration_m_s2: f64,
}

impl Motor {
    /// A motor at rest.
    #[must_use]
    pub fn at(position_m: f64) -> Self {
        Self {
            shaft_m: position_m,
            velocity_m_s: 0.0,
            tendon_m: position_m,
        }
    }

    /// This motor, already turning at `velocity_m_s`.
    #[must_use]
    pub fn moving(self, velocity_m_s: f64) -> Self {
        Self {
            velocity_m_s,
            ..self
        }
    }

    /// The tendon's length behind the backlash, m.
    #[must_use]
    pub fn tendon_m(&self) -> f64 {
        self.tendon_m
    }

    /// Tracks `target` for `step_s` (semi-implicit Euler; stable for steps below 2 / natural frequency).
    pub fn step(&mut self, target: &MotorTarget, limits: &MotorLimits, step_s: f64) {
        let damping = 2.0 * limits.natural_frequency_rad_s;
        let catch_up_m_s = limits.catch_up_m_s(target.position_m - self.shaft_m);
        let wanted_m_s2 = target.acceleration_m_s2
            + damping * (target.velocity_m_s + catch_up_m_s - self.velocity_m_s);
        let acceleration_m_s2 =
            wanted_m_s2.clamp(-limits.acceleration_m_s2, limits.acceleration_m_s2);
        self.velocity_m_s = (self.velocity_m_s + acceleration_m_s2 * step_s)
            .clamp(-limits.velocity_m_s, limits.velocity_m_s);
        self.shaft_m += self.velocity_m_s * step_s;
        let play_m = 0.5 * limits.backlash_m;
        self.tendon_m = self
            .tendon_m
            .clamp(self.shaft_m - play_m, self.shaft_m + play_m);
    }

    /// Makes the motor stick: it stays where it is, whatever its target.
    pub fn stick(&mut self) {
        self.velocity_m_s = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: MotorLimits = MotorLimits {
        velocity_m_s: 0.1,
        acceleration_m_s2: 0.5,
        natural_frequency_rad_s: 100.0,
        backlash_m: 1e-4,
    };

    #[test]
    fn a_motor_far_from_its_target_gets_there_without_swinging_about_it() {
        let mut motor = Motor::at(0.0);
        let target = MotorTarget {
            position_m: 8e-3,
            velocity_m_s: 0.0,
            acceleration_m_s2: 0.0,
        };
        let mut arrived_ms = None;
        for ms in 0..1_000 {
            motor.step(&target, &LIMITS, 1e-3);
            assert!(motor.tendon_m() < 8e-3 + 1e-4, "{} m", motor.tendon_m());
            if motor.tendon_m() > 8e-3 - 1.5e-4 {
                arrived_ms = arrived_ms.or(Some(ms));
            }
        }
        // At the least 2 √(d / a) = 253 ms.
        assert!(arrived_ms.unwrap() < 400, "{arrived_ms:?} ms");
    }

    #[test]
    fn a_motor_that_was_moving_comes_to_rest_with_its_reference() {
        // As after a restart: at full speed, braking at the acceleration that the motor has to spare.
        let (speed_m_s, braking_m_s2) = (0.08, 0.4);
        let mut motor = Motor::at(0.0).moving(speed_m_s);
        let mut reference = MotorTarget {
            position_m: 0.0,
            velocity_m_s: speed_m_s,
            acceleration_m_s2: -braking_m_s2,
        };
        for _ in 0..200 {
            reference.velocity_m_s -= braking_m_s2 * 1e-3;
            reference.position_m += reference.velocity_m_s * 1e-3;
            motor.step(&reference, &LIMITS, 1e-3);
            assert!((motor.tendon_m() - reference.position_m).abs() < 2e-4);
        }
        assert!(reference.velocity_m_s.abs() < 1e-9, "the premise: it rests");
    }

    #[test]
    fn a_smooth_motion_is_followed_within_the_backlash_and_a_little() {
        let mut motor = Motor::at(0.0);
        for step in 0..5_000 {
            let t = f64::from(step) * 1e-3;
            let target = MotorTarget {
                position_m: 0.02 * (1.0 - (2.0 * t).cos()),
                velocity_m_s: 0.04 * (2.0 * t).sin(),
                acceleration_m_s2: 0.08 * (2.0 * t).cos(),
            };
            motor.step(&target, &LIMITS, 1e-3);
            let error_m = (motor.tendon_m() - target.position_m).abs();
            assert!(error_m < 0.5e-4 + 1e-4, "{error_m} at {t}");
        }
    }

    #[test]
    fn a_jump_of_the_target_is_followed_within_the_motors_limits() {
        let mut motor = Motor::at(0.0);
        let target = MotorTarget {
            position_m: 1.0,
            velocity_m_s: 0.0,
            acceleration_m_s2: 0.0,
        };
        let mut fastest_m_s: f64 = 0.0;
        for _ in 0..20_000 {
            let before = motor;
            motor.step(&target, &LIMITS, 1e-3);
            let change_m_s = motor.velocity_m_s - before.velocity_m_s;
            assert!(change_m_s.abs() <= 0.5e-3 + 1e-12 && motor.velocity_m_s.abs() <= 0.1);
            fastest_m_s = fastest_m_s.max(motor.velocity_m_s);
        }
        assert!((fastest_m_s - 0.1).abs() < 1e-12, "the limit was reached");
        assert!((motor.tendon_m() - 1.0).abs() <= 0.51e-4);
    }

    #[test]
    fn backlash_shows_when_the_direction_turns() {
        let mut motor = Motor::at(0.0);
        let mut to = |position_m: f64| {
            let target = MotorTarget {
                position_m,
                velocity_m_s: 0.0,
                acceleration_m_s2: 0.0,
            };
            (0..2_000).for_each(|_| motor.step(&target, &LIMITS, 1e-3));
            motor.tendon_m()
        };
        assert!((to(0.01) - 0.00995).abs() < 1e-6);
        assert!(
            (to(0.00995) - 0.00995).abs() < 1e-6,
            "inside the play nothing moves"
        );
        assert!((to(0.0) - 0.00005).abs() < 1e-6);
    }
}
