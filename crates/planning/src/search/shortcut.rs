//! Polylines made shorter, and round at their corners, where the edges between certify.

use crate::search::edges::Search;
use pcc_model::Configuration;
use rand::RngExt;
use rand_pcg::Pcg64;
use std::ops::Range;

/// Rounds in which corners are rounded at most: each halves their angles.
const ROUNDINGS: usize = 5;
/// A corner that moves less than this is round, rad.
const ROUND_RAD: f64 = 1e-3;
/// Corners this near to each other are one, rad.
const DUPLICATE_RAD: f64 = 1e-9;

impl Search<'_> {
    /// Rounds the corners of a certified polyline to a cubic B-spline where that is certified, too: every edge is halved, then
    /// every old corner moves towards the middle of its neighbours (as OMPL's `smoothBSpline`).
    pub(crate) fn round(&self, polyline: &[Configuration]) -> Vec<Configuration> {
        let mut path = polyline.to_vec();
        for _ in 0..ROUNDINGS {
            if (self.interrupt)() {
                break;
            }
            let mut finer = halved(&path);
            let corners = (2..finer.len() - 1).step_by(2);
            if corners
                .filter(|&corner| self.round_corner(&mut finer, corner))
                .count()
                == 0
            {
                break;
            }
            path = finer;
        }
        path
    }

    /// Whether a corner was moved.
    fn round_corner(&self, path: &mut [Configuration], corner: usize) -> bool {
        let [before, at, after] = [path[corner - 1], path[corner], path[corner + 1]];
        let inner = at * 0.5 + (before + after) * 0.25;
        let moves = (inner - at).norm() > ROUND_RAD
            && self.edge_is_free(&before, &inner)
            && self.edge_is_free(&inner, &after);
        if moves {
            path[corner] = inner;
        }
        moves
    }

    /// Replaces what lies between two random points of a polyline by the edge between them where that is free; both ends stay.
    pub(crate) fn shorten(
        &self,
        mut path: Vec<Configuration>,
        rng: &mut Pcg64,
    ) -> Vec<Configuration> {
        for _ in 0..self.settings.shortcuts {
            if path.len() < 3 || (self.interrupt)() {
                break;
            }
            let [(i, a), (j, b)] = two_points(&path, rng);
            if j > i && self.edge_is_free(&a, &b) {
                cut_short(&mut path, i..j, [a, b]);
            }
        }
        path
    }
}

/// Puts an edge in the place of the corners after the first of these edges up to the last one. Corners that are nearly duplicates, which
/// gather at the ends, are removed, but never an end.
fn cut_short(path: &mut Vec<Configuration>, edges: Range<usize>, edge: [Configuration; 2]) {
    let end = path[path.len() - 1];
    path.splice(edges.start + 1..=edges.end, edge);
    path.dedup_by(|x, y| (*x - *y).norm() < DUPLICATE_RAD);
    if path.len() > 1 {
        path.pop();
    }
    path.push(end);
}

/// The same polyline with a corner in the middle of every edge.
fn halved(path: &[Configuration]) -> Vec<Configuration> {
    let mut halved = Vec::with_capacity(2 * path.len());
    for edge in path.windows(2) {
        halved.extend([edge[0], edge[0].lerp(&edge[1], 0.5)]);
    }
    halved.extend(path.last());
    halved
}

fn two_points(path: &[Configuration], rng: &mut Pcg64) -> [(usize, Configuration); 2] {
    let last = (path.len() - 1) as f64;
    let (a, b) = (rng.random::<f64>() * last, rng.random::<f64>() * last);
    [a.min(b), a.max(b)].map(|s| {
        let edge = (s as usize).min(path.len() - 2);
        (edge, path[edge].lerp(&path[edge + 1], s - edge as f64))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{search, unit_robot};
    use crate::search::edges::RrtSettings;
    use crate::search::random_configuration::random_configuration;
    use collision::{Ball, Scene};
    use rand::SeedableRng;

    #[test]
    fn a_polyline_that_is_shortened_again_and_again_keeps_its_ends() {
        let (robot, scene) = (unit_robot(), Scene::default());
        let settings = RrtSettings::default();
        let search = search(&robot, &scene, &settings);
        let mut rng = Pcg64::seed_from_u64(1);
        for _ in 0..20 {
            let polyline: Vec<_> = (0..5)
                .map(|_| random_configuration(&robot, &mut rng))
                .collect();
            let short = search.shorten(polyline.clone(), &mut rng);
            assert_eq!(
                [short[0], short[short.len() - 1]],
                [polyline[0], polyline[4]]
            );
            let edge = |w: &[Configuration]| (w[1] - w[0]).norm();
            let length = |polyline: &[Configuration]| polyline.windows(2).map(edge).sum::<f64>();
            assert!(length(&short) < length(&polyline));
        }
    }

    #[test]
    fn corners_are_rounded_where_there_is_room_and_ends_stay() {
        let (robot, scene) = (unit_robot(), Scene::default());
        let settings = RrtSettings::default();
        let search = search(&robot, &scene, &settings);
        let bent = |x: f64, y: f64| Configuration::from_column_slice(&[x, y, 0.0, 0.0, 0.0, 0.0]);
        let polyline = [bent(0.0, 0.0), bent(0.8, 0.0), bent(0.8, 0.8)];
        let round = search.round(&polyline);
        let turn = |path: &[Configuration]| {
            let turns = path.windows(3).map(|w| {
                let [a, b] = [w[1] - w[0], w[2] - w[1]];
                (a.dot(&b) / (a.norm() * b.norm())).clamp(-1.0, 1.0).acos()
            });
            turns.fold(0.0, f64::max)
        };
        assert!(
            turn(&polyline) > 1.5 && turn(&round) < 0.3,
            "{}",
            turn(&round)
        );
        assert_eq!(
            [round[0], round[round.len() - 1]],
            [polyline[0], polyline[2]]
        );
        let segment = [polyline[0], polyline[2]];
        assert_eq!(search.round(&segment), segment);
    }

    #[test]
    fn a_corner_beside_an_obstacle_is_rounded_as_far_as_edges_stay_free() {
        let robot = unit_robot();
        let bent = |x: f64, y: f64| Configuration::from_column_slice(&[x, y, 0.0, 0.0, 0.0, 0.0]);
        let polyline = [bent(-0.5, 0.0), bent(0.0, 0.6), bent(0.5, 0.0)];
        let ball = Ball {
            centre: robot.tip(&bent(0.0, 0.0)),
            radius: 0.45,
        };
        let scene = Scene::new(vec![ball]).unwrap();
        let settings = RrtSettings::default();
        let search = search(&robot, &scene, &settings);
        let is_free =
            |path: &[Configuration]| path.windows(2).all(|w| search.edge_is_free(&w[0], &w[1]));
        assert!(is_free(&polyline) && !search.edge_is_free(&polyline[0], &polyline[2]));
        let round = search.round(&polyline);
        assert!(round.len() > polyline.len() && is_free(&round));
    }
}
