//! One interval of the speed grid: which pairs (x_i, x_{i+1}) keep its limits.
//!
//! Each limit is a strip |α x_i + β x_{i+1}| ≤ 1. The range of x_i over all strips is a linear program in two
//! variables: a polygon is cut only by the strip that its extreme corner leaves most, until that corner leaves none.

use crate::limits::tendon_rows::{LANES, Lanes, combined, lanes, largest_lane, raise_to_magnitude};
use crate::parameterize::tendon_path::Derivatives;

/// The limits of one interval, from the derivatives at both of its ends.
#[derive(Clone, Copy)]
pub(super) struct Interval<'a> {
    pub(super) from: &'a [Derivatives],
    pub(super) to: &'a [Derivatives],
    /// 1 ÷ (2 × the interval's length): u is (x_{i+1} − x_i) × `half`.
    pub(super) half: f64,
}

impl Interval<'_> {
    /// What a pair uses of each limit at the start and at the end, block by block: kept within ±1.
    #[inline(always)]
    fn uses(&self, [first, second]: [f64; 2]) -> impl Iterator<Item = [Lanes; 2]> + '_ {
        let u = (second - first) * self.half;
        self.from.iter().zip(self.to).map(move |(from, to)| {
            [
                combined(&from.slope, u, &from.bend, first),
                combined(&to.slope, u, &to.bend, second),
            ]
        })
    }

    /// Factors of (x_i, x_{i+1}) that make the uses, at the start and at the end, block by block.
    #[inline(always)]
    pub(super) fn normals(&self) -> impl Iterator<Item = [[Lanes; 2]; 2]> + '_ {
        let half = self.half;
        self.from.iter().zip(self.to).map(move |(from, to)| {
            let before = lanes(|lane| from.slope[lane] * half);
            let after = lanes(|lane| to.slope[lane] * half);
            [
                [lanes(|lane| from.bend[lane] - before[lane]), before],
                [
                    lanes(|lane| -after[lane]),
                    lanes(|lane| to.bend[lane] + after[lane]),
                ],
            ]
        })
    }

    /// The largest part of a limit that a pair uses.
    #[inline(always)]
    fn largest_use(&self, pair: [f64; 2]) -> f64 {
        let mut most = [0.0; LANES];
        for [start, end] in self.uses(pair) {
            raise_to_magnitude(&mut most, &start);
            raise_to_magnitude(&mut most, &end);
        }
        largest_lane(&most)
    }

    /// Whether a pair keeps all limits.
    #[inline(always)]
    pub(super) fn allows(&self, pair: [f64; 2]) -> bool {
        self.largest_use(pair) <= 1.0
    }
}

/// Speed at the start that costs less than this part of itself at the end is worth it.
const LEAST_TRADE: f64 = 0.5;
/// A limit of which this part is used is used fully.
pub(super) const FULL_USE: f64 = 1.0 - 1e-6;

/// A convex set of pairs (x_i, x_{i+1}), by its corners in order.
#[derive(Clone, Debug, Default)]
pub(super) struct Polygon {
    corners: Vec<[f64; 2]>,
    clipped: Vec<[f64; 2]>,
}

/// A limit that is exceeded by this part of itself or less is kept: that much is rounding.
const ROUNDING: f64 = 1e-12;

impl Polygon {
    /// The largest x_i ≤ `cap` that some x_{i+1} from 0 to `next` goes with; none where there is no such pair.
    pub(super) fn largest_first(
        &mut self,
        cap: f64,
        next: f64,
        interval: &Interval<'_>,
    ) -> Option<f64> {
        self.corners.clear();
        self.corners
            .extend([[cap, next], [cap, 0.0], [0.0, 0.0], [0.0, next]]);
        // Each strip cuts at most twice, but for rounding.
        for _ in 0..4 * LANES * interval.from.len() + 8 {
            let corner = self.corners.iter().copied().reduce(|best, corner| {
                if corner[0] > best[0] { corner } else { best }
            })?;
            let Some(side) = most_exceeded(interval, corner) else {
                return Some(corner[0].max(0.0));
            };
            self.clip(&side);
        }
        let firsts = self.corners.iter().map(|corner| corner[0]);
        firsts.reduce(f64::max).map(|largest| largest.max(0.0))
    }

    /// Keeps the part of the polygon whose points have a product with `normal` of at most 1.
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
fn most_exceeded(interval: &Interval<'_>, pair: [f64; 2]) -> Option<[f64; 2]> {
    let largest = interval.largest_use(pair);
    if largest <= 1.0 + ROUNDING {
        return None;
    }
    for (uses, normals) in interval.uses(pair).zip(interval.normals()) {
        for (uses, [first, second]) in uses.iter().zip(&normals) {
            for lane in 0..LANES {
                if uses[lane].abs() == largest {
                    let sign = uses[lane].signum();
                    return Some([sign * first[lane], sign * second[lane]]);
                }
            }
        }
    }
    None
}

/// The largest x_{i+1} that goes with `x` at the start of an interval.
#[inline(always)]
pub(super) fn largest_second(interval: &Interval<'_>, x: f64) -> f64 {
    let mut least = [f64::INFINITY; LANES];
    for normals in interval.normals() {
        for [first, second] in &normals {
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
    }
    least.into_iter().fold(f64::INFINITY, f64::min)
}

/// How far a pair (x_i, x_{i+1}) uses the acceleration limits.
pub(super) struct Use {
    /// Whether the pair uses at least one acceleration limit fully.
    pub(super) is_full: bool,
    /// Whether, among the limits used fully, one lets either value grow if the other falls.
    pub(super) trades: bool,
}

/// How far a pair (x_i, x_{i+1}) uses the acceleration limits of an interval.
#[inline(always)]
pub(super) fn use_of(interval: &Interval<'_>, pair: [f64; 2]) -> Use {
    let is_full = interval.largest_use(pair) > FULL_USE;
    Use {
        is_full,
        trades: is_full && largest_trading_use(interval, pair) > FULL_USE,
    }
}

/// The largest part that a pair uses of the limits that allow more of either of its two values for less of the other.
#[inline(always)]
fn largest_trading_use(interval: &Interval<'_>, pair: [f64; 2]) -> f64 {
    let mut most = [0.0; LANES];
    for normals in interval.normals() {
        for [first, second] in &normals {
            let products = combined(first, pair[0], second, pair[1]);
            let trading = lanes(|i| {
                let trades = first[i] * second[i] > LEAST_TRADE * second[i] * second[i];
                if trades { products[i] } else { 0.0 }
            });
            raise_to_magnitude(&mut most, &trading);
        }
    }
    largest_lane(&most)
}

fn dot(normal: &[f64; 2], point: &[f64; 2]) -> f64 {
    normal[0] * point[0] + normal[1] * point[1]
}
