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
    format!(
        "{}: {}",
        output.waiting,
        allowed(output, settings, own_robot)
    )
}

/// What is allowed where the loop does not hold the robot, without what it waits for: short enough to be told behind a fault.
pub(super) fn allowed(
    output: &CycleOutput,
    settings: &ExecutiveSettings,
    own_robot: u64,
) -> String {
    let lost_ms = milliseconds(settings.robot_lost_ns);
    let refused = format!("{} refused", output.refused_robot_states);
    match output.waiting {
        Waiting::None => "held".to_owned(),
        Waiting::OtherRobot => format!(
            "{:016x}, this controller's is {own_robot:016x}",
            output.robot_hash
        ),
        Waiting::OffTendonMap => {
            let residual_m = output.accepted_residual_m;
            format!("{residual_m:.1e} m off, {CONSISTENCY_M:.0e} m are allowed")
        }
        Waiting::NoRobotState => format!("{lost_ms} ms without one are allowed"),
        Waiting::InvalidRobotState => {
            format!("{refused}, only what docs/wire.md says is allowed")
        }
        Waiting::RepeatedRobotState => format!("{refused}, only newer stamps are allowed"),
        Waiting::OldRobotState => format!("{refused}, {lost_ms} ms of age are allowed"),
        Waiting::FutureRobotState => {
            let ahead_ms = milliseconds(STAMP_ALLOWANCE_NS);
            format!("{refused}, {ahead_ms} ms ahead are allowed")
        }
        Waiting::RobotFault => "only a state without a fault is allowed".to_owned(),
        Waiting::RobotMoves => "only idle or at rest after loss, at 0 m/s, is allowed".to_owned(),
        Waiting::RobotFollowsAnother => "only idle or at rest after loss is allowed".to_owned(),
        Waiting::NotTakenUp if output.state == LoopState::Fault => {
            "none are sent before a reset".to_owned()
        }
        Waiting::NotTakenUp => format!("{} ms are allowed", milliseconds(ROBOT_REPLY_TIMEOUT_NS)),
        Waiting::OffReference => {
            format!("{} rad are allowed", settings.off_reference_limit_rad())
        }
    }
}

/// Whole milliseconds.
fn milliseconds(interval_ns: i64) -> i64 {
    interval_ns / 1_000_000
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{SETTINGS, World};
    use shared_types::capacity::REASON_BYTES;

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
            "robot state too old: 12 refused, 20 ms of age are allowed"
        );
        (output.waiting, output.robot_hash) = (Waiting::OtherRobot, 0xab);
        assert_eq!(
            waiting(&output, &SETTINGS, 7),
            "another robot: 00000000000000ab, this controller's is 0000000000000007"
        );
    }

    #[test]
    fn what_is_allowed_is_told_behind_the_longest_fault() {
        let mut output = World::holding().last.unwrap();
        output.fault = LoopFault::TrackingError;
        (output.trajectory_id, output.path_time_s) = (u32::MAX, 999.999);
        output.refused_robot_states = 10_000;
        let fault = fault(&output, &SETTINGS);
        for &reason in Waiting::ALL {
            output.waiting = reason;
            let allowed = allowed(&output, &SETTINGS, u64::MAX);
            let told = format!("{fault}; not held: {allowed}");
            assert!(told.len() <= REASON_BYTES, "{} bytes: {told}", told.len());
            let is_told = ["allowed", "this controller's", "held"];
            assert!(
                is_told.iter().any(|it| allowed.contains(it)),
                "{reason}: {allowed}"
            );
        }
        output.waiting = Waiting::NotTakenUp;
        assert_eq!(
            waiting(&output, &SETTINGS, 7),
            "set-points not taken up: 200 ms are allowed"
        );
        output.state = LoopState::Fault;
        let said = waiting(&output, &SETTINGS, 7);
        assert_eq!(
            said,
            "set-points not taken up: none are sent before a reset"
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
