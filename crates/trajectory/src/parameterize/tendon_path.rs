//! The spline in tendon space: lengths are linear in ζ, so its nodes are projected once for all that lies between.

use crate::curve::spline::Spline;
use crate::limits::tendon_rows::{
    LANES, Lanes, TendonRows, combined, lanes, largest_lane, raise_to_magnitude,
};

/// A point of the grid that the speed is planned on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GridPoint {
    /// Spline piece that the interval after this point lies in.
    pub(crate) piece: usize,
    /// Path parameter s.
    pub(crate) parameter: f64,
}

/// l′ of each piece's chord and l″ at each node, both ÷ the acceleration limit, block by block.
#[derive(Clone, Debug, Default)]
pub(crate) struct TendonPath {
    /// Number of blocks of four tendons.
    pub(crate) blocks: usize,
    chord: Vec<Lanes>,
    bend: Vec<Lanes>,
}

/// First and second derivative by s of four tendons' lengths, ÷ the acceleration limit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Derivatives {
    pub(crate) slope: Lanes,
    pub(crate) bend: Lanes,
}

/// Weights of a piece's chord and of the bends at its two nodes, of which the derivatives at a place of it are the sum.
pub(crate) struct PieceWeights {
    piece: usize,
    slope: [f64; 2],
    bend: [f64; 2],
}

impl PieceWeights {
    #[inline(always)]
    pub(crate) fn at(spline: &Spline, place: GridPoint) -> Self {
        let nodes = spline.parameters();
        let (from, to) = (nodes[place.piece], nodes[place.piece + 1]);
        let h = to - from;
        let b = ((place.parameter - from) / h).clamp(0.0, 1.0);
        let a = 1.0 - b;
        let sixth = h / 6.0;
        Self {
            piece: place.piece,
            slope: [sixth * (1.0 - 3.0 * a * a), sixth * (3.0 * b * b - 1.0)],
            bend: [a, b],
        }
    }
}

impl TendonPath {
    pub(crate) fn rebuild(&mut self, spline: &Spline, rows: &TendonRows, acceleration_limit: f64) {
        self.blocks = rows.blocks().len();
        self.chord.clear();
        self.bend.clear();
        let part = |whole: Lanes| lanes(|i| whole[i] / acceleration_limit);
        for chord in spline.chords() {
            for block in rows.blocks() {
                self.chord.push(part(block.times(&chord)));
            }
        }
        for bend in spline.bends() {
            for block in rows.blocks() {
                self.bend.push(part(block.times(bend)));
            }
        }
    }

    /// The derivatives by s at a place of the path, block by block.
    #[inline(always)]
    pub(crate) fn derivatives<'a>(
        &'a self,
        weights: &'a PieceWeights,
    ) -> impl Iterator<Item = Derivatives> + 'a {
        let first = weights.piece * self.blocks;
        let after = first + self.blocks;
        let chords = &self.chord[first..after];
        let bends = self.bend[first..after + self.blocks].split_at(self.blocks);
        let nodes = bends.0.iter().zip(bends.1);
        chords.iter().zip(nodes).map(|(chord, (from, to))| {
            let turn = combined(from, weights.slope[0], to, weights.slope[1]);
            Derivatives {
                slope: lanes(|i| chord[i] + turn[i]),
                bend: combined(from, weights.bend[0], to, weights.bend[1]),
            }
        })
    }
}

/// The largest |l′| ÷ the acceleration limit.
#[inline(always)]
pub(crate) fn largest_slope(derivatives: &[Derivatives]) -> f64 {
    let mut most = [0.0; LANES];
    for block in derivatives {
        raise_to_magnitude(&mut most, &block.slope);
    }
    largest_lane(&most)
}
