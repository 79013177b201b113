//! `pcc goal`: a goal that the daemon keeps the robot on its way to.

use std::time::Duration;

use anyhow::bail;
use clap::{ArgAction, ArgGroup, Args};
use client::GoalSender;
use shared_types::capacity::DOF;
use shared_types::codes::GoalState;
use shared_types::ipc::IpcOptions;
use shared_types::valid::{Goal, GoalStatus};

use crate::number;
use crate::option_faults::MotionOptions;

/// How long a running daemon may take to show up or to reply.
const TIMEOUT: Duration = Duration::from_secs(5);
/// Time between two looks while the goal is followed.
const LOOK_INTERVAL: Duration = Duration::from_secs(1);

/// Arguments of `pcc goal`.
#[derive(Args)]
#[command(group(ArgGroup::new("goal").required(true)))]
pub(crate) struct Arguments {
    /// Tip position to reach, metres (-1000 to 1000), base frame.
    #[arg(long, num_args = 3, action = ArgAction::Set, value_parser = number::metres(), value_names = ["X", "Y", "Z"], group = "goal")]
    tip: Option<Vec<f64>>,
    /// Configuration to reach instead, radians (-π to π, and within the robot's bending limit).
    #[arg(long, num_args = 6, action = ArgAction::Set, value_parser = number::radians(), value_name = "RAD", group = "goal")]
    configuration: Option<Vec<f64>>,
    /// Share of the tendon limits to use (1e-9 to 1).
    #[arg(long, default_value_t = 1.0, value_parser = number::limits_scale())]
    limits_scale: f64,
    /// Stay, tell each change of what becomes of it, and end once the robot rests there, or the goal is ended (`pcc stop`): one without a way is
    /// tried for again and again, for obstacles may move.
    #[arg(long)]
    wait: bool,
}

/// Gives the goal; fails where it is ended or refused, or where no way to it is known when it is not waited for.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let mut goal = GoalSender::connect(&IpcOptions::from_env())?;
    goal.wait_for_daemon(TIMEOUT)?;
    goal.give(arguments.goal()?, arguments.limits_scale)?;
    goal.confirm(TIMEOUT)?;
    // As after a start of its controller the robot may be ready in a moment.
    let is_decided = |status: &GoalStatus| {
        !matches!(status.state, GoalState::Planning | GoalState::RobotNotReady)
    };
    let decided = goal.wait_for(TIMEOUT, is_decided)?;
    let Some(mut told) = decided.or(goal.status()?) else {
        bail!("the daemon has not said within {TIMEOUT:?} what becomes of the goal");
    };
    while arguments.wait && is_pursued(told.state) {
        say!("{told}");
        told = next_change(&mut goal, &told)?;
    }
    match told.state {
        GoalState::Underway | GoalState::Reached => {
            say!("{told}");
            Ok(())
        }
        _ => bail!("{}", arguments.explain(&told)),
    }
}

/// Waits until something else becomes of the goal, however long that takes; other numbers alone, as each try has, are no change.
fn next_change(goal: &mut GoalSender, told: &GoalStatus) -> anyhow::Result<GoalStatus> {
    let text = without_numbers(told);
    loop {
        let is_news = |status: &GoalStatus| without_numbers(status) != text;
        if let Some(status) = goal.wait_for(LOOK_INTERVAL, is_news)? {
            return Ok(status);
        }
        if goal.status()?.is_none() {
            bail!("the planner-daemon has ended, and the goal with it: the robot stops");
        }
    }
}

fn without_numbers(status: &GoalStatus) -> String {
    status
        .to_string()
        .replace(|it: char| it.is_ascii_digit(), "")
}

fn is_pursued(state: GoalState) -> bool {
    !matches!(
        state,
        GoalState::Reached | GoalState::Ended | GoalState::Refused
    )
}

impl Arguments {
    fn goal(&self) -> anyhow::Result<Goal> {
        if let Some(tip) = &self.tip {
            return Ok(Goal::tip(tip.as_slice().try_into()?));
        }
        let configuration = self.configuration.as_deref().unwrap_or(&[]);
        Ok(Goal::Configuration(<[f64; DOF]>::try_from(configuration)?))
    }

    /// Why the goal is not pursued, and the options that are at fault.
    fn explain(&self, status: &GoalStatus) -> String {
        let options = MotionOptions {
            start: None,
            tip: self.tip.as_deref(),
            configuration: self.configuration.as_deref(),
            balls: &[],
        };
        let fault = options.explain(status.outcome);
        let fault = fault.map_or_else(String::new, |fault| format!(" ({fault})"));
        let again = match is_pursued(status.state) {
            true => "; it is tried again until `pcc stop`",
            false => "",
        };
        format!("the robot is not on its way to the goal: {status}{fault}{again}")
    }
}
