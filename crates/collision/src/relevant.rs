//! The few balls that say most about a scene, for what cannot look at all of it.

use crate::clearance::Contact;
use crate::scene::{Ball, Scene};
use pcc_model::Backbone;

/// Clearances within which obstacles are looked for, in turn until there are enough, section lengths.
const MARGINS: [f64; 4] = [0.25, 0.5, 1.0, 1.5];
/// Radius of a ball that stands for the nearest part of a solid, section lengths.
const STAND_IN_RADIUS: f64 = 0.2;

impl Scene {
    /// At most `count` balls that stand for the scene as these shapes meet it, the nearest ones to any of them.
    ///
    /// All balls, in their order, where there are no more than that and no solids. Else the nearest obstacles within
    /// 1.5 section lengths of the tube, the nearest first; a solid by balls of radius 0.2 that touch its surface from inside,
    /// where it is nearest to a section.
    #[must_use]
    pub fn most_relevant(&self, shapes: &[Backbone], tube_radius: f64, count: usize) -> Vec<Ball> {
        if self.solids().is_empty() && self.balls().len() <= count {
            return self.balls().to_vec();
        }
        let unit = shapes.first().map_or(1.0, |shape| shape.section_length(0));
        let mut found = Vec::new();
        for margin in MARGINS {
            found = self.sightings(shapes, tube_radius, margin * unit, count);
            if found.len() == count {
                break;
            }
        }
        found.into_iter().map(|sighting| sighting.ball).collect()
    }

    /// At most `count` different obstacles within a margin of the tube, the nearest first.
    fn sightings(
        &self,
        shapes: &[Backbone],
        tube_radius: f64,
        margin: f64,
        count: usize,
    ) -> Vec<Sighting> {
        let (mut contacts, mut all) = (Vec::new(), Vec::new());
        for shape in shapes {
            contacts.clear();
            self.contacts_within(shape, tube_radius, margin, &mut contacts);
            all.extend(contacts.iter().map(|contact| self.sighting(shape, contact)));
        }
        all.sort_by(|a, b| a.clearance.total_cmp(&b.clearance));
        let mut different: Vec<Sighting> = Vec::new();
        for sighting in all {
            if different.len() == count {
                break;
            }
            if !different.iter().any(|known| known.stands_for(&sighting)) {
                different.push(sighting);
            }
        }
        different
    }

    fn sighting(&self, shape: &Backbone, contact: &Contact) -> Sighting {
        let of_solid = contact.obstacle.checked_sub(self.balls().len());
        let ball = of_solid.map_or_else(
            || self.balls()[contact.obstacle],
            |solid| {
                let unit = shape.section_length(0);
                let body = shape.point(contact.section, contact.fraction);
                let surface = self.solids()[solid].nearest(&body);
                let radius = STAND_IN_RADIUS * unit;
                Ball {
                    centre: surface.point - surface.away * radius,
                    radius,
                }
            },
        );
        Sighting {
            clearance: contact.clearance,
            obstacle: contact.obstacle,
            ball,
        }
    }
}

/// An obstacle, seen from a shape.
struct Sighting {
    clearance: f64,
    obstacle: usize,
    ball: Ball,
}

impl Sighting {
    /// Whether the other one tells nothing new: it is of the same obstacle, seen from nearly the same side.
    fn stands_for(&self, other: &Self) -> bool {
        let apart = (self.ball.centre - other.ball.centre).norm();
        self.obstacle == other.obstacle && apart < self.ball.radius
    }
}
