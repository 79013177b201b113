//! The exact nearest point of a circular arc (ROBOT "Exact geometry of a section").

use nalgebra::Vector3;

/// The point of a section nearest to a given one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Distance to it.
    pub distance: f64,
    /// Where along the section, 0 at its base to 1 at its end.
    pub fraction: f64,
    /// The point itself, base frame.
    pub point: Vector3<f64>,
}

/// Distance from a point to the circle that the arc lies on, in the section's base frame; no cancellation at κ = 0.
///
/// `along` is the coordinate in the bending direction, `out` the one out of the plane, `z` along the base tangent.
pub(crate) fn distance_to_circle(curvature: f64, along: f64, out: f64, z: f64) -> f64 {
    let radial = (curvature * along - 1.0).hypot(curvature * z) + 1.0;
    let in_plane = (curvature * (along * along + z * z) - 2.0 * along) / radial;
    in_plane.hypot(out)
}

/// Arc length from the base to the foot point on the circle: atan2(κz, 1 − κa)/κ, z at κ = 0.
pub(crate) fn foot_arc_length(curvature: f64, along: f64, z: f64) -> f64 {
    let tangent = 1.0 - curvature * along;
    if (curvature * z).abs() < 1e-4 * tangent.abs() {
        let t = curvature * z / tangent;
        return z / tangent * (1.0 - t * t / 3.0);
    }
    (curvature * z).atan2(tangent) / curvature
}
