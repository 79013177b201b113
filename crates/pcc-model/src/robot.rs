//! The robot: lengths, limits, tendons.

use crate::tendons::{Tendon, TendonMap};
use crate::tips::{MovingTips, tips_of};
use crate::{Backbone, BitHash, Configuration, DOF, Point, SECTIONS};
use fearless_simd::f64x4;
use fearless_simd::prelude::*;

/// Limits of every tendon's motion, in the length unit of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TendonLimits {
    /// Speed, length/s.
    pub velocity: f64,
    /// Acceleration, length/s².
    pub acceleration: f64,
    /// Jerk, length/s³.
    pub jerk: f64,
}

impl TendonLimits {
    /// These limits, each multiplied by `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            velocity: self.velocity * factor,
            acceleration: self.acceleration * factor,
            jerk: self.jerk * factor,
        }
    }
}

/// A three-section robot.
#[derive(Clone, Debug, PartialEq)]
pub struct Robot {
    /// The robot's name.
    pub name: String,
    /// Arc length L_i of each section, in the robot's length unit: metres or section lengths.
    pub section_lengths: [f64; SECTIONS],
    /// Largest bending angle θ of a section, rad.
    pub bending_limit: f64,
    /// Radius of each section's body around its backbone, in the robot's length unit.
    pub tube_radii: [f64; SECTIONS],
    /// Radius of the motors' spools, in the robot's length unit.
    pub spool_radius: f64,
    /// The tendons, and the map from configurations to their lengths.
    pub tendons: TendonMap,
    /// Limits of the tendons' motion.
    pub tendon_limits: TendonLimits,
}

impl Robot {
    /// A number that is equal for equal robots in the same unit of length, name included, and never 0: processes that are set up for
    /// different robot files know each other by it.
    #[must_use]
    pub fn hash(&self) -> u64 {
        let Self {
            name,
            section_lengths,
            bending_limit,
            tube_radii,
            spool_radius,
            tendons,
            tendon_limits,
        } = self;
        let TendonLimits {
            velocity,
            acceleration,
            jerk,
        } = *tendon_limits;
        let of_tendon = |it: &Tendon| [it.section as f64, it.radius, it.angle];
        let numbers = [*bending_limit, *spool_radius, velocity, acceleration, jerk]
            .into_iter()
            .chain(*section_lengths)
            .chain(*tube_radii)
            .chain(tendons.tendons().iter().flat_map(of_tendon));
        let mut hash = BitHash::new();
        name.bytes().for_each(|byte| hash.add(byte.into()));
        numbers.for_each(|number| hash.add(number.to_bits()));
        hash.value().max(1)
    }

    /// The backbone of a configuration.
    #[must_use]
    pub fn backbone(&self, configuration: &Configuration) -> Backbone {
        Backbone::new(&self.section_lengths, configuration)
    }

    /// Position of the tip of a configuration, base frame, in the robot's length unit.
    #[must_use]
    pub fn tip(&self, configuration: &Configuration) -> Point {
        Backbone::tip_of(&self.section_lengths, configuration)
    }

    /// Positions of the tips of many configurations, base frame, in the robot's length unit; cheaper together than one by one.
    #[must_use]
    pub fn tips(&self, configurations: &[Configuration]) -> Vec<Point> {
        tips_of(&self.section_lengths, configurations)
    }

    /// Tips and tip Jacobians of four configurations (`[row][lane]`, radians), base frame, in the robot's length unit; to be
    /// called within [`fearless_simd::dispatch`], so that it is compiled for its vector instructions.
    #[must_use]
    #[inline(always)]
    pub fn moving_tips<S: Simd>(&self, configurations: &[f64x4<S>; DOF]) -> MovingTips<S> {
        MovingTips::of(&self.section_lengths, configurations)
    }

    /// The length of each section, if all three are equally long (to 1e-9 of it).
    #[must_use]
    pub fn equal_section_length(&self) -> Option<f64> {
        let first = self.section_lengths[0];
        let equal = |l: &f64| (l - first).abs() <= 1e-9 * first;
        self.section_lengths.iter().all(equal).then_some(first)
    }

    /// This robot with every length multiplied by `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let scale = |t: &Tendon| Tendon {
            radius: t.radius * factor,
            ..*t
        };
        let tendons = TendonMap::new(self.tendons.tendons().iter().map(scale).collect());
        Self {
            name: self.name.clone(),
            section_lengths: self.section_lengths.map(|l| l * factor),
            bending_limit: self.bending_limit,
            tube_radii: self.tube_radii.map(|radius| radius * factor),
            spool_radius: self.spool_radius * factor,
            tendons: tendons.expect("a map that was valid stays valid when scaled"),
            tendon_limits: self.tendon_limits.scaled(factor),
        }
    }

    /// Radius of the thickest section's body.
    #[must_use]
    pub fn largest_tube_radius(&self) -> f64 {
        self.tube_radii.into_iter().fold(0.0, f64::max)
    }

    /// This robot with the radius of each section's body larger by its padding.
    #[must_use]
    pub fn with_tube_padding(&self, padding: &[f64; SECTIONS]) -> Self {
        Self {
            tube_radii: std::array::from_fn(|k| self.tube_radii[k] + padding[k]),
            ..self.clone()
        }
    }
}
