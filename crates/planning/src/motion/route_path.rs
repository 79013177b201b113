//! The path of a route: legs from one via configuration to the next, and a smooth curve through all of them.

use crate::path::waypoints::Waypoints;
use crate::plan::Passage;
use pcc_model::Configuration;
use trajectory::Trajectory;

/// Distance of the nodes that keep the curve on a leg, rad.
const SPACING_RAD: f64 = 0.15;
/// A leg shorter than this goes nowhere, rad.
const STILL_RAD: f64 = 1e-6;
/// Samples of a motion for each leg, by which the time is found at which it passes a via.
const SAMPLES_OF_A_LEG: usize = 96;
/// Part of the shorter leg beside a via within which a motion is looked for the place nearest to it.
const NEAR: f64 = 0.45;
/// Halvings of the time in which a motion passes a via.
const HALVINGS: usize = 40;

/// The nodes of a curve along legs, of which some are the via configurations.
pub(super) struct RoutePath {
    /// The nodes, radians, which a spline is to join.
    pub(super) nodes: Vec<Configuration>,
    /// Index of the node of each via.
    vias: Vec<usize>,
    /// The via configurations themselves, radians.
    wanted: Vec<Configuration>,
}

impl RoutePath {
    /// A curve through the ends of all legs that leaves each leg for the part `blends[k]` of its length before the via `k` behind it, and
    /// joins the next leg that part of its length after it.
    pub(super) fn along(legs: &[&Waypoints], blends: &[f64]) -> Self {
        let mut path = Self {
            nodes: vec![legs[0][0]],
            vias: Vec::new(),
            wanted: Vec::new(),
        };
        for (k, leg) in legs.iter().enumerate() {
            let before = if k == 0 { 0.0 } else { blends[k - 1] };
            let after = blends.get(k).copied().unwrap_or(0.0);
            path.add(leg, before, after);
            if k < blends.len() {
                path.vias.push(path.nodes.len() - 1);
                path.wanted.push(leg[leg.len() - 1]);
            }
        }
        path
    }

    /// Adds the inner nodes of a leg between the two parts that are left out, and its end.
    fn add(&mut self, leg: &[Configuration], before: f64, after: f64) {
        let end = leg[leg.len() - 1];
        let passed = passed_lengths(leg);
        let length = passed[passed.len() - 1];
        if length < STILL_RAD {
            return;
        }
        let (first, last) = (before * length, (1.0 - after) * length);
        let parts = ((last - first) / SPACING_RAD).ceil().max(1.0);
        if last - first >= -1e-9 * length {
            for part in 0..=parts as usize {
                let at = first + (last - first) * part as f64 / parts;
                let is_inner = at > 1e-3 * length && at < length * (1.0 - 1e-3);
                let is_new = part == 0 || last - first > 1e-3 * length;
                if is_inner && is_new {
                    self.nodes.push(at_length(leg, &passed, at));
                }
            }
        }
        self.nodes.push(end);
    }

    /// Where a motion along the curve passes each via.
    pub(super) fn passages(&self, motion: &Trajectory) -> Vec<Passage> {
        let count = SAMPLES_OF_A_LEG * (self.vias.len() + 1) + 1;
        let samples = motion.sample(count);
        let step_s = motion.duration() / (count - 1) as f64;
        let ahead = lengths_ahead(&samples);
        let expected = lengths_ahead(&self.nodes);
        let mut ends = vec![0];
        ends.extend(&self.vias);
        ends.push(self.nodes.len() - 1);
        let window = |k: usize| {
            let leg = |i: usize| expected[ends[i]] - expected[ends[i + 1]];
            NEAR * leg(k).min(leg(k + 1))
        };
        let passage = |(k, via): (usize, &Configuration)| {
            let centre = expected[self.vias[k]];
            let near = |i: &usize| (ahead[*i] - centre).abs() <= window(k).max(0.02 * ahead[0]);
            let distance = |i: &usize| (samples[*i] - via).norm_squared();
            let order = |a: &usize, b: &usize| distance(a).total_cmp(&distance(b));
            let nearest = (0..count).filter(near).min_by(order).unwrap_or(0);
            let time_s = nearest_time(motion, via, step_s * nearest as f64, step_s);
            Passage {
                configuration: *via,
                time_s,
            }
        };
        self.wanted.iter().enumerate().map(passage).collect()
    }

    /// Moves the curve at each via by what a motion along it missed the via by.
    pub(super) fn correct(&mut self, misses: &[Configuration]) {
        let last = self.nodes.len() - 1;
        for (&node, miss) in self.vias.iter().zip(misses) {
            if node > 0 && node < last {
                self.nodes[node] += miss;
            }
        }
    }
}

/// The time near `about_s` at which a motion is nearest to a configuration, s, within `step_s` of it.
fn nearest_time(motion: &Trajectory, via: &Configuration, about_s: f64, step_s: f64) -> f64 {
    let departs = |time_s: f64| {
        let state = motion.at(time_s);
        (state.position - via).dot(&state.velocity) > 0.0
    };
    let mut from_s = (about_s - step_s).max(0.0);
    let mut to_s = (about_s + step_s).min(motion.duration());
    for _ in 0..HALVINGS {
        let middle_s = 0.5 * (from_s + to_s);
        if departs(middle_s) {
            to_s = middle_s;
        } else {
            from_s = middle_s;
        }
    }
    0.5 * (from_s + to_s)
}

/// Length of a polyline up to each point, rad.
fn passed_lengths(points: &[Configuration]) -> Vec<f64> {
    let mut passed = 0.0;
    let steps = points.windows(2).map(|pair| {
        passed += (pair[1] - pair[0]).norm();
        passed
    });
    std::iter::once(0.0).chain(steps).collect()
}

/// Length of a polyline from each point to its end, rad.
fn lengths_ahead(points: &[Configuration]) -> Vec<f64> {
    let passed = passed_lengths(points);
    let whole = passed[passed.len() - 1];
    passed.into_iter().map(|passed| whole - passed).collect()
}

/// The point of a polyline at a length, rad.
fn at_length(points: &[Configuration], passed: &[f64], length: f64) -> Configuration {
    let next = passed.partition_point(|&passed| passed < length);
    let next = next.clamp(1, points.len() - 1);
    let step = (passed[next] - passed[next - 1]).max(f64::MIN_POSITIVE);
    points[next - 1].lerp(
        &points[next],
        ((length - passed[next - 1]) / step).clamp(0.0, 1.0),
    )
}
