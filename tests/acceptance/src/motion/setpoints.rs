//! What was sent to the robot, against its limits.

use tests::judge::{ALLOWED_USE, SENT_USE, Verdict};

use crate::report::Report;

/// Largest rounding between a set-point and the robot's reference that follows it, m.
const REFERENCE_ERROR_M: f64 = 1e-9;

/// The name of a line, from what it shows.
pub(super) type Line<'a> = &'a dyn Fn(&str) -> String;

/// The lines on limits.
pub(super) fn within_limits(report: &mut Report, line: Line, sent: &Verdict) {
    let name = line("set-points: velocity ÷ limit");
    report.at_most(&name, sent.velocity, SENT_USE);
    let name = line("set-points: acceleration ÷ limit");
    report.at_most(&name, sent.acceleration, SENT_USE);
    let steps = sent.sent.position.max(sent.sent.velocity);
    let name = line("set-points: steps by differences ÷ limits");
    report.at_most(&name, steps, ALLOWED_USE);
    let heard = format!(
        "{} set-points, {} robot states; not heard by the gaps in their numbers, with cycles: {:?} {:?}",
        sent.setpoints,
        sent.robot_states,
        sent.lost,
        sent.losses.first()
    );
    let name = line("what was looked at");
    let is_whole = sent.setpoints > 0 && sent.lost == [0; 3];
    report.check(&name, heard, "> 0 set-points, every one heard", is_whole);
    let name = line("robot states in fault, since a set-point broke a rule");
    report.at_most(&name, sent.faults as f64, 0.0);
    let name =
        line("largest distance of the robot's reference from the set-point that it follows, m");
    report.at_most(&name, sent.reference_error_m, REFERENCE_ERROR_M);
}

/// The line on offences.
pub(super) fn no_offences(report: &mut Report, line: Line, sent: &Verdict) {
    let offences = format!("{} {:?}", sent.offence_count, sent.offences.first());
    let name = line("set-points: offences");
    report.check(&name, offences, "0", sent.offence_count == 0);
}
