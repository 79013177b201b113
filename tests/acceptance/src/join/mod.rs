//! Other programs joined to the processes: by the wire alone, in other languages.

mod client_kills;
mod ended_loops;
mod ends;
mod examples;
mod guides;
mod heard_trips;
mod languages;
mod lines;
mod other_robots;
mod other_services;
mod plain_python;
mod python;
mod records;
mod servo_faults;
mod servos;
mod stamped_replies;
mod stamps;
mod transport;
mod wire_changes;

use self::examples::Examples;
use crate::report::Report;
use crate::scale::Scale;

/// The suite's groups, in this order.
pub(crate) const GROUPS: &[fn(&mut Report, Scale)] = &[
    |report, scale| of_language(&languages::rust(), report, scale),
    |report, scale| of_language(&languages::c(), report, scale),
    |report, scale| of_language(&languages::cpp(), report, scale),
    |report, scale| of_language(&languages::python(), report, scale),
    plain_python::run,
    |report, _| wire_changes::run(report),
    guides::run,
    servos::run,
    |report, _| servo_faults::run(report),
    transport::run,
    |report, _| stamps::run(report),
    |report, _| heard_trips::run(report),
    python::run,
    records::run,
];

fn of_language(examples: &Examples, report: &mut Report, scale: Scale) {
    examples.run(report);
    ended_loops::run(examples, report);
    other_robots::run(examples, report);
    other_services::run(examples, report);
    client_kills::run(examples, report, scale);
}
