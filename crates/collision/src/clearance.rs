//! Exact clearances of one configuration.

use crate::scene::{Ball, Scene};
use pcc_model::{Backbone, Point, SECTIONS};

/// In large scenes clearances are searched for within these distances, one after the other.
const REACHES: [f64; 3] = [0.5, 2.0, f64::MAX];

/// The body point nearest to one ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Signed distance between the tube and the ball's surface.
    pub clearance: f64,
    /// Section of the body point, 0 to 2.
    pub section: usize,
    /// Fraction of the section, 0 to 1.
    pub fraction: f64,
    /// Index of the ball.
    pub ball: usize,
    /// Unit vector from the ball's centre to the body point, base frame.
    pub normal: Point,
}

/// A ball around a section's backbone: every point of an arc is within half its length of its middle.
struct Bounds {
    middle: Point,
    half_length: f64,
}

impl Bounds {
    fn of(backbone: &Backbone, section: usize) -> Self {
        Self {
            middle: backbone.point(section, 0.5),
            half_length: 0.5 * backbone.section_length(section),
        }
    }

    /// A lower bound of the distance between the section and the ball's surface.
    fn gap(&self, ball: &Ball) -> f64 {
        (ball.centre - self.middle).norm() - self.half_length - ball.radius
    }
}

impl Scene {
    /// Smallest clearance between the whole tube and all balls; infinite in an empty scene.
    #[must_use]
    pub fn clearance(&self, backbone: &Backbone, tube_radius: f64) -> f64 {
        self.section_clearances(backbone, tube_radius)
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    }

    /// Smallest clearance between the tube of each section and all balls.
    #[must_use]
    pub fn section_clearances(&self, backbone: &Backbone, tube_radius: f64) -> [f64; SECTIONS] {
        if self.is_empty() {
            return [f64::INFINITY; SECTIONS];
        }
        std::array::from_fn(|section| self.section_distance(backbone, section) - tube_radius)
    }

    /// Distance between a section's backbone and the nearest surface.
    fn section_distance(&self, backbone: &Backbone, section: usize) -> f64 {
        let bounds = Bounds::of(backbone, section);
        let mut nearest = f64::INFINITY;
        for reach in REACHES {
            self.for_each_near(&bounds.middle, bounds.half_length + reach, |_, ball| {
                if bounds.gap(ball) < nearest {
                    nearest = nearest.min(backbone.distance(section, &ball.centre) - ball.radius);
                }
            });
            if nearest <= reach || !self.is_large() {
                break;
            }
        }
        nearest
    }

    /// Appends, for every ball nearer than `margin` to the tube, the nearest body point. Allocates only to grow `out`.
    pub fn contacts_within(
        &self,
        backbone: &Backbone,
        tube_radius: f64,
        margin: f64,
        out: &mut Vec<Contact>,
    ) {
        let first = out.len();
        let reach = tube_radius + margin;
        for section in 0..SECTIONS {
            let bounds = Bounds::of(backbone, section);
            self.for_each_near(&bounds.middle, bounds.half_length + reach, |index, ball| {
                if bounds.gap(ball) < reach
                    && let Some(contact) =
                        contact(backbone, section, tube_radius, index, ball, margin)
                    && let Some(new) = keep_nearest(&mut out[first..], contact)
                {
                    out.push(new);
                }
            });
        }
    }

    /// The deepest contact, if any ball is there at all.
    #[must_use]
    pub fn deepest(&self, backbone: &Backbone, tube_radius: f64) -> Option<Contact> {
        let all = (0..SECTIONS)
            .flat_map(|s| self.balls().iter().enumerate().map(move |(i, b)| (s, i, b)));
        all.filter_map(|(s, i, b)| contact(backbone, s, tube_radius, i, b, f64::INFINITY))
            .min_by(|a, b| a.clearance.total_cmp(&b.clearance))
    }
}

/// Replaces the contact of the same ball if the new one is nearer; gives the new one back if its ball is new.
fn keep_nearest(contacts: &mut [Contact], new: Contact) -> Option<Contact> {
    match contacts.iter_mut().find(|c| c.ball == new.ball) {
        Some(known) => {
            if new.clearance < known.clearance {
                *known = new;
            }
            None
        }
        None => Some(new),
    }
}

fn contact(
    backbone: &Backbone,
    section: usize,
    tube_radius: f64,
    index: usize,
    ball: &Ball,
    margin: f64,
) -> Option<Contact> {
    if backbone.distance(section, &ball.centre) - ball.radius - tube_radius >= margin {
        return None;
    }
    let nearest = backbone.nearest(section, &ball.centre);
    let away = nearest.point - ball.centre;
    let normal = away.try_normalize(1e-12).unwrap_or_else(Point::x);
    Some(Contact {
        clearance: nearest.distance - ball.radius - tube_radius,
        section,
        fraction: nearest.fraction,
        ball: index,
        normal,
    })
}
