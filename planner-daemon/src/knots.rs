//! Knots on the wire.

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
