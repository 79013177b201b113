//! The tendon map for the loops that run over tendons, four tendons at a time.

use pcc_model::{Configuration, DOF, TendonLimits, TendonMap};

/// One quantity of four tendons; lanes beyond the last tendon hold 0.
pub(crate) type Lanes = [f64; LANES];

/// Tendons that are handled together.
pub(crate) const LANES: usize = 4;

/// The rows of the tendon map dΔl/dζ, in length per rad, four rows a block. Tendon lengths are linear in ζ, so their derivatives use it too.
#[derive(Clone, Debug, Default)]
pub(crate) struct TendonRows {
    blocks: Vec<TendonBlock>,
}

/// Four rows of the map, column by column.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TendonBlock([Lanes; DOF]);

impl TendonRows {
    pub(crate) fn of(tendons: &TendonMap) -> Self {
        let mut rows = Self::default();
        rows.rebuild(tendons);
        rows
    }

    /// Replaces the rows by those of another map, reusing the memory.
    pub(crate) fn rebuild(&mut self, tendons: &TendonMap) {
        let matrix = tendons.matrix();
        let entry = |row: usize, column| {
            if row < matrix.nrows() {
                matrix[(row, column)]
            } else {
                0.0
            }
        };
        self.blocks.clear();
        let firsts = (0..matrix.nrows()).step_by(LANES);
        self.blocks.extend(firsts.map(|first| {
            TendonBlock(std::array::from_fn(|column| {
                std::array::from_fn(|lane| entry(first + lane, column))
            }))
        }));
    }

    pub(crate) fn blocks(&self) -> &[TendonBlock] {
        &self.blocks
    }

    /// The largest magnitude of a tendon's derivative of length for a derivative of ζ.
    pub(crate) fn largest(&self, vector: &Configuration) -> f64 {
        let mut most = [0.0; LANES];
        for block in &self.blocks {
            raise_to_magnitude(&mut most, &block.times(vector));
        }
        largest_lane(&most)
    }

    /// The rows of all tendons that any motion moves.
    pub(crate) fn rows(&self) -> impl Iterator<Item = Configuration> {
        let row = |block: &TendonBlock, lane: usize| {
            Configuration::from_fn(|column, _| block.0[column][lane])
        };
        let rows = self
            .blocks
            .iter()
            .flat_map(move |block| (0..LANES).map(move |lane| row(block, lane)));
        rows.filter(|row| row.norm_squared() > 0.0)
    }

    /// The largest norm of a row: the most that a tendon's length changes per rad.
    pub(crate) fn gain(&self) -> f64 {
        self.rows().map(|row| row.norm()).fold(0.0, f64::max)
    }
}

impl TendonBlock {
    /// The derivatives of four tendons' lengths for a derivative of ζ.
    #[inline(always)]
    pub(crate) fn times(&self, vector: &Configuration) -> Lanes {
        let mut sum = [0.0; LANES];
        for (column, &component) in self.0.iter().zip(vector.iter()) {
            for lane in 0..LANES {
                sum[lane] += column[lane] * component;
            }
        }
        sum
    }
}

/// Four values, computed lane by lane.
#[inline(always)]
pub(crate) fn lanes(value: impl Fn(usize) -> f64) -> Lanes {
    let mut lanes = [0.0; LANES];
    for (i, lane) in lanes.iter_mut().enumerate() {
        *lane = value(i);
    }
    lanes
}

/// first × `by_first` + second × `by_second`.
#[inline(always)]
pub(crate) fn combined(first: &Lanes, by_first: f64, second: &Lanes, by_second: f64) -> Lanes {
    lanes(|i| first[i] * by_first + second[i] * by_second)
}

/// Raises each lane of `most` to the magnitude of that lane of `values`, where that is larger.
#[inline(always)]
pub(crate) fn raise_to_magnitude(most: &mut Lanes, values: &Lanes) {
    for (most, value) in most.iter_mut().zip(values) {
        let magnitude = value.abs();
        *most = if magnitude > *most { magnitude } else { *most };
    }
}

/// The largest of four values, at least 0.
#[inline(always)]
pub(crate) fn largest_lane(lanes: &Lanes) -> f64 {
    lanes.iter().fold(0.0, |most, &lane| f64::max(most, lane))
}

/// Whether every limit is a finite number above zero.
pub(crate) fn limits_are_valid(limits: &TendonLimits) -> bool {
    [limits.velocity, limits.acceleration, limits.jerk]
        .iter()
        .all(|limit| limit.is_finite() && *limit > 0.0)
}
