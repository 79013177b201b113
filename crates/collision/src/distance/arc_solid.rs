//! The distance between a section's arc and a solid, by branch and bound along the arc.

use crate::distance::passage::Passage;
use crate::obstacle::solid::Solid;
use pcc_model::Backbone;

/// How far a distance may be below the true one, as a part of the section's length; [`RELATIVE_TOLERANCE`] comes in addition.
const TOLERANCE: f64 = 1e-3;
/// How far a distance may be below the true one, as a part of the clearance beyond the tube.
const RELATIVE_TOLERANCE: f64 = 0.05;

/// A bound of the distance between a section and a solid, and where the two are nearest.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ArcDistance {
    /// A lower bound of the distance; at most the tolerance below it unless it is beyond the limit.
    pub(crate) bound: f64,
    /// Where on the section the nearest point found is, 0 at its base to 1 at its end.
    pub(crate) fraction: f64,
}

/// The distance from a section's backbone to a solid; none if it is `limit` or more.
///
/// The signed distance changes by at most the length passed along the arc, and an arc strays from its chord by at most an
/// eighth of curvature times length squared, so the bounds of whole motions hold along the backbone too.
pub(crate) fn arc_distance(
    backbone: &Backbone,
    section: usize,
    solid: &Solid,
    tube_radius: f64,
    limit: f64,
) -> Option<ArcDistance> {
    let length = backbone.section_length(section);
    if solid.least_distance(&backbone.middle(section)) - 0.5 * length >= limit {
        return None;
    }
    let mut search = Search {
        backbone,
        section,
        solid,
        length,
        stray: 0.125 * length * backbone.bending_angle(section),
        tube_radius,
        limit,
        attained: f64::INFINITY,
        fraction: 0.0,
        bound: f64::INFINITY,
    };
    let [from, middle, to] = [0.0, 0.5, 1.0].map(|fraction| search.look(fraction));
    search.refine(from, middle);
    search.refine(middle, to);
    let bound = search.bound.min(search.attained);
    (bound < limit).then_some(ArcDistance {
        bound,
        fraction: search.fraction,
    })
}

struct Search<'a> {
    backbone: &'a Backbone,
    section: usize,
    solid: &'a Solid,
    length: f64,
    /// How far the whole arc strays from its chord at most.
    stray: f64,
    tube_radius: f64,
    limit: f64,
    attained: f64,
    fraction: f64,
    /// Lower bound of the distance over all intervals that were not refined further.
    bound: f64,
}

/// A place on the arc and its distance.
type Place = (f64, f64);

impl Search<'_> {
    fn look(&mut self, fraction: f64) -> Place {
        let point = self.backbone.point(self.section, fraction);
        let distance = self.solid.nearest(&point).distance;
        if distance < self.attained {
            (self.attained, self.fraction) = (distance, fraction);
        }
        (fraction, distance)
    }

    fn refine(&mut self, from: Place, to: Place) {
        let part = to.0 - from.0;
        let passage = Passage {
            path_length: part * self.length,
            chord: part * self.length,
            stray: part * part * self.stray,
            reach: 0.0,
        };
        let lowest = passage.lowest(from.1, to.1);
        // False also where the bound is NaN.
        let is_open = lowest < (self.attained - self.tolerance()).min(self.limit);
        if !is_open {
            self.bound = self.bound.min(lowest);
            return;
        }
        let middle = self.look(0.5 * (from.0 + to.0));
        self.refine(from, middle);
        self.refine(middle, to);
    }

    fn tolerance(&self) -> f64 {
        let beyond = (self.attained - self.tube_radius).max(0.0);
        TOLERANCE * self.length + RELATIVE_TOLERANCE * beyond
    }
}
