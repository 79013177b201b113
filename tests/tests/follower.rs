//! The controller within a program that moves the motors itself.
#![allow(clippy::unwrap_used)] // tests

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use controller::service::{ControllerConfig, FollowedCycle, Follower};
use robot_driver::TendonState;
use shared_types::codes::{LoopFault, LoopState, MotorFault};
use shared_types::ipc::IpcError;
use shared_types::valid::Goal;
use tests::process::wait_for;
use tests::stack::{PATIENCE, Part, Stack};
use tests::world::{Settings, World};

const TIP_M: [f64; 3] = [1.0, 0.5, 2.3];

fn open(world: &World) -> Result<Follower, IpcError> {
    let config = ControllerConfig::from_file(&world.config("controller.toml")).unwrap();
    Follower::open(config, &world.options, &TendonState::default())
}

/// A program's loop with motors that are at once where they are to be, and what it is told to do.
struct Program {
    shuts_down: Arc<AtomicBool>,
    is_in_fault: Arc<AtomicBool>,
    cycles: JoinHandle<Vec<FollowedCycle>>,
}

impl Program {
    fn start(world: &World) -> Self {
        let (shuts_down, is_in_fault) = (Arc::<AtomicBool>::default(), Arc::default());
        let (shut, fault) = (Arc::clone(&shuts_down), Arc::clone(&is_in_fault));
        let (options, config) = (world.options.clone(), world.config("controller.toml"));
        let cycles = thread::spawn(move || {
            let config = ControllerConfig::from_file(&config).unwrap();
            let mut follower = Follower::open(config, &options, &TendonState::default()).unwrap();
            let mut cycles = Vec::new();
            while let Some(cycle) = follower.next_cycle() {
                if shut.load(Ordering::Relaxed) {
                    follower.shut_down();
                }
                let fault: &AtomicBool = &fault;
                let fault = match fault.load(Ordering::Relaxed) {
                    true => MotorFault::Motor,
                    false => MotorFault::None,
                };
                follower.report(&cycle.targets.position_m, fault);
                cycles.push(cycle);
            }
            cycles
        });
        Self {
            shuts_down,
            is_in_fault,
            cycles,
        }
    }

    fn end(self) -> Vec<FollowedCycle> {
        self.shuts_down.store(true, Ordering::Relaxed);
        self.cycles.join().unwrap()
    }
}

/// A daemon, and a program that is in motion.
fn in_motion() -> (Stack, Program) {
    let mut stack = Stack::new(&Settings::default().patient());
    stack.start(Part::Daemon);
    stack.client.wait_for_daemon(PATIENCE).unwrap();
    let program = Program::start(&stack.world);
    wait_for("it holds", PATIENCE, || {
        let state = stack.controller.latest_state().ok().flatten()?;
        (state.state == LoopState::Holding).then_some(())
    })
    .unwrap();
    let id = stack.begin_motion(Goal::tip(TIP_M)).unwrap();
    stack.wait_for_progress(id, 0.3).unwrap();
    (stack, program)
}

/// That what the motors are to do changes within the limits, and ends at rest.
fn assert_comes_to_rest_within_limits(stack: &Stack, cycles: &[FollowedCycle]) {
    let limits = &stack.world.robot.tendon_limits;
    for pair in cycles.windows(2) {
        let [before, after] = [&pair[0].targets, &pair[1].targets];
        let elapsed_s = (after.stamp_ns - before.stamp_ns) as f64 * 1e-9;
        for motor in 0..before.velocity_m_s.len() {
            let change = (after.velocity_m_s[motor] - before.velocity_m_s[motor]).abs();
            assert!(
                change <= 1.001 * limits.acceleration * elapsed_s,
                "{change} in {elapsed_s} s: {pair:#?}"
            );
            assert!(after.velocity_m_s[motor].abs() <= 1.001 * limits.velocity);
        }
    }
    let fastest = |cycle: &FollowedCycle| {
        let speeds = cycle.targets.velocity_m_s.map(f64::abs);
        speeds.into_iter().fold(0.0, f64::max)
    };
    assert!(
        cycles.iter().map(fastest).fold(0.0, f64::max) > 0.01,
        "it moved"
    );
    assert!(fastest(cycles.last().unwrap()) < 1e-9, "it rests");
}

#[test]
fn a_program_that_ends_in_motion_comes_to_rest_first_and_leaves_the_place() {
    let (stack, program) = in_motion();
    assert!(matches!(
        open(&stack.world),
        Err(IpcError::AlreadyRunning { .. })
    ));
    let cycles = program.end();
    assert_comes_to_rest_within_limits(&stack, &cycles);
    let last = cycles.last().unwrap();
    let body = stack.world.body();
    let goal_m = body.tip_error(&last.commanded.position.into(), &TIP_M);
    assert!(goal_m > 0.05, "it stopped on the way: {goal_m} m");
    open(&stack.world).unwrap();
}

#[test]
fn motors_in_fault_come_to_rest_and_the_fault_is_told() {
    let (mut stack, program) = in_motion();
    program.is_in_fault.store(true, Ordering::Relaxed);
    let fault = wait_for("a fault", PATIENCE, || {
        let state = stack.controller.latest_state().ok().flatten()?;
        (state.fault != LoopFault::None).then_some(state.fault)
    });
    assert_eq!(fault.unwrap(), LoopFault::RobotFault);
    wait_for("it is at rest", PATIENCE, || {
        let state = stack.controller.latest_state().ok().flatten()?;
        (state.state == LoopState::Fault).then_some(())
    })
    .unwrap();
    let cycles = program.end();
    assert_comes_to_rest_within_limits(&stack, &cycles);
}
