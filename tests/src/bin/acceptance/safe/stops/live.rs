//! Stops and speed orders at random instants on the three processes, from what the controller publishes of each cycle.

use std::thread;
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use shared_types::codes::{LoopFault, LoopState};
use shared_types::message::Cycle;
use shared_types::valid::{Command, Goal};
use tests::listener::Listener;
use tests::motion::{LimitsKept, TendonSample};
use tests::stack::Stack;
use tests::world::Settings;

use crate::{Report, Scale};

/// Two shapes to go to and fro between, rad.
const SHAPES: [[f64; 6]; 2] = [
    [0.9, -0.6, 0.5, 0.7, -0.7, 0.9],
    [-0.8, 0.7, -0.6, -0.5, 0.8, -0.7],
];
const PROMPT: Duration = Duration::from_secs(5);

pub(super) fn run(report: &mut Report, scale: Scale) -> anyhow::Result<()> {
    let mut stack = Stack::running(&Settings::default())?;
    let listener = Listener::start(&stack.world.options);
    let mut random = Pcg64::seed_from_u64(1802);
    let (rounds, mut orders, mut faults) = (scale.pick(8, 40), 0, Vec::new());
    for round in 0..rounds {
        let id = stack.begin_motion(Goal::Configuration(SHAPES[round % 2]))?;
        stack.wait_for_progress(id, 0.0)?;
        for _ in 0..random.random_range(0..4) {
            thread::sleep(Duration::from_millis(random.random_range(0..500)));
            let speed = Command::SetSpeed(random.random_range(0.0..1.0));
            stack.controller.command(speed, PROMPT)?;
            orders += 1;
        }
        thread::sleep(Duration::from_millis(random.random_range(0..800)));
        // One that has ended has nothing to stop.
        let reply = stack.controller.command(Command::Stop, PROMPT)?;
        orders += usize::from(reply.accepted);
        let ended = stack.wait_for_end(id);
        let state = stack.controller_state();
        if ended.is_err() || state.fault != LoopFault::None {
            faults.push(format!("round {round}: {}, {}", state.state, state.fault));
            stack.wait_until_ready()?;
        }
        stack.controller.command(Command::SetSpeed(1.0), PROMPT)?;
    }
    thread::sleep(Duration::from_millis(100));
    judge(report, &listener.take().cycles, &stack, orders);
    report.none_of("live: rounds that ended in a fault", &faults);
    Ok(())
}

fn judge(report: &mut Report, cycles: &[Cycle], stack: &Stack, orders: usize) {
    let held = [
        LoopState::Holding,
        LoopState::Executing,
        LoopState::Stopping,
    ]
    .map(LoopState::code);
    let samples: Vec<TendonSample> = cycles.iter().map(sample).collect();
    let limits = &stack.world.robot.tendon_limits;
    let mut kept = LimitsKept::default();
    let mut pairs = 0;
    for (pair, two) in cycles.windows(2).zip(samples.windows(2)) {
        if pair.iter().all(|cycle| held.contains(&cycle.state))
            && pair[1].sequence == pair[0].sequence + 1
        {
            pairs += 1;
            kept.add(&two[1], limits);
            kept.add_neighbours(&two[0], &two[1], limits);
        }
    }
    report.check(
        "live: stops and speed orders obeyed, cycles recorded",
        format!("{orders} orders, {pairs} cycles"),
        "some tens of orders, a recording",
        orders >= 10 && pairs > 5_000,
    );
    let figures = [
        ("velocity sent ÷ limit", kept.velocity, super::ROUNDING),
        (
            "acceleration sent ÷ limit",
            kept.acceleration,
            super::ROUNDING,
        ),
        (
            "step ÷ time ÷ velocity limit",
            kept.difference_velocity,
            super::ROUNDING,
        ),
        (
            "velocity step ÷ time ÷ acceleration limit",
            kept.difference_acceleration,
            1.0 + 1e-4,
        ),
        (
            "step unexplained by its velocities ÷ a Δt²",
            kept.unexplained_step,
            0.25 + 1e-3,
        ),
    ];
    for (what, figure, bar) in figures {
        report.at_most(&format!("live: {what}"), figure, bar);
    }
}

fn sample(cycle: &Cycle) -> TendonSample {
    TendonSample {
        stamp_ns: cycle.stamp_mono_ns,
        position: cycle.setpoint_m,
        velocity: cycle.setpoint_velocity_m_s,
        acceleration: cycle.setpoint_acceleration_m_s2,
    }
}
