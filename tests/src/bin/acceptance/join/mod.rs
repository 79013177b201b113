//! Other programs joined to the processes: by the wire alone, in other languages.

mod plain_python;

use crate::report::Report;
use crate::scale::Scale;

/// The suite's groups, in this order.
pub(crate) const GROUPS: &[fn(&mut Report, Scale)] = &[|report, _| plain_python::run(report)];
