//! The live scene's age, clock and owner, and supervision after a stall.

use crate::{Report, Scale};

pub(crate) fn run(_report: &mut Report, _scale: Scale) {}
