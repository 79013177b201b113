//! Files and options that were once taken without a word.

use crate::{Report, Scale};

pub(crate) fn run(_report: &mut Report, _scale: Scale) {}
