//! One interval of the speed grid: which pairs (x_i, x_{i+1}) keep its limits.
//!
//! Each limit is a strip |α x_i + β x_{i+1}| ≤ 1. The range of x_i over all strips is a linear program in two
//! variables: a polygon is cut only by the strip that its extreme corner leaves most, until that corner leaves none.

use crate::tendon::{LANES, Lanes, combined, lanes, largest_lane, raise_to_magnitude};
use crate::tendon_path::Derivatives;

/// Factors of (x_i, x_{i+1}) for four tendons at the start and at the end of an interval: products are within ±1.
#[derive(Clone, Copy, Debug)]
pub(super) struct IntervalLimits([[Lanes; 2]; 2]);

impl IntervalLimits {
    /// `half` is 1 ÷ (2 × the interval's length): u is (x_{i+1} − x_i) × `half`.
    #[inline(always)]
    pub(super) fn between(from: &Derivatives, to: &Derivatives, half: f64) -> Self {
        Self([
            [
                lanes(|lane| from.bend[lane] - from.slope[lane] * half),
                lanes(|lane| from.slope[lane] * half),
            ],
            [
                lanes(|lane| -to.slope[lane] * half),
                lanes(|lane| to.bend[lane] + to.slope[lane] * half),
            ],
        ])
    }

    #[inline(always)]
    fn normals(&self) -> &[[Lanes; 2]; 2] {
        &self.0
    }
}

/// Speed at the start that costs less than this part of itself at the end is worth it.
const LEAST_TRADE: f64 = 0.5;
/// A limit of which this part is used is used fully.
const FULL_USE: f64 = 1.0 - 1e-6;

/// The convex set of pairs that is left, corner by corner.
#[derive(Clone, Debug, Default)]
pub(super) struct Polygon {
    corners: Vec<[f64; 2]>,
    clipped: Vec<[f64; 2]>,
}

/// What exceeds a limit by this part of it is within: rounding.
pub(super) const ROUNDING: f64 = 1e-12;

impl Polygon {
    pub(super) fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    /// The least and the largest x_i ≤ `cap` that some x_{i+1} in `next` goes with; nothing if there is no pair.
    pub(super) fn first_range(
        &mut self,
        cap: f64,
        next: [f64; 2],
        limits: &[IntervalLimits],
    ) -> Option<[f64; 2]> {
        let [low, high] = next;
        self.corners.clear();
        self.corners
            .extend([[cap, high], [cap, low], [0.0, low], [0.0, high]]);
        let largest = self.extreme(limits, |corner| corner[0])?;
        // Where standing still is allowed, so is x_i = 0.
        let least = if low == 0.0 {
            0.0
        } else {
            -self.extreme(limits, |corner| -corner[0])?
        };
        Some([least, largest.max(least)])
    }

    /// The largest `value` of a pair within all limits.
    fn extreme(
        &mut self,
        limits: &[IntervalLimits],
        value: impl Fn(&[f64; 2]) -> f64,
    ) -> Option<f64> {
        // Each strip cuts at most twice, but for rounding.
        for _ in 0..4 * LANES * limits.len() + 8 {
            let corner = self.corners.iter().copied().reduce(|best, corner| {
                if value(&corner) > value(&best) {
                    corner
                } else {
                    best
                }
            })?;
            let Some(side) = most_exceeded(limits, &corner) else {
                return Some(value(&corner));
            };
            self.clip(&side);
        }
        self.corners.iter().map(value).reduce(f64::max)
    }

    /// Keeps what is on the inner side (product ≤ 1).
    fn clip(&mut self, normal: &[f64; 2]) {
        let Some(&last) = self.corners.last() else {
            return;
        };
        self.clipped.clear();
        let (mut from, mut from_excess) = (last, dot(normal, &last) - 1.0);
        for &to in &self.corners {
            let to_excess = dot(normal, &to) - 1.0;
            if (from_excess > 0.0) != (to_excess > 0.0) {
                let part = from_excess / (from_excess - to_excess);
                self.clipped.push([
                    from[0] + part * (to[0] - from[0]),
                    from[1] + part * (to[1] - from[1]),
                ]);
            }
            if to_excess <= 0.0 {
                self.clipped.push(to);
            }
            (from, from_excess) = (to, to_excess);
        }
        std::mem::swap(&mut self.corners, &mut self.clipped);
    }
}

/// The factors of the limit that a pair exceeds most, signed so that their product is above 1.
#[inline(always)]
fn most_exceeded(limits: &[IntervalLimits], pair: &[f64; 2]) -> Option<[f64; 2]> {
    let mut most = [0.0; LANES];
    for [first, second] in limits.iter().flat_map(IntervalLimits::normals) {
        raise_to_magnitude(&mut most, &combined(first, pair[0], second, pair[1]));
    }
    let largest = largest_lane(&most);
    if largest <= 1.0 + ROUNDING {
        return None;
    }
    for [first, second] in limits.iter().flat_map(IntervalLimits::normals) {
        let products = combined(first, pair[0], second, pair[1]);
        for lane in 0..LANES {
            if products[lane].abs() == largest {
                let sign = products[lane].signum();
                return Some([sign * first[lane], sign * second[lane]]);
            }
        }
    }
    None
}

/// The largest x_{i+1} that goes with `x` at the start of an interval.
#[inline(always)]
pub(super) fn largest_second(limits: &[IntervalLimits], x: f64) -> f64 {
    let mut least = [f64::INFINITY; LANES];
    for [first, second] in limits.iter().flat_map(IntervalLimits::normals) {
        for lane in 0..LANES {
            let size = second[lane].abs();
            let bound = (1.0 - first[lane] * second[lane].signum() * x) / size;
            let bound = if size > 0.0 { bound } else { f64::INFINITY };
            least[lane] = if bound < least[lane] {
                bound
            } else {
                least[lane]
            };
        }
    }
    least.into_iter().fold(f64::INFINITY, f64::min)
}

/// Whether a limit that a pair uses fully allows more of either for less of the other.
#[inline(always)]
pub(super) fn trades_speeds(limits: &[IntervalLimits], pair: &[f64; 2]) -> bool {
    let mut most = [0.0; LANES];
    for [first, second] in limits.iter().flat_map(IntervalLimits::normals) {
        let products = combined(first, pair[0], second, pair[1]);
        let trading = lanes(|i| {
            let trades = first[i] * second[i] > LEAST_TRADE * second[i] * second[i];
            if trades { products[i] } else { 0.0 }
        });
        raise_to_magnitude(&mut most, &trading);
    }
    largest_lane(&most) > FULL_USE
}

fn dot(normal: &[f64; 2], point: &[f64; 2]) -> f64 {
    normal[0] * point[0] + normal[1] * point[1]
}
