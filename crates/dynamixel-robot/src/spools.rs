//! Tendon lengths and the turns of the servos that wind them.

use std::f64::consts::TAU;

use robot_driver::{TENDONS, TendonVector};

use crate::registers::PULSES_OF_A_TURN;

/// How servos wind tendons onto their spools.
#[derive(Clone, Debug)]
pub(crate) struct Spools {
    /// Pulses by which the position grows while a tendon gets a metre longer, negative where the servo turns the other way.
    pulses_of_a_metre: Vec<f64>,
    /// Positions of the straight robot, pulses.
    zeros: Vec<i32>,
}

impl Spools {
    /// Spools of this radius (m), of servos that turn in these directions: 1 where a tendon gets longer while the position grows, or -1.
    pub(crate) fn new(radius_m: f64, directions: &[i8], zeros: Vec<i32>) -> Self {
        let of_a_metre = PULSES_OF_A_TURN / (TAU * radius_m);
        let pulses = directions.iter().map(|it| f64::from(*it) * of_a_metre);
        Self {
            pulses_of_a_metre: pulses.collect(),
            zeros,
        }
    }

    /// Positions of the servos for lengths relative to the straight robot, m.
    pub(crate) fn positions(&self, tendon_m: &TendonVector, positions: &mut [i32]) {
        for (tendon, position) in positions.iter_mut().enumerate() {
            let pulses = tendon_m[tendon] * self.pulses_of_a_metre[tendon];
            *position = self.zeros[tendon].saturating_add(pulses.round() as i32);
        }
    }

    /// The length of a tendon relative to the straight robot at a position of its servo, m.
    pub(crate) fn length_m(&self, tendon: usize, position: i32) -> f64 {
        let pulses = f64::from(position) - f64::from(self.zeros[tendon]);
        pulses / self.pulses_of_a_metre[tendon]
    }

    /// The lengths at these positions, m; 0 beyond the servos.
    pub(crate) fn lengths_m(&self, positions: &[i32]) -> TendonVector {
        let mut lengths_m = [0.0; TENDONS];
        for (tendon, position) in positions.iter().enumerate() {
            lengths_m[tendon] = self.length_m(tendon, *position);
        }
        lengths_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_of_a_spool_is_its_circumference_in_either_direction() {
        let spools = Spools::new(0.01, &[1, -1], vec![100, -5_000_000]);
        let circumference_m = TAU * 0.01;
        let mut lengths = [0.0; TENDONS];
        lengths[..2].copy_from_slice(&[circumference_m, 2.5 * circumference_m]);
        let mut positions = [0; 2];
        spools.positions(&lengths, &mut positions);
        assert_eq!(positions, [100 + 4096, -5_000_000 - 10_240]);
        let back = spools.lengths_m(&positions);
        assert!(
            back.iter()
                .zip(&lengths)
                .all(|(a, b)| (a - b).abs() < 1e-12)
        );
    }
}
