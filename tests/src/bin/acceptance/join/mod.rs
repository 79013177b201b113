//! Other programs joined to the processes: by the wire alone, in other languages.

mod examples;
mod languages;
mod plain_python;
mod servos;

use crate::report::Report;
use crate::scale::Scale;

/// The suite's groups, in this order.
pub(crate) const GROUPS: &[fn(&mut Report, Scale)] = &[
    |report, _| languages::rust().run(report),
    |report, _| languages::c().run(report),
    |report, _| languages::cpp().run(report),
    |report, _| languages::python().run(report),
    |report, _| plain_python::run(report),
    servos::run,
];
