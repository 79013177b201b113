//! A robot whose tendons nine Dynamixel servos wind: homed, driven, and with what goes wrong on its line.
#![allow(clippy::unwrap_used)] // tests

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use shared_types::codes::{LoopFault, LoopState};
use shared_types::valid::Goal;
use tests::process::{Process, wait_for};
use tests::servo_bank::ServoBank;
use tests::stack::{PATIENCE, Part, Stack, tip_error};
use tests::world::{Settings, World};

const TIP_M: [f64; 3] = [1.0, 0.5, 2.3];
const BAUD: u32 = 4_000_000;

/// Held by each test while it runs: servos answer within a millisecond, so that two banks are too much for two processors.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A bank of servos for the robot of a world, and the configuration that names its line.
fn bank(world: &World, baud: u32) -> ServoBank {
    let slack_m = std::array::from_fn(|k| 0.002 * (k + 1) as f64);
    let bank = ServoBank::start(&world.body(), world.robot.spool_radius, baud, slack_m);
    let config = world.config("dynamixel-robot.toml");
    bank.write_config(&config, &world.config("robots/unit.toml"));
    bank
}

fn start(world: &World, name: &str, before: &[&str]) -> Process {
    let config = world.config("dynamixel-robot.toml");
    let mut arguments = before.to_vec();
    arguments.extend(["--config", config.to_str().unwrap()]);
    Process::start(world, name, &arguments)
}

fn home(world: &World) -> (bool, String) {
    let mut homing = start(world, "pcc", &["home"]);
    let status = homing.wait(Duration::from_secs(60)).unwrap();
    (status.success(), homing.log())
}

/// Daemon and controller, and a driver of servos that were homed.
fn driven() -> (Stack, ServoBank, Process) {
    let mut stack = Stack::new(&Settings::default());
    let bank = bank(&stack.world, BAUD);
    let (is_homed, said) = home(&stack.world);
    assert!(is_homed, "{said}");
    let driver = start(&stack.world, "dynamixel-robot", &[]);
    stack.start(Part::Daemon);
    stack.start(Part::Controller);
    stack.client.wait_for_daemon(PATIENCE).unwrap();
    hold(&mut stack, &driver);
    (stack, bank, driver)
}

fn hold(stack: &mut Stack, driver: &Process) {
    let held = wait_for("the robot is held", PATIENCE, || {
        let state = stack.controller.latest_state().ok().flatten()?;
        (state.state == LoopState::Holding).then_some(())
    });
    held.unwrap_or_else(|error| panic!("{error}: {}", driver.log()));
}

#[test]
fn a_homed_robot_goes_where_it_is_sent() {
    let _alone = alone();
    let (mut stack, bank, driver) = driven();
    let begun_m = bank.lengths_m();
    let id = stack.begin_motion(Goal::tip(TIP_M)).unwrap();
    stack.wait_for_end(id).unwrap();
    hold(&mut stack, &driver);
    let state = stack.controller_state();
    let measured = &state.values.measured_configuration_rad;
    let error_m = tip_error(&stack.world.robot, measured, &TIP_M);
    assert!(error_m <= 0.03, "{error_m} m: {}", driver.log());
    // What the motors did themselves, without the driver's word for it: relative to the homed robot.
    let ended_m = bank.lengths_m();
    let moved_m = std::array::from_fn(|k| ended_m[k] - begun_m[k]);
    let shape = stack.world.body().explain(&moved_m).configuration;
    let error_m = tip_error(&stack.world.robot, &shape, &TIP_M);
    assert!(error_m <= 0.03, "{error_m} m");
}

#[test]
fn a_robot_is_driven_only_where_its_servos_still_know_their_home() {
    let _alone = alone();
    let world = World::new(&Settings::default());
    let bank = bank(&world, BAUD);
    let refused = |reason: &str| {
        let mut driver = start(&world, "dynamixel-robot", &[]);
        let status = driver.wait(PATIENCE).unwrap();
        assert!(!status.success());
        assert!(driver.log().contains(reason), "{}", driver.log());
    };
    refused("`pcc home`");
    assert!(home(&world).0);
    bank.set(|faults| faults.unpowered = Some(4));
    refused("servo 5 does not answer");
    bank.set(|faults| faults.unpowered = None);
    refused("servo 5 was without power since the robot was homed");
}

#[test]
fn homing_says_which_tendon_is_loose_and_lets_go() {
    let _alone = alone();
    let world = World::new(&Settings::default());
    let bank = bank(&world, BAUD);
    bank.set(|faults| faults.loose = Some(6));
    let (is_homed, said) = home(&world);
    assert!(!is_homed);
    assert!(
        said.contains("the tendon of servo 7 was wound by 3 turns and is not tense"),
        "{said}"
    );
}

#[test]
fn a_line_that_is_too_slow_for_the_loop_is_said_at_the_start() {
    let _alone = alone();
    let world = World::new(&Settings::default());
    let _bank = bank(&world, 57_600);
    assert!(home(&world).0);
    let mut driver = start(&world, "dynamixel-robot", &[]);
    assert!(!driver.wait(PATIENCE).unwrap().success());
    assert!(
        driver.log().contains("the serial line is too slow"),
        "{}",
        driver.log()
    );
}

#[test]
fn lost_and_damaged_packets_are_borne_and_a_lost_line_is_a_fault() {
    let _alone = alone();
    let (mut stack, bank, driver) = driven();
    bank.set(|faults| (faults.drop_one_in, faults.damage_one_in) = (17, 23));
    let id = stack.begin_motion(Goal::tip(TIP_M)).unwrap();
    let ended = stack.wait_for_end(id);
    ended.unwrap_or_else(|error| panic!("{error}: {}", driver.log()));
    hold(&mut stack, &driver);
    bank.set(|faults| faults.unplugged = true);
    let fault = wait_for("a fault", PATIENCE, || {
        let state = stack.controller.latest_state().ok().flatten()?;
        (state.fault != LoopFault::None).then_some(state.fault)
    });
    assert_eq!(fault.unwrap(), LoopFault::RobotFault);
    let told = wait_for("the driver tells", PATIENCE, || {
        driver.log().contains("no servo answers").then_some(())
    });
    told.unwrap_or_else(|error| panic!("{error}: {}", driver.log()));
}
