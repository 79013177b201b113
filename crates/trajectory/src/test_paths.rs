//! The unit robot's tendons and seeded paths, for the tests and figures of this crate.

use pcc_model::{Configuration, Tendon, TendonLimits, TendonMap};
use rand::RngExt;
use rand_pcg::Pcg64;

/// The unit robot's tendons: three each for sections 1, 3 and 2, turned by 0°, 80° and 40°.
pub(crate) fn unit_tendons() -> TendonMap {
    let offsets = [(1, 0.0), (3, 80.0f64), (2, 40.0)];
    let tendon = |section, degrees: f64| Tendon {
        section,
        radius: 0.1636,
        angle: degrees.to_radians(),
    };
    let group = |(section, offset): (usize, f64)| {
        [0.0, 120.0, 240.0].map(|turn| tendon(section, offset + turn))
    };
    TendonMap::new(offsets.into_iter().flat_map(group).collect())
        .expect("the unit robot's tendons are valid")
}

/// The unit robot's tendon limits.
pub(crate) fn unit_limits() -> TendonLimits {
    TendonLimits {
        velocity: 0.0779,
        acceleration: 0.390,
        jerk: 3.9,
    }
}

/// `count` points of a straight line with four sine waves on it: smooth, of the size of a real motion.
pub(crate) fn smooth_path(random: &mut Pcg64, count: usize) -> Vec<Configuration> {
    let mut vector = || Configuration::from_fn(|_, _| random.random_range(-1.0..1.0));
    let (start, end) = (vector(), vector());
    let waves: Vec<_> = (1..=4)
        .map(|k| (f64::from(k), vector() * (0.5 / f64::from(k * k))))
        .collect();
    let point = |u: f64| {
        let straight = start + (end - start) * u;
        waves.iter().fold(straight, |sum, (k, wave)| {
            sum + wave * (std::f64::consts::PI * u * k).sin()
        })
    };
    (0..count)
        .map(|i| point(i as f64 / (count - 1) as f64))
        .collect()
}

/// `count` points with a random corner at each, as a sampling planner leaves them.
pub(crate) fn cornered_path(random: &mut Pcg64, count: usize) -> Vec<Configuration> {
    (0..count)
        .map(|_| Configuration::from_fn(|_, _| random.random_range(-0.8..0.8)))
        .collect()
}
