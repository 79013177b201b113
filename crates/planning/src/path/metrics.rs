//! Figures of merit of a path and of a set of paths (docs/evaluation.md "Metrics").

use crate::path::waypoints::WAYPOINTS;
use nalgebra::{DMatrix, SVector};
use pcc_model::{Configuration, Point, UnitRobot};
use trajectory::Trajectory;

/// Accuracy of the minimum clearance, section lengths.
pub(crate) const CLEARANCE_TOLERANCE: f64 = 1e-3;
/// Instants at which a motion is sampled: odd, so that every other one makes a coarser sampling from end to end.
const SAMPLES: usize = 2 * WAYPOINTS + 1;
/// Configurations nearer than this are one terminal mode, rad.
const MODE_SEPARATION_RAD: f64 = 0.5;

/// Figures of one certified motion; lengths in section lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathMetrics {
    /// Duration, s.
    pub duration_s: f64,
    /// Length of the tip path, section lengths.
    pub tip_length: f64,
    /// Straight distance between the tip's two ends, section lengths.
    pub tip_distance: f64,
    /// ∫‖p‴‖² over the normalised arc length of the tip path, in squared section lengths.
    pub tip_smoothness: f64,
    /// Smallest clearance of the whole body over the whole motion: within 1e-3 to balls, to solids up to a thousandth of a section and
    /// a twentieth of it more below the true one.
    pub clearance: f64,
    /// Length in configuration space, rad.
    pub configuration_length: f64,
}

impl PathMetrics {
    /// The figures of one motion whose clearance, section lengths, is known already.
    #[must_use]
    pub fn of(robot: &UnitRobot, trajectory: &Trajectory, clearance: f64) -> Self {
        let samples = trajectory.sample(SAMPLES);
        let tips = robot.tips(&samples);
        Self {
            duration_s: trajectory.duration(),
            tip_length: length(&tips),
            tip_distance: (tips[tips.len() - 1] - tips[0]).norm(),
            tip_smoothness: smoothness(&tips),
            clearance,
            configuration_length: length(&samples),
        }
    }
}

/// Length of the path through points of equal time steps, extrapolated from all chords and those of every other point: a
/// polyline's length falls short by the square of the step.
fn length<const D: usize>(points: &[SVector<f64, D>]) -> f64 {
    let fine: f64 = points.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
    let every_other = points.windows(3).step_by(2);
    let coarse: f64 = every_other.map(|w| (w[2] - w[0]).norm()).sum();
    fine + (fine - coarse) / 3.0
}

/// ∫‖p‴‖² by third differences on points resampled to equal arc length.
fn smoothness(tips: &[Point]) -> f64 {
    let points = equal_arc_lengths(tips, WAYPOINTS);
    let step = 1.0 / (WAYPOINTS - 1) as f64;
    let third = |w: &[Point]| (w[3] - w[0] + (w[1] - w[2]) * 3.0).norm_squared();
    points.windows(4).map(third).sum::<f64>() / step.powi(5)
}

/// Points at equal arc lengths on the cubics in arc length through `points`: third differences magnify the corners of
/// a polyline.
fn equal_arc_lengths(points: &[Point], count: usize) -> Vec<Point> {
    let last = points.len() - 1;
    let chords = points.windows(2).map(|w| w[1] - w[0]);
    let spans: Vec<f64> = chords.map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
    let total: f64 = spans.iter().sum();
    let chord = |edge: usize| (points[edge + 1] - points[edge]) / spans[edge];
    // By the parabola through a point and both beside it.
    let slope = |at: usize| match at {
        0 => chord(0),
        _ if at == last => chord(last - 1),
        _ => {
            let (before, after) = (spans[at - 1], spans[at]);
            (chord(at - 1) * after + chord(at) * before) / (before + after)
        }
    };
    let (mut edge, mut passed) = (0, 0.0);
    let mut slopes = [slope(0), slope(1)];
    (0..count)
        .map(|i| {
            let wanted = total * i as f64 / (count - 1) as f64;
            while edge + 1 < last && passed + spans[edge] < wanted {
                passed += spans[edge];
                edge += 1;
                slopes = [slopes[1], slope(edge + 1)];
            }
            let (span, part) = (
                spans[edge],
                ((wanted - passed) / spans[edge]).clamp(0.0, 1.0),
            );
            let rest = 1.0 - part;
            points[edge].lerp(&points[edge + 1], part * part * (3.0 - 2.0 * part))
                + (slopes[0] * rest - slopes[1] * part) * (span * part * rest)
        })
        .collect()
}

