//! Balls side by side, so that the distances to several are found together.

use crate::distance::chosen_sections::Chosen;
use crate::obstacle::ball::Ball;
use fearless_simd::prelude::*;
use fearless_simd::{Level, dispatch, f64x4};
use pcc_model::{Backbone, LANES, SECTIONS};
use std::array;

/// The balls of a scene, in their order.
#[derive(Clone, Debug, Default)]
pub(crate) struct BallGroups(Vec<Group>);

#[derive(Clone, Copy, Debug)]
struct Group {
    /// Centres, base frame, `[axis][lane]`.
    centres: [[f64; LANES]; 3],
    /// −∞ where there is no ball, so that nothing is near it.
    radii: [f64; LANES],
}

impl Group {
    fn of(balls: &[Ball]) -> Self {
        let of_each = |value: &dyn Fn(&Ball) -> f64, without: f64| {
            array::from_fn(|lane| balls.get(lane).map_or(without, value))
        };
        Self {
            centres: array::from_fn(|axis| of_each(&|ball| ball.centre[axis], 0.0)),
            radii: of_each(&|ball| ball.radius, f64::NEG_INFINITY),
        }
    }

    /// Distances from a section's backbone to the surfaces of the balls; +∞ in lanes without a ball.
    #[inline(always)]
    fn distances<S: Simd>(&self, simd: S, backbone: &Backbone, section: usize) -> f64x4<S> {
        // Written out: a closure would not be compiled for the instructions that `simd` stands for.
        let [x, y, z] = &self.centres;
        let centres = [
            f64x4::from_slice(simd, x),
            f64x4::from_slice(simd, y),
            f64x4::from_slice(simd, z),
        ];
        backbone.distances(section, &centres) - f64x4::from_slice(simd, &self.radii)
    }
}

impl BallGroups {
    pub(crate) fn of(balls: &[Ball]) -> Self {
        Self(balls.chunks(LANES).map(Group::of).collect())
    }

    /// Distance from each chosen section's backbone to the nearest surface; +∞ for the others, and without balls.
    pub(crate) fn nearest(&self, backbone: &Backbone, chosen: &Chosen) -> [f64; SECTIONS] {
        dispatch!(Level::new(), simd => self.nearest_at(simd, backbone, chosen))
    }

    #[inline(always)]
    fn nearest_at<S: Simd>(
        &self,
        simd: S,
        backbone: &Backbone,
        chosen: &Chosen,
    ) -> [f64; SECTIONS] {
        let mut nearest = [f64::INFINITY; SECTIONS];
        for section in (0..SECTIONS).filter(|section| chosen[*section]) {
            let mut least = f64x4::splat(simd, f64::INFINITY);
            for group in &self.0 {
                least = least.min(group.distances(simd, backbone, section));
            }
            let least: [f64; LANES] = least.into();
            nearest[section] = least.into_iter().fold(f64::INFINITY, f64::min);
        }
        nearest
    }

    /// Calls `visit` with every section and the index of every ball whose surface is nearer to its backbone than its reach.
    pub(crate) fn for_each_within(
        &self,
        backbone: &Backbone,
        reaches: &[f64; SECTIONS],
        mut visit: impl FnMut(usize, usize),
    ) {
        dispatch!(Level::new(), simd => self.visit_at(simd, backbone, reaches, &mut visit));
    }

    #[inline(always)]
    fn visit_at<S: Simd>(
        &self,
        simd: S,
        backbone: &Backbone,
        reaches: &[f64; SECTIONS],
        visit: &mut impl FnMut(usize, usize),
    ) {
        for (section, &reach) in reaches.iter().enumerate() {
            for (index, group) in self.0.iter().enumerate() {
                let within = group.distances(simd, backbone, section).simd_lt(reach);
                let mut within = within.to_bitmask();
                while within != 0 {
                    visit(section, index * LANES + within.trailing_zeros() as usize);
                    within &= within - 1;
                }
            }
        }
    }
}
