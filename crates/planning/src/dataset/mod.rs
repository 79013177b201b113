//! Data sets of paths: the authors' format (`dataset.npz` + `dataset_meta.json`), its generator, and the training arrays.

mod archive;
mod columns;
mod features;
mod format;
mod generate;
mod paper;

pub use archive::{ArchiveError, ArchiveReader, ArchiveWriter};
pub use features::{TrainingRows, training_rows};
pub use format::{Case, Check, Dataset, DatasetError, Meta, Row, Split};
pub use generate::{BlockReport, Recipe, TEACHER_VERSION, generate_block};
pub use paper::{
    DroppedPaths, DroppedTargets, PAPER_VERSION, PaperReport, TERMINALS, generate_paper_block,
};