/// Figures of a set of goal configurations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetMetrics {
    /// Distinct terminal modes, greedily counted at 0.5 rad.
    pub modes: usize,
    /// Mean distance between pairs, rad (0 for fewer than two configurations).
    pub mean_distance_rad: f64,
    /// Smallest distance between pairs, rad (0 for fewer than two configurations).
    pub min_distance_rad: f64,
    /// Vendi score with a Gaussian kernel of width 0.5 rad (Friedman & Dieng 2023): the effective number of configurations.
    pub vendi: f64,
}

/// Counts terminal modes: configurations at least 0.5 rad from every mode counted before, in the order given.
#[must_use]
pub fn modes(ends: &[Configuration]) -> usize {
    let mut found: Vec<&Configuration> = Vec::new();
    for end in ends {
        if found
            .iter()
            .all(|m| (*m - end).norm() >= MODE_SEPARATION_RAD)
        {
            found.push(end);
        }
    }
    found.len()
}

/// Computes the figures of a set of goal configurations.
#[must_use]
pub fn set_metrics(ends: &[Configuration]) -> SetMetrics {
    let pairs: Vec<f64> = (0..ends.len())
        .flat_map(|i| (0..i).map(move |j| (i, j)))
        .map(|(i, j)| (ends[i] - ends[j]).norm())
        .collect();
    SetMetrics {
        modes: modes(ends),
        mean_distance_rad: pairs.iter().sum::<f64>() / pairs.len().max(1) as f64,
        min_distance_rad: pairs.iter().copied().reduce(f64::min).unwrap_or(0.0),
        vendi: vendi(ends),
    }
}

fn vendi(ends: &[Configuration]) -> f64 {
    if ends.is_empty() {
        return 0.0;
    }
    let n = ends.len();
    let kernel =
        |i: usize, j: usize| (-(ends[i] - ends[j]).norm_squared() / (2.0 * 0.25)).exp() / n as f64;
    let eigenvalues = DMatrix::from_fn(n, n, kernel).symmetric_eigenvalues();
    let entropy: f64 = eigenvalues
        .iter()
        .filter(|e| **e > 1e-12)
        .map(|e| -e * e.ln())
        .sum();
    entropy.exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_vendi_score_counts_far_shapes_and_not_copies() {
        let far: Vec<Configuration> = (0..4)
            .map(|i| Configuration::repeat(5.0 * f64::from(i)))
            .collect();
        assert!((vendi(&far) - 4.0).abs() < 1e-9);
        assert!((vendi(&[far[0]; 4]) - 1.0).abs() < 1e-9);
        assert_eq!((modes(&far), modes(&[far[0]; 4])), (4, 1));
    }

    #[test]
    fn the_length_of_a_circle_is_extrapolated_and_that_of_a_line_is_its_own() {
        let circle: Vec<Point> = (0..SAMPLES)
            .map(|i| std::f64::consts::TAU * i as f64 / (SAMPLES - 1) as f64)
            .map(|angle| Point::new(angle.cos(), angle.sin(), 0.0))
            .collect();
        assert!((length(&circle) / std::f64::consts::TAU - 1.0).abs() < 1e-6);
        let line: Vec<Point> = (0..SAMPLES).map(|i| Point::x() * i as f64).collect();
        assert_eq!(length(&line), (SAMPLES - 1) as f64);
    }

    #[test]
    fn the_smoothness_of_a_circle_is_the_cube_of_what_it_turns() {
        let turn = 2.0_f64;
        // From rest to rest: points crowd at both ends.
        let progress = |u: f64| turn * u * u * (3.0 - 2.0 * u);
        let arc: Vec<Point> = (0..SAMPLES)
            .map(|i| progress(i as f64 / (SAMPLES - 1) as f64))
            .map(|angle| Point::new(angle.cos(), angle.sin(), 0.0))
            .collect();
        let exact = turn.powi(6);
        assert!((smoothness(&arc) * 63.0 / 61.0 / exact - 1.0).abs() < 0.02);
    }

    #[test]
    fn a_straight_even_way_is_perfectly_smooth() {
        let line: Vec<Point> = (0..200)
            .map(|i| Point::new(f64::from(i * i), 0.0, 1.0))
            .collect();
        assert!(smoothness(&line) < 1e-3 * line[199].norm_squared());
        let bent: Vec<Point> = (0..200)
            .map(|i| Point::new((f64::from(i) / 30.0).sin(), f64::from(i) / 60.0, 1.0))
            .collect();
        assert!(smoothness(&bent) > 1.0);
    }
}
