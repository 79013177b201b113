//! Another user of the machine.

use crate::{Report, Scale};

pub(crate) fn run(_report: &mut Report, _scale: Scale) {}
