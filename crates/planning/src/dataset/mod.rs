//! Data sets of paths: the authors' format (`dataset.npz` + `dataset_meta.json`), its generator, and the training arrays.

mod archive;
mod features;
mod format;
mod generate;

pub use archive::{ArchiveError, ArchiveReader, ArchiveWriter};
pub use features::{TrainingRows, training_rows};
pub use format::{Case, Dataset, DatasetError, Meta, Row, Split};
pub use generate::{BlockReport, Recipe, generate_block};
