//! Knots on the wire.

use shared_types::message::Knot;

/// Knots as they travel: seconds and radians in the same order, so that nothing is converted.
pub(crate) fn to_wire(knots: &[trajectory::Knot]) -> &[Knot] {
    bytemuck::cast_slice(knots)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pcc_model::Configuration;

    #[test]
    fn each_number_travels_in_its_own_field() {
        let of = |first: f64| Configuration::from_fn(|index, _| first + index as f64);
        let knots = [0.0, 100.0].map(|first| trajectory::Knot {
            time: first,
            position: of(first + 1.0),
            velocity: of(first + 11.0),
            acceleration: of(first + 21.0),
        });
        let expected = knots.map(|knot| Knot {
            time_s: knot.time,
            configuration_rad: knot.position.into(),
            velocity_rad_s: knot.velocity.into(),
            acceleration_rad_s2: knot.acceleration.into(),
        });
        assert_eq!(to_wire(&knots), expected);
    }
}
