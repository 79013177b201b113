//! The live scene's age, clock and owner, and supervision after a stall.

mod crossing;
mod executed;
mod flood;
mod lag;
mod owners;
mod scenario;
mod stall;

use crate::report::Report;
use crate::scale::Scale;

pub(crate) fn run(report: &mut Report, scale: Scale) {
    let command = "acceptance safe, scene";
    report.group("scene: supervision after a stall", command, |report| {
        stall::whole_machine(report, scale)
    });
    report.group("scene: old trajectories", command, stall::old_trajectory);
    report.group("scene: stamps", command, owners::stamps);
    report.group("scene: owners", command, |report| {
        owners::dead_publisher(report)?;
        owners::silent_source(report, scale)?;
        owners::restarted_daemon(report, scale)?;
        owners::ended_program(report, scale)?;
        owners::nobody_serves_command(report)
    });
    report.group("scene: path time that lags", command, |report| {
        lag::late_beside_a_ball(report, scale)
    });
    report.group("scene: flood", command, |report| flood::run(report, scale));
}
