//! The hash by which equal motions are known.

use pcc_model::{BitHash, DOF};

use super::knot::Knot;

/// Hash of knots by their bits, one after the other. Each axis has a lane, since each step waits for the one before it in its lane; then the
/// lanes are hashed.
pub(super) fn knot_hash(knots: &[Knot]) -> u64 {
    let mut lanes = [BitHash::new(); DOF];
    for knot in knots {
        lanes[0].add(knot.time.to_bits());
        for (axis, lane) in lanes.iter_mut().enumerate() {
            lane.add(knot.position[axis].to_bits());
            lane.add(knot.velocity[axis].to_bits());
            lane.add(knot.acceleration[axis].to_bits());
        }
    }
    let mut all = BitHash::new();
    lanes.iter().for_each(|lane| all.add(lane.value()));
    all.value()
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcc_model::Configuration;

    #[test]
    fn the_hash_sees_every_bit_and_the_order() {
        let last = Knot::resting(2.0, Configuration::repeat(0.25));
        let mut other = last;
        other.acceleration[5] = f64::from_bits(1);
        assert_eq!(knot_hash(&[last, other]), knot_hash(&[last, other]));
        assert_ne!(knot_hash(&[last, other]), knot_hash(&[other, last]));
        assert_ne!(knot_hash(&[last]), knot_hash(&[other]));
        assert_ne!(knot_hash(&[last]), knot_hash(&[last, last]));
        let exchanged = Knot {
            velocity: other.acceleration,
            acceleration: other.velocity,
            ..other
        };
        assert_ne!(knot_hash(&[other]), knot_hash(&[exchanged]));
        let mirrored = Knot {
            position: -last.position,
            ..last
        };
        assert_ne!(knot_hash(&[last]), knot_hash(&[mirrored]));
        let mut turned = last;
        turned.position.swap_rows(0, 1);
        turned.position[0] += 0.5;
        assert_ne!(knot_hash(&[last]), knot_hash(&[turned]));
    }
}
