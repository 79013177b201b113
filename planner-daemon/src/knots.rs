//! Knots on the wire, and the hash by which equal plans are known.

use pcc_model::DOF;
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
/// The `FxHash` of rustc (rotate by 5, exclusive or, multiply) over the bits of every number, in a lane each for times and configurations,
/// for velocities and for accelerations, since each step waits for the one before it in its lane; then over the lanes. The
/// rotation keeps two changed signs from cancelling.
#[derive(Clone, Copy, Debug)]
pub(crate) struct KnotHash([u64; 3]);

impl KnotHash {
    pub(crate) const fn new() -> Self {
        Self([0; 3])
    }

    pub(crate) fn add(&mut self, knot: &Knot) {
        let [configurations, velocities, accelerations] = &mut self.0;
        mix(configurations, knot.time_s.to_bits());
        for axis in 0..DOF {
            mix(configurations, knot.configuration_rad[axis].to_bits());
            mix(velocities, knot.velocity_rad_s[axis].to_bits());
            mix(accelerations, knot.acceleration_rad_s2[axis].to_bits());
        }
    }

    pub(crate) fn value(self) -> u64 {
        let [mut value, velocities, accelerations] = self.0;
        mix(&mut value, velocities);
        mix(&mut value, accelerations);
        value
    }
}

fn mix(lane: &mut u64, bits: u64) {
    *lane = (lane.rotate_left(5) ^ bits).wrapping_mul(0x517c_c1b7_2722_0a95);
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
