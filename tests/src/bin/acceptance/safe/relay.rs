//! A controller whose output stalls, many watchers, and replies that belong to another command.

use crate::{Report, Scale};

pub(crate) fn run(_report: &mut Report, _scale: Scale) {}
