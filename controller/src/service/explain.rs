//! What the controller does and why, in words: the texts beside the codes of its messages.

use shared_types::codes::{CommandRefusal, LoopFault, LoopState, Waiting};
use shared_types::valid::Command;

use super::link::Outcome;
use crate::executive::{
    CONSISTENCY_M, CycleOutput, ExecutiveSettings, ROBOT_REPLY_TIMEOUT_NS, STAMP_ALLOWANCE_NS,
};

/// What became of a command.
pub(super) fn outcome(command: Command, outcome: &Outcome) -> String {
    let state = outcome.state;
    match outcome.result {
        Ok(()) => carried_out(command, state),
        Err(CommandRefusal::NothingToDo) => format!("the controller is {state}: {}", idle(command)),
        Err(CommandRefusal::FaultPersists) => {
            format!("the controller is {state}: a fault is reset once the robot is at rest")
        }
        Err(refusal) => refusal.to_string(),
    }
}

fn carried_out(command: Command, state: LoopState) -> String {
    match (command, state) {
        (Command::Stop, LoopState::Stopping) => "the robot brakes along its path".to_owned(),
        (Command::Stop, _) => "the motion that waited for its begin is set aside".to_owned(),
        (Command::ResetFault, LoopState::Starting) => {
            "the fault is cleared; the robot is not held yet".to_owned()
        }
        (Command::ResetFault, _) => "nothing that was requested before it begins".to_owned(),
        (Command::SetSpeed(speed), _) => format!("motions are followed at speed {speed}"),
        (Command::Pause, _) => "the robot brakes along its path, and the motion is kept".to_owned(),
        (Command::Resume, _) => "the motion goes on".to_owned(),
    }
}

fn idle(command: Command) -> &'static str {
    match command {
        Command::Stop => "nothing moves or waits for its begin",
        Command::ResetFault => "there is no fault, and nothing waits for its begin",
        Command::SetSpeed(_) => "its speed cannot be set",
        Command::Pause => "no motion is executed that could pause",
        Command::Resume => "no motion is paused",
    }
}

/// What happened when a fault was latched, by the cycle that reports it first.
pub(super) fn fault(output: &CycleOutput, settings: &ExecutiveSettings) -> String {
    let what = match output.fault {
        LoopFault::RobotLost => {
            let limit_ms = milliseconds(settings.robot_lost_ns);
            format!("no newer state of the robot for over {limit_ms} ms")
        }
        LoopFault::TooLate => {
            let limit_ms = milliseconds(settings.late_run_ns);
            format!("late cycles one after the other for over {limit_ms} ms")
        }
        LoopFault::TrackingError => {
            let error_rad = output.tracking_error_rad;
            let allowed_rad = output.path_tolerance_rad;
            format!("the robot is {error_rad:.4} rad off its path, {allowed_rad:.4} are allowed")
        }
        fault => fault.to_string(),
    };
    match output.trajectory_id {
        0 => what,
        id => format!("{what}; trajectory {id} at {:.3} s", output.path_time_s),
    }
}

/// What the loop waits for, where it does not hold the robot, and what is allowed; `own_robot` is the hash of the controller's robot file.
pub(super) fn waiting(
    output: &CycleOutput,
    settings: &ExecutiveSettings,
    own_robot: u64,
) -> String {
    let lost_ms = milliseconds(settings.robot_lost_ns);
    let reason = output.waiting;
    let why = match reason {
        Waiting::None | Waiting::RobotFault => return reason.to_string(),
        Waiting::OtherRobot => format!(
            "{:016x}, this controller's is {own_robot:016x}",
            output.robot_hash
        ),
        Waiting::OffTendonMap => format!(
            "it is {:.1e} m off the tendon lengths of the nearest one, {CONSISTENCY_M:.0e} m are allowed",
            output.accepted_residual_m
        ),
        Waiting::NoRobotState => format!("{lost_ms} ms without one are allowed"),
        Waiting::InvalidRobotState => refused(output, "the codes of the wire and finite numbers"),
        Waiting::RepeatedRobotState => refused(output, "stamps later than the one before"),
        Waiting::OldRobotState => refused(output, &format!("states up to {lost_ms} ms old")),
        Waiting::FutureRobotState => {
            let ahead_ms = milliseconds(STAMP_ALLOWANCE_NS);
            refused(output, &format!("stamps up to {ahead_ms} ms ahead"))
        }
        Waiting::RobotMoves => "an accepted set-point without velocity is allowed".to_owned(),
        Waiting::RobotFollowsAnother => "a robot that follows none is allowed".to_owned(),
        Waiting::NotTakenUp => {
            let reply_ms = milliseconds(ROBOT_REPLY_TIMEOUT_NS);
            format!("{reply_ms} ms until it follows them are allowed")
        }
        Waiting::OffReference => {
            let allowed_rad = settings.off_reference_rad();
            format!("{allowed_rad} rad are allowed")
        }
    };
    format!("{reason}: {why}")
}

/// Whole milliseconds.
fn milliseconds(interval_ns: i64) -> i64 {
    interval_ns / 1_000_000
}

fn refused(output: &CycleOutput, allowed: &str) -> String {
    let count = output.refused_robot_states;
    format!("{count} states refused so far, {allowed} are allowed")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{SETTINGS, World};

    #[test]
    fn a_fault_says_by_how_much_and_where_on_which_trajectory() {
        let mut output = World::holding().last.unwrap();
        output.fault = LoopFault::TrackingError;
        (output.tracking_error_rad, output.path_tolerance_rad) = (0.0612, 0.05);
        let said = fault(&output, &SETTINGS);
        assert_eq!(
            said,
            "the robot is 0.0612 rad off its path, 0.0500 are allowed"
        );
        output.fault = LoopFault::RobotLost;
        (output.trajectory_id, output.path_time_s) = (7, 1.25);
        let said = fault(&output, &SETTINGS);
        let expected = "no newer state of the robot for over 20 ms; trajectory 7 at 1.250 s";
        assert_eq!(said, expected);
    }

    #[test]
    fn what_is_waited_for_says_what_is_allowed() {
        let mut output = World::holding().last.unwrap();
        (output.waiting, output.accepted_residual_m) = (Waiting::OffTendonMap, 3.2e-4);
        let said = waiting(&output, &SETTINGS, 7);
        assert!(
            said.contains("3.2e-4 m off") && said.contains("1e-6 m are allowed"),
            "{said}"
        );
        (output.waiting, output.refused_robot_states) = (Waiting::OldRobotState, 12);
        assert_eq!(
            waiting(&output, &SETTINGS, 7),
            "robot state too old: 12 states refused so far, states up to 20 ms old are allowed"
        );
        (output.waiting, output.robot_hash) = (Waiting::OtherRobot, 0xab);
        assert_eq!(
            waiting(&output, &SETTINGS, 7),
            "another robot: 00000000000000ab, this controller's is 0000000000000007"
        );
    }

    #[test]
    fn a_command_without_effect_says_what_the_controller_does() {
        let refused = Outcome {
            result: Err(CommandRefusal::NothingToDo),
            state: LoopState::Holding,
        };
        let said = outcome(Command::Resume, &refused);
        assert_eq!(said, "the controller is holding: no motion is paused");
    }
}
