//! Which sections of the body a question is about.

use pcc_model::SECTIONS;

/// Which sections are looked at.
pub(crate) type Chosen = [bool; SECTIONS];
/// All of them.
pub(crate) const EVERY_SECTION: Chosen = [true; SECTIONS];
/// None of them.
pub(crate) const NO_SECTION: Chosen = [false; SECTIONS];
