//! Knots on the wire, and the hash by which equal plans are known.

use pcc_model::{BitHash, DOF};
use shared_types::message::Knot;

/// A knot as it travels; knots hold seconds and radians, so nothing is scaled.
pub(crate) fn to_wire(knot: &trajectory::Knot) -> Knot {
    Knot {
        time_s: knot.time,
        configuration_rad: knot.position.into(),
        velocity_rad_s: knot.velocity.into(),
        acceleration_rad_s2: knot.acceleration.into(),
    }
}

/// Hash of knots, one after the other: equal plans have equal hashes.
///
/// Times and configurations, velocities, and accelerations have a lane each, since each step waits for the one before it in its lane; then
/// the lanes are hashed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct KnotHash([BitHash; 3]);

impl KnotHash {
    pub(crate) const fn new() -> Self {
        Self([BitHash::new(); 3])
    }

    pub(crate) fn add(&mut self, knot: &Knot) {
        let [configurations, velocities, accelerations] = &mut self.0;
        configurations.add(knot.time_s.to_bits());
        for axis in 0..DOF {
            configurations.add(knot.configuration_rad[axis].to_bits());
            velocities.add(knot.velocity_rad_s[axis].to_bits());
            accelerations.add(knot.acceleration_rad_s2[axis].to_bits());
        }
    }

    pub(crate) fn value(self) -> u64 {
        let [mut all, velocities, accelerations] = self.0;
        all.add(velocities.value());
        all.add(accelerations.value());
        all.value()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_sees_every_bit_and_the_order() {
        let hash = |knots: &[Knot]| {
            let mut hash = KnotHash::new();
            knots.iter().for_each(|knot| hash.add(knot));
            hash.value()
        };
        let last = to_wire(&trajectory::Knot::resting(
            2.0,
            pcc_model::Configuration::repeat(0.25),
        ));
        let mut other = last;
        other.acceleration_rad_s2[5] = f64::from_bits(1);
        assert_eq!(hash(&[last, other]), hash(&[last, other]));
        assert_ne!(hash(&[last, other]), hash(&[other, last]));
        assert_ne!(hash(&[last]), hash(&[other]));
        let exchanged = Knot {
            velocity_rad_s: other.acceleration_rad_s2,
            acceleration_rad_s2: other.velocity_rad_s,
            ..other
        };
        assert_ne!(hash(&[other]), hash(&[exchanged]));
        let mirrored = Knot {
            configuration_rad: last.configuration_rad.map(|angle| -angle),
            ..last
        };
        assert_ne!(hash(&[last]), hash(&[mirrored]));
    }
}
