//! Clearances of one configuration, and where it is nearest to the obstacles.

use crate::arc_search::{ArcDistance, arc_distance};
use crate::scene::{Ball, Scene};
use pcc_model::{Backbone, Point, SECTIONS};

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

/// Which sections are looked at.
pub(crate) type Chosen = [bool; SECTIONS];
/// All of them.
pub(crate) const EVERY_SECTION: Chosen = [true; SECTIONS];
/// None of them.
pub(crate) const NO_SECTION: Chosen = [false; SECTIONS];

impl Scene {
    /// Smallest clearance between the whole tube and all obstacles; +∞ in an empty scene.
    #[must_use]
    pub fn clearance(&self, backbone: &Backbone, tube_radii: &[f64; SECTIONS]) -> f64 {
        self.section_clearances(backbone, tube_radii)
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    }

    /// Smallest clearance between the tube of each section and all obstacles; allocates nothing.
    ///
    /// +∞ in an empty scene; −∞ for a backbone that is not finite, so that nothing takes it for a free one.
    #[must_use]
    pub fn section_clearances(
        &self,
        backbone: &Backbone,
        tube_radii: &[f64; SECTIONS],
    ) -> [f64; SECTIONS] {
        self.clearances_of(backbone, tube_radii, &EVERY_SECTION)
    }

    /// The same for the chosen sections alone; +∞ for the others.
    pub(crate) fn clearances_of(
        &self,
        backbone: &Backbone,
        tube_radii: &[f64; SECTIONS],
        chosen: &Chosen,
    ) -> [f64; SECTIONS] {
        if !backbone.tip().iter().all(|v| v.is_finite()) {
            return [f64::NEG_INFINITY; SECTIONS];
        }
        let clearance = |section: usize| {
            let of_balls = self
                .nearest_ball(backbone, section)
                .map_or(f64::INFINITY, |(_, distance)| distance);
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

    /// The nearest obstacle of all to the tube, if there is any.
    #[must_use]
    pub fn deepest(&self, backbone: &Backbone, tube_radii: &[f64; SECTIONS]) -> Option<Contact> {
        let least = (0..SECTIONS).filter_map(|section| {
            let ball = self.nearest_ball(backbone, section);
            let limit = ball.map_or(f64::INFINITY, |(_, distance)| distance);
            let tube_radius = tube_radii[section];
            self.nearest_solid(backbone, section, tube_radius, limit)
                .map(|(solid, found)| {
                    self.solid_contact(backbone, tube_radius, section, solid, found)
                })
                .or_else(|| {
                    ball.map(|(ball, _)| self.contact(backbone, tube_radius, section, ball))
                })
        });
        least.min_by(|a, b| a.clearance.total_cmp(&b.clearance))
    }

    /// Appends, for every obstacle nearer than `margin` to the tube, its nearest body point, for solids one in each section
    /// that is so near; allocates only to grow `out`.
    pub fn contacts_within(
        &self,
        backbone: &Backbone,
        tube_radii: &[f64; SECTIONS],
        margin: f64,
        out: &mut Vec<Contact>,
    ) {
        let first = out.len();
        for (section, &tube_radius) in tube_radii.iter().enumerate() {
            let reach = tube_radius + margin;
            let visit = |index: usize, ball: &Ball| {
                if surface_distance(backbone, section, ball) < reach {
                    let contact = self.contact(backbone, tube_radius, section, index);
                    keep_nearest(out, first, contact);
                }
            };
            if self.has_many_balls() {
                let (places, around) = four_places(backbone, section);
                self.for_each_near(&places, around + reach, visit);
            } else {
                let (place, around) = one_place(backbone, section);
                self.for_each_near(&place, around + reach, visit);
            }
        }
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

    /// Index of the ball nearest to a section, and the distance from the backbone to its surface.
    fn nearest_ball(&self, backbone: &Backbone, section: usize) -> Option<(usize, f64)> {
        let cost = |ball: &Ball| surface_distance(backbone, section, ball);
        if self.has_many_balls() {
            let (places, around) = four_places(backbone, section);
            self.least(&places, around, cost)
        } else {
            let (place, around) = one_place(backbone, section);
            self.least(&place, around, cost)
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

/// Four places on a section and how far from the nearest of them its points are at most.
fn four_places(backbone: &Backbone, section: usize) -> ([Point; 4], f64) {
    let places = [0.125, 0.375, 0.625, 0.875].map(|f| backbone.point(section, f));
    (places, 0.125 * backbone.section_length(section))
}

/// The middle of a section and how far from it its points are at most.
fn one_place(backbone: &Backbone, section: usize) -> ([Point; 1], f64) {
    let half_length = 0.5 * backbone.section_length(section);
    ([backbone.middle(section)], half_length)
}

fn surface_distance(backbone: &Backbone, section: usize, ball: &Ball) -> f64 {
    backbone.distance(section, &ball.centre) - ball.radius
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
