//! The sum by which an answer is known, for which all of it is read.

use shared_types::message::Knot;

/// Reads every number.
pub(super) fn checksum(knots: &[Knot]) -> u64 {
    let numbers = |knot: &Knot| {
        let of_knot = [
            knot.configuration_rad,
            knot.velocity_rad_s,
            knot.acceleration_rad_s2,
        ];
        let bits = of_knot.iter().flatten().map(|it| it.to_bits());
        bits.fold(knot.time_s.to_bits(), u64::wrapping_add)
    };
    knots.iter().map(numbers).fold(0, u64::wrapping_add)
}
