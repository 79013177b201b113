//! The tendon map as rows, for the loops that run over tendons.

use pcc_model::{Configuration, TendonLimits, TendonMap};

/// One row a tendon: dΔl/dζ, in length per rad. Tendon lengths are linear in ζ, so their derivatives use it too.
#[derive(Clone, Debug)]
pub(crate) struct TendonRows(Vec<Configuration>);

impl TendonRows {
    pub(crate) fn of(tendons: &TendonMap) -> Self {
        let matrix = tendons.matrix();
        let row = |tendon| Configuration::from_fn(|column, _| matrix[(tendon, column)]);
        Self((0..matrix.nrows()).map(row).collect())
    }

    pub(crate) fn iter(&self) -> impl ExactSizeIterator<Item = &Configuration> {
        self.0.iter()
    }
}

/// Whether every limit is a finite number above zero.
pub(crate) fn limits_are_valid(limits: &TendonLimits) -> bool {
    [limits.velocity, limits.acceleration, limits.jerk]
        .iter()
        .all(|limit| limit.is_finite() && *limit > 0.0)
}
