//! The authors' format, version 25: `dataset.npz` and `dataset_meta.json` (docs/evaluation.md "The command").

mod columns;
pub(crate) mod counts;
pub(crate) mod dataset;
pub(crate) mod error;
pub(crate) mod generator_notes;
pub(crate) mod meta;
mod rows;
