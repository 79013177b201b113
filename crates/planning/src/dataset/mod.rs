//! Data sets of paths: the authors' format (`dataset.npz` + `dataset_meta.json`), its generator, and the training arrays.

mod columns;
mod features;
mod format;
mod generate;
mod generator_notes;
mod meta;
mod paper;

pub use arrays::{ArchiveError, ArchiveReader, ArchiveWriter};
pub use features::{TrainingRows, training_rows};
pub use format::{Case, Check, Dataset, DatasetError, Row, Split};
pub use generate::{BlockReport, Recipe, TEACHER_VERSION, generate_block};
pub use generator_notes::GeneratorNotes;
pub use meta::{BySplit, Counts, Meta, Units};
pub use paper::{
    DroppedPaths, DroppedTargets, PAPER_VERSION, PaperReport, TERMINALS, generate_paper_block,
};
