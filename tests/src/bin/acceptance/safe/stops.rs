//! Stops and speed changes at every period, on motions with steps of jerk.

use crate::{Report, Scale};

pub(crate) fn run(_report: &mut Report, _scale: Scale) {}
