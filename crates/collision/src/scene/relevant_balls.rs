//! The few balls that matter most to given backbones, for models that take only so many.

use crate::distance::arc_solid::arc_distance;
use crate::obstacle::ball::Ball;
use crate::obstacle::solid::Solid;
use crate::scene::static_scene::Scene;
use pcc_model::{Backbone, Point, SECTIONS};

/// Clearance within which solids count, section lengths.
const MARGIN: f64 = 1.0;
/// Places on each section that balls are measured from, fractions.
const PLACES: [f64; 3] = [1.0 / 6.0, 0.5, 5.0 / 6.0];
/// Radius of a ball that stands for the nearest part of a solid, section lengths.
const STAND_IN_RADIUS: f64 = 0.2;

impl Scene {
    /// At most `count` balls that stand for the scene as these backbones meet it.
    ///
    /// These are all balls, in their order, where there are at most `count` and no solids. Else they are the nearest obstacles, the
    /// nearest first: distances to balls are measured from three places of each section; a solid nearer than a section length to the tube counts as
    /// balls of radius 0.2 that touch its surface from inside, where it is nearest to a section.
    #[must_use]
    pub fn most_relevant(
        &self,
        backbones: &[Backbone],
        tube_radii: &[f64; SECTIONS],
        count: usize,
    ) -> Vec<Ball> {
        if self.solids().is_empty() && self.balls().len() <= count {
            return self.balls().to_vec();
        }
        let mut found = self.sighted_balls(backbones);
        found.extend(self.sighted_solids(backbones, tube_radii));
        found.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        found.truncate(count);
        found.into_iter().map(|sighting| sighting.ball).collect()
    }

    fn sighted_balls(&self, backbones: &[Backbone]) -> Vec<Sighting> {
        let places = |backbone| {
            (0..SECTIONS).flat_map(move |k| PLACES.map(|f| Backbone::point(backbone, k, f)))
        };
        let places: Vec<Point> = backbones.iter().flat_map(places).collect();
        let sighting = |ball: &Ball| {
            let squared = places
                .iter()
                .map(|place| (place - ball.centre).norm_squared());
            Sighting {
                distance: squared.fold(f64::INFINITY, f64::min).sqrt() - ball.radius,
                ball: *ball,
            }
        };
        self.balls().iter().map(sighting).collect()
    }

    /// Balls that stand for the nearest parts of each solid, the nearest first, none of them beside another.
    fn sighted_solids(
        &self,
        backbones: &[Backbone],
        tube_radii: &[f64; SECTIONS],
    ) -> Vec<Sighting> {
        let unit = backbones
            .first()
            .map_or(1.0, |backbone| backbone.section_length(0));
        let margin = MARGIN * unit;
        let mut different: Vec<Sighting> = Vec::new();
        for solid in self.solids() {
            let seen = backbones.iter().flat_map(|backbone| {
                let seen = move |k| stand_in(backbone, k, solid, tube_radii[k], margin);
                (0..SECTIONS).filter_map(seen)
            });
            let mut seen: Vec<Sighting> = seen.collect();
            seen.sort_by(|a, b| a.distance.total_cmp(&b.distance));
            let first = different.len();
            for sighting in seen {
                if !different[first..]
                    .iter()
                    .any(|known| known.is_beside(&sighting))
                {
                    different.push(sighting);
                }
            }
        }
        different
    }
}

/// The ball that stands for the part of a solid that is nearest to a section, if that is within `margin` of its tube.
fn stand_in(
    backbone: &Backbone,
    section: usize,
    solid: &Solid,
    tube_radius: f64,
    margin: f64,
) -> Option<Sighting> {
    let found = arc_distance(backbone, section, solid, tube_radius, tube_radius + margin)?;
    let surface = solid.nearest(&backbone.point(section, found.fraction));
    let radius = STAND_IN_RADIUS * backbone.section_length(0);
    let centre = surface.point - surface.away * radius;
    Some(Sighting {
        distance: found.bound,
        ball: Ball { centre, radius },
    })
}

/// A ball, and how far from the backbone its surface is.
struct Sighting {
    distance: f64,
    ball: Ball,
}

impl Sighting {
    /// Whether the other ball's centre lies within this one.
    fn is_beside(&self, other: &Self) -> bool {
        (self.ball.centre - other.ball.centre).norm() < self.ball.radius
    }
}
