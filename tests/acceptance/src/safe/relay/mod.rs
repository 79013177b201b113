//! A controller whose output stalls or one of whose threads is held, many watchers, and replies that belong to another command.
//!
//! Orders are given by `pcc`, and the robot is judged by the file in which it keeps its pose: the checks join no service.

mod held;
mod processes;
mod replies;
mod watchers;

use crate::report::Report;
use crate::scale::Scale;

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "acceptance safe, relay";
    report.group("relay: stalled output, held threads", command, |report| {
        held::run(report, scale)
    });
    report.group("relay: watchers", command, |report| {
        watchers::run(report, scale)
    });
    report.group("relay: replies", command, |report| {
        replies::run(report, scale)
    });
}
