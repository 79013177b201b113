//! Sets of sections of the body, for questions about some of them only.

use pcc_model::SECTIONS;

/// A set of sections: true for those that are measured.
pub(crate) type Chosen = [bool; SECTIONS];
/// The set of all sections.
pub(crate) const EVERY_SECTION: Chosen = [true; SECTIONS];
/// The empty set of sections.
pub(crate) const NO_SECTION: Chosen = [false; SECTIONS];
