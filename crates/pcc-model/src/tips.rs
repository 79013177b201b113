//! The tips of many configurations, a few at a time.
//!
//! A tip is built from the last section to the first: e₁ + R₁ (e₂ + R₂ e₃), with R v = v + A w×v + B w×(w×v), so no
//! rotation is ever formed and the same step serves all lanes.

use crate::section::half_sincs_and_cosines;
use crate::{Configuration, Point, SECTIONS};

/// Configurations that are handled together.
const LANES: usize = 4;

/// One quantity of some configurations.
type Lanes = [f64; LANES];

/// The tips of `shapes`, base frame.
pub(crate) fn tips_of(lengths: &[f64; SECTIONS], shapes: &[Configuration]) -> Vec<Point> {
    let mut tips = Vec::with_capacity(shapes.len());
    for some in shapes.chunks(LANES) {
        let components = |row: usize| lanes(|i| some[i.min(some.len() - 1)][row]);
        let mut tip = [[0.0; LANES]; 3];
        for section in (0..SECTIONS).rev() {
            let (x, y) = (components(2 * section), components(2 * section + 1));
            carry(lengths[section], &x, &y, &mut tip);
        }
        let [x, y, z] = tip;
        tips.extend((0..some.len()).map(|i| Point::new(x[i], y[i], z[i])));
    }
    tips
}

/// Takes points seen from the ends of sections to how their bases see them.
#[inline(always)]
fn carry(length: f64, x: &Lanes, y: &Lanes, point: &mut [Lanes; 3]) {
    let [half_sinc, half_cosine] =
        half_sincs_and_cosines(&lanes(|i| 0.25 * (x[i] * x[i] + y[i] * y[i])));
    let [px, py, pz] = *point;
    for i in 0..LANES {
        let (a, b) = (
            half_sinc[i] * half_cosine[i],
            0.5 * half_sinc[i] * half_sinc[i],
        );
        let (x, y) = (x[i], y[i]);
        let turned = [y * pz[i], -x * pz[i], x * py[i] - y * px[i]];
        let twice = [y * turned[2], -x * turned[2], x * turned[1] - y * turned[0]];
        point[0][i] = px[i] + a * turned[0] + b * (twice[0] + length * y);
        point[1][i] = py[i] + a * turned[1] + b * (twice[1] - length * x);
        point[2][i] = pz[i] + a * (turned[2] + length) + b * twice[2];
    }
}

/// Lane by lane.
#[inline(always)]
fn lanes(value: impl Fn(usize) -> f64) -> Lanes {
    let mut lanes = [0.0; LANES];
    for (i, lane) in lanes.iter_mut().enumerate() {
        *lane = value(i);
    }
    lanes
}
