//! Data sets of paths: scenes drawn at random, the two generators of paths, the authors' format (`dataset.npz` and
//! `dataset_meta.json`), archives of arrays, and the arrays that the few-step model is trained with.
//!
//! Lengths are in units of one section's arc length, angles in radians, and every position is in the robot's base frame.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod archive;
mod cases;
mod expert;
#[cfg(test)]
mod fixtures;
mod format;
mod paper;
mod recipe;
pub mod reference;
mod row;
pub mod scenes;
mod training_rows;

pub use archive::error::ArchiveError;
pub use archive::reader::ArchiveReader;
pub use archive::writer::ArchiveWriter;
pub use cases::{CASES_VERSION, generate_cases};
pub use expert::generate::{EXPERT_VERSION, generate_block};
pub use format::counts::Counts;
pub use format::dataset::{Case, Dataset};
pub use format::error::DatasetError;
pub use format::generator_notes::GeneratorNotes;
pub use format::meta::{BySplit, Meta, Units};
pub use paper::generator::{PAPER_VERSION, generate_paper_block};
pub use paper::target::TERMINALS;
pub use recipe::Recipe;
pub use row::{Check, Row, Split};
pub use training_rows::{TrainingRows, training_rows};
