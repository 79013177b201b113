//! Many balls, behind a bounding-volume tree.

use crate::distance::chosen_sections::Chosen;
use crate::obstacle::ball::Ball;
use glam::DVec3;
use parry3d_f64::bounding_volume::{Aabb, BoundingVolume};
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy};
use pcc_model::{Backbone, Point, SECTIONS};

/// Places on a section that balls are measured from first, fractions.
const PLACES: [f64; 4] = [0.125, 0.375, 0.625, 0.875];
/// How far from the nearest of [`PLACES`] a section's points are at most, fraction.
const AROUND: f64 = 0.125;

/// A bounding-volume tree over a list of balls, which its methods are given again.
#[derive(Clone, Debug)]
pub(crate) struct BallTree {
    largest_radius: f64,
    tree: Bvh,
}

impl BallTree {
    pub(crate) fn of(balls: &[Ball]) -> Self {
        let boxes: Vec<Aabb> = balls.iter().map(cube).collect();
        Self {
            largest_radius: balls.iter().map(|ball| ball.radius).fold(0.0, f64::max),
            tree: Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes),
        }
    }

    /// Distance from each chosen section's backbone to the nearest surface; +∞ for the others.
    pub(crate) fn nearest(
        &self,
        balls: &[Ball],
        backbone: &Backbone,
        chosen: &Chosen,
    ) -> [f64; SECTIONS] {
        std::array::from_fn(|section| {
            if chosen[section] {
                self.nearest_to(balls, backbone, section)
            } else {
                f64::INFINITY
            }
        })
    }

    fn nearest_to(&self, balls: &[Ball], backbone: &Backbone, section: usize) -> f64 {
        let (places, around) = places(backbone, section);
        let deepest = -self.largest_radius;
        let node_cost = |gap: f64| if gap > 0.0 { gap } else { deepest } - around;
        let nearest = self.tree.find_best(
            f64::MAX,
            |node, _| node_cost(gap_to_box(&places, &node.aabb())),
            |i, best| {
                let ball = &balls[i as usize];
                is_within(ball, &places, best + around)
                    .then(|| surface_distance(backbone, section, ball))
            },
        );
        nearest.map_or(f64::INFINITY, |(_, distance)| distance)
    }

    /// Calls `visit` with every section and the index of every ball whose surface is nearer to its backbone than its reach.
    pub(crate) fn for_each_within(
        &self,
        balls: &[Ball],
        backbone: &Backbone,
        reaches: &[f64; SECTIONS],
        mut visit: impl FnMut(usize, usize),
    ) {
        for (section, &reach) in reaches.iter().enumerate() {
            let (places, around) = places(backbone, section);
            let corners = places.iter().map(|place| DVec3::from(*place));
            let aabb = Aabb::from_points(corners).loosened((around + reach).max(0.0));
            for index in self.tree.intersect_aabb(&aabb).map(|index| index as usize) {
                let ball = &balls[index];
                let is_near = is_within(ball, &places, around + reach);
                if is_near && surface_distance(backbone, section, ball) < reach {
                    visit(section, index);
                }
            }
        }
    }
}

fn places(backbone: &Backbone, section: usize) -> ([Point; PLACES.len()], f64) {
    let places = PLACES.map(|fraction| backbone.point(section, fraction));
    (places, AROUND * backbone.section_length(section))
}

fn surface_distance(backbone: &Backbone, section: usize, ball: &Ball) -> f64 {
    backbone.distance(section, &ball.centre) - ball.radius
}

/// Whether a ball's surface is nearer than `reach` to one of the places; without a square root.
fn is_within(ball: &Ball, places: &[Point], reach: f64) -> bool {
    let limit = reach + ball.radius;
    let is_near = |place: &Point| (ball.centre - place).norm_squared() < limit * limit;
    limit > 0.0 && places.iter().any(is_near)
}

fn gap_to_box(places: &[Point], aabb: &Aabb) -> f64 {
    let gap = |place: &Point| {
        let from = DVec3::from(*place);
        (from.clamp(aabb.mins, aabb.maxs) - from).length_squared()
    };
    places.iter().map(gap).fold(f64::INFINITY, f64::min).sqrt()
}

fn cube(ball: &Ball) -> Aabb {
    let (centre, half) = (DVec3::from(ball.centre), DVec3::splat(ball.radius));
    Aabb::new(centre - half, centre + half)
}
