//! `pcc watch`: the live state of controller and robot, and of the goal that stays, in the terminal.

use crate::number::{any, real};
use clap::Args;
use client::{ControllerView, GoalView, ResultView, RobotView};
use shared_types::clock::mono_now_ns;
use shared_types::codes::{LoopFault, MotorFault, Refusal, Waiting};
use shared_types::ipc::IpcOptions;
use shared_types::lateness::quantile_ns;
use shared_types::valid::{ControllerState, GoalStatus, MotionResult, RobotState};
use signal_hook::consts::{SIGINT, SIGTERM};
use std::io::{ErrorKind, IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Arguments of `pcc watch`.
#[derive(Args)]
pub(crate) struct Arguments {
    /// Times a second, 0.1 to 100.
    #[arg(long, default_value_t = 5.0, value_parser = real(0.1, 100.0, " Hz"))]
    rate_hz: f64,
    /// Show the state this many times (0 to 2^64 - 1), then end (0: until interrupted).
    #[arg(long, default_value_t = 0, value_parser = any())]
    times: u64,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let options = IpcOptions::from_env();
    let (mut controller, mut robot, mut results, mut goal) = (
        ControllerView::watch(&options)?,
        RobotView::watch(&options)?,
        ResultView::watch(&options)?,
        GoalView::watch(&options)?,
    );
    let pause = Duration::from_secs_f64(1.0 / arguments.rate_hz);
    let mut out = std::io::stdout();
    let clear = if out.is_terminal() {
        "\x1b[H\x1b[2J"
    } else {
        ""
    };
    let interrupted = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::clone(&interrupted))?;
    }
    let mut shown = 0;
    while !interrupted.load(Ordering::Relaxed) && (arguments.times == 0 || shown < arguments.times)
    {
        std::thread::sleep(pause);
        let lines = [
            describe_controller(controller.latest_state()?),
            describe_robot(robot.latest()?),
            describe_result(results.latest()?),
            describe_goal(goal.latest()?),
        ]
        .join("\n");
        let written = writeln!(out, "{clear}{lines}").and_then(|()| out.flush());
        match written {
            Err(error) if error.kind() == ErrorKind::BrokenPipe => break,
            written => written?,
        }
        shown += 1;
    }
    Ok(())
}

fn age_ms(stamp_mono_ns: i64) -> f64 {
    (mono_now_ns() - stamp_mono_ns) as f64 * 1e-6
}

fn list(values: &[f64]) -> String {
    values
        .iter()
        .map(|v| format!("{v:8.4}"))
        .collect::<Vec<_>>()
        .join(" ")
}

fn describe_controller(state: Option<ControllerState>) -> String {
    let Some(state) = state else {
        return "controller     not seen yet".into();
    };
    let v = &state.values;
    let mut lines = vec![
        format!(
            "controller     {}   {:.0} ms ago, cycle {}",
            state.state,
            age_ms(v.stamp_mono_ns),
            v.cycle
        ),
        format!(
            "trajectory     {}   at {:.2} s, rate {:.2}, ordered speed {}",
            v.trajectory_id, v.trajectory_time_s, v.rate, v.speed
        ),
        format!("commanded rad  {}", list(&v.commanded_configuration_rad)),
        format!("measured rad   {}", list(&v.measured_configuration_rad)),
        format!(
            "tracking       {:.5} rad, slack {:.2e} m, splice {:.2e} m",
            v.tracking_error_rad, v.slack_residual_m, v.splice_error_m
        ),
        format!(
            "loop           {}, late {} (longest run {})",
            lateness(&v.lateness_histogram),
            v.late_cycles,
            v.longest_late_run
        ),
        format!(
            "allocations    {} from the loop's arena for {} set-points, {} from the system",
            v.loop_arena_allocations, v.setpoints_sent, v.loop_system_allocations
        ),
    ];
    if state.fault != LoopFault::None {
        lines.push(format!("FAULT          {}: {}", state.fault, v.reason));
    }
    if state.waiting != Waiting::None {
        lines.push(format!(
            "waiting        {}: {} (accepted set-point {:.2e} m off the tendon map, {} robot states refused)",
            state.waiting, v.reason, v.accepted_residual_m, v.refused_robot_states
        ));
    }
    if state.refusal != Refusal::None {
        lines.push(format!(
            "refused        trajectory {}: {}",
            v.refused_trajectory_id, state.refusal
        ));
    }
    lines.join("\n")
}

fn lateness(histogram: &[u32; shared_types::capacity::HISTOGRAM_BINS]) -> String {
    let at = |share: f64| {
        quantile_ns(histogram, share)
            .map_or("-".to_owned(), |ns| format!("{:.0}", ns as f64 * 1e-3))
    };
    format!(
        "wake-up p50 {} µs, p99 {} µs, p99.9 {} µs",
        at(0.5),
        at(0.99),
        at(0.999)
    )
}

fn describe_result(result: Option<MotionResult>) -> String {
    let Some(result) = result else {
        return "last motion    none ended yet".into();
    };
    let v = &result.values;
    format!(
        "last motion    trajectory {} of plan {}, {:.2} of {:.2} s: {result}",
        v.trajectory_id, v.plan_id, v.path_time_s, v.duration_s
    )
}

fn describe_goal(status: Option<GoalStatus>) -> String {
    let Some(status) = status else {
        return "goal           none heard of yet".into();
    };
    let v = &status.values;
    format!(
        "goal           {status}   {:.0} ms ago, {} plans, {} motions",
        age_ms(v.stamp_mono_ns),
        v.plan_count,
        v.motion_count
    )
}

fn describe_robot(state: Option<RobotState>) -> String {
    let Some(state) = state else {
        return "robot          not seen yet".into();
    };
    let v = &state.values;
    let mut text = format!(
        "robot          {}   {:.0} ms ago, {} ramps to rest, {} set-points refused\ntendons mm     {}",
        state.state,
        age_ms(v.stamp_mono_ns),
        v.ramps_to_rest,
        v.rejected_setpoints,
        list(&v.measured_tendon_m.map(|m| 1e3 * m)),
    );
    if state.fault != MotorFault::None {
        text.push_str(&format!("\nROBOT FAULT    {}", state.fault));
    }
    text
}
