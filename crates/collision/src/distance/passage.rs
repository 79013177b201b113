//! Lower bounds of how near points come to an obstacle between two instants.

/// How points pass an obstacle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Passage {
    /// Bound on the length of the points' paths.
    pub(crate) path_length: f64,
    /// Bound on the distance between the ends of a path.
    pub(crate) chord: f64,
    /// Bound on how far the points stray from the chord of their path.
    pub(crate) stray: f64,
    /// Distance, from the obstacle's centre or surface, at which the clearance is zero.
    pub(crate) reach: f64,
}

impl Passage {
    /// A lower bound of the clearance along the paths, from the clearances at their two ends: the larger of two bounds.
    ///
    /// By the length of the path alone it is (a + b − length)/2. And a point that passes an obstacle's centre from distance
    /// a to distance b along the chord keeps at least the height of that triangle. That bound grows with the
    /// obstacle's radius, so the least one stands for all.
    pub(crate) fn lowest(&self, from: f64, to: f64) -> f64 {
        let linear = 0.5 * (from + to - self.path_length);
        let (a, b) = (from + self.reach, to + self.reach);
        let (aa, bb, side) = (a * a, b * b, self.chord * self.chord);
        let place = (aa - bb + side) / (2.0 * side).max(f64::MIN_POSITIVE);
        let place = place.clamp(0.0, 1.0);
        let height = aa + place * (bb - aa - side * (1.0 - place));
        if a > 0.0 && b > 0.0 && height > 0.0 {
            linear.max(height.sqrt() - self.stray - self.reach)
        } else {
            linear
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sections_that_were_not_measured_stay_clear() {
        let passage = Passage {
            path_length: 0.2,
            chord: 0.2,
            stray: 0.01,
            reach: 0.4,
        };
        let far = f64::INFINITY;
        for (from, to) in [(far, 0.1), (0.1, far), (far, far)] {
            assert_eq!(passage.lowest(from, to), far);
        }
    }
}
