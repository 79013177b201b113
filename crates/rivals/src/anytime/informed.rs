//! Where the tip may be on a path that is shorter than the shortest one known (Gammell, Srinivasa and Barfoot, 2014).

use nalgebra::{Rotation3, Vector3};
use pcc_model::Point;
use rand::RngExt;
use rand_pcg::Pcg64;

/// A random position, uniform in the spheroid of all through which a path between two positions may be no longer than this, section lengths.
pub(super) fn position(ends: [Point; 2], longest: f64, rng: &mut Pcg64) -> Point {
    let way = ends[1] - ends[0];
    let least = way.norm();
    let beside = 0.5 * (longest * longest - least * least).max(0.0).sqrt();
    let within = in_ball(rng).component_mul(&Vector3::new(0.5 * longest, beside, beside));
    let along = Rotation3::rotation_between(&Vector3::x(), &way);
    // Opposite to the first axis, or no way at all: the spheroid is its own mirror image, or a ball.
    let turned = along.map_or(within, |along| along * within);
    0.5 * (ends[0] + ends[1]) + turned
}

/// A random position, uniform in the unit ball.
fn in_ball(rng: &mut Pcg64) -> Vector3<f64> {
    loop {
        let drawn = Vector3::from_fn(|_, _| rng.random_range(-1.0..=1.0));
        if drawn.norm() <= 1.0 {
            return drawn;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn paths_through_what_is_drawn_are_short_enough_and_all_of_the_spheroid_is_drawn() {
        let mut rng = Pcg64::seed_from_u64(1);
        let ends = [Point::new(1.0, -0.5, 2.0), Point::new(-0.3, 0.4, 1.5)];
        for (ends, longest) in [(ends, 2.0), ([ends[1], ends[0]], 1.8), ([ends[0]; 2], 0.4)] {
            let lengths: Vec<f64> = (0..2000)
                .map(|_| position(ends, longest, &mut rng))
                .map(|it| (it - ends[0]).norm() + (ends[1] - it).norm())
                .collect();
            assert!(lengths.iter().all(|it| *it <= longest + 1e-12));
            assert!(lengths.iter().any(|it| *it > 0.98 * longest));
        }
        let opposite = [Point::new(1.0, 0.0, 0.0), Point::new(-1.0, 0.0, 0.0)];
        let drawn = position(opposite, 2.5, &mut rng);
        assert!((drawn - opposite[0]).norm() + (drawn - opposite[1]).norm() <= 2.5 + 1e-12);
    }
}
