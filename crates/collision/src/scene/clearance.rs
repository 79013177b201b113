//! Clearances of one configuration, and where it is nearest to the obstacles.

use crate::distance::arc_solid::{ArcDistance, arc_distance};
use crate::distance::chosen_sections::{Chosen, EVERY_SECTION};
use crate::scene::static_scene::Scene;
use pcc_model::{Backbone, Configuration, Point, Robot, SECTIONS};

/// The body point nearest to one obstacle; of a solid, one in each section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Signed distance between the tube and the obstacle's surface.
    pub clearance: f64,
    /// Section of the body point, 0 to 2.
    pub section: usize,
    /// Fraction of the section, 0 to 1.
    pub fraction: f64,
    /// Index of the obstacle: the balls in their order, then the solids.
    pub obstacle: usize,
    /// Unit vector to the body point from the ball's centre or the solid's nearest surface point (inside: the other way),
    /// base frame; any where the two coincide.
    pub normal: Point,
}

impl Scene {
    /// Smallest clearance between the whole tube and all obstacles; +∞ in an empty scene.
    #[must_use]
    pub fn clearance(&self, backbone: &Backbone, tube_radii: &[f64; SECTIONS]) -> f64 {
        self.section_clearances(backbone, tube_radii)
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    }

    /// Smallest clearance between the tube of a robot in this configuration (rad) and all obstacles; +∞ in an empty scene.
    #[must_use]
    pub fn clearance_at(&self, robot: &Robot, configuration: &Configuration) -> f64 {
        self.clearance(&robot.backbone(configuration), &robot.tube_radii)
    }

    /// Smallest clearance between the tube of each section and all obstacles; allocates nothing.
    ///
    /// +∞ in an empty scene; −∞ for a backbone that is not finite, so that it never counts as free.
    #[must_use]
    pub fn section_clearances(
        &self,
        backbone: &Backbone,
        tube_radii: &[f64; SECTIONS],
    ) -> [f64; SECTIONS] {
        self.clearances_of(backbone, tube_radii, &EVERY_SECTION)
    }

    /// Smallest clearance between the tube of each chosen section and all obstacles; +∞ for the others, −∞ for a backbone that is
    /// not finite.
    pub(crate) fn clearances_of(
        &self,
        backbone: &Backbone,
        tube_radii: &[f64; SECTIONS],
        chosen: &Chosen,
    ) -> [f64; SECTIONS] {
        if !backbone.tip().iter().all(|v| v.is_finite()) {
            return [f64::NEG_INFINITY; SECTIONS];
        }
        let balls = self.nearest_balls(backbone, chosen);
        let clearance = |section: usize| {
            let of_balls = balls[section];
            let tube_radius = tube_radii[section];
            let nearest = self.nearest_solid(backbone, section, tube_radius, of_balls);
            nearest.map_or(of_balls, |(_, distance)| distance.bound) - tube_radius
        };
        std::array::from_fn(|k| {
            if chosen[k] {
                clearance(k)
            } else {
                f64::INFINITY
            }
        })
    }

    /// Appends to `out`, for every ball nearer than `margin` to the tube, its nearest body point, and for every solid one in each
    /// section that is so near; allocates only to grow `out`.
    pub fn contacts_within(
        &self,
        backbone: &Backbone,
        tube_radii: &[f64; SECTIONS],
        margin: f64,
        out: &mut Vec<Contact>,
    ) {
        let first = out.len();
        let reaches = tube_radii.map(|tube_radius| tube_radius + margin);
        self.for_each_ball_within(backbone, &reaches, |section, index| {
            let contact = self.contact(backbone, tube_radii[section], section, index);
            keep_nearest(out, first, contact);
        });
        for (section, &tube_radius) in tube_radii.iter().enumerate() {
            let reach = tube_radius + margin;
            for (index, solid) in self.solids().iter().enumerate() {
                if let Some(found) = arc_distance(backbone, section, solid, tube_radius, reach) {
                    out.push(self.solid_contact(backbone, tube_radius, section, index, found));
                }
            }
        }
    }

    /// Index of the solid nearest to a section, if one is nearer than `limit`.
    fn nearest_solid(
        &self,
        backbone: &Backbone,
        section: usize,
        tube_radius: f64,
        mut limit: f64,
    ) -> Option<(usize, ArcDistance)> {
        let mut nearest = None;
        for (index, solid) in self.solids().iter().enumerate() {
            if let Some(found) = arc_distance(backbone, section, solid, tube_radius, limit) {
                limit = found.bound;
                nearest = Some((index, found));
            }
        }
        nearest
    }

    fn solid_contact(
        &self,
        backbone: &Backbone,
        tube_radius: f64,
        section: usize,
        index: usize,
        found: ArcDistance,
    ) -> Contact {
        let surface = self.solids()[index].nearest(&backbone.point(section, found.fraction));
        Contact {
            clearance: found.bound - tube_radius,
            section,
            fraction: found.fraction,
            obstacle: self.balls().len() + index,
            normal: surface.away,
        }
    }

    fn contact(
        &self,
        backbone: &Backbone,
        tube_radius: f64,
        section: usize,
        index: usize,
    ) -> Contact {
        let ball = &self.balls()[index];
        let nearest = backbone.nearest(section, &ball.centre);
        let away = nearest.point - ball.centre;
        Contact {
            clearance: nearest.distance - ball.radius - tube_radius,
            section,
            fraction: nearest.fraction,
            obstacle: index,
            normal: away.try_normalize(1e-12).unwrap_or_else(Point::x),
        }
    }
}

/// Adds a contact, or replaces that of the same ball among those from `first` on if the new one is nearer.
fn keep_nearest(contacts: &mut Vec<Contact>, first: usize, new: Contact) {
    match contacts[first..]
        .iter_mut()
        .find(|c| c.obstacle == new.obstacle)
    {
        Some(known) if new.clearance < known.clearance => *known = new,
        Some(_) => {}
        None => contacts.push(new),
    }
}
