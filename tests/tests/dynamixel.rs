//! A robot whose tendons nine Dynamixel servos wind: homed, driven, and with what goes wrong on its line.
#![allow(clippy::unwrap_used)] // tests

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use shared_types::codes::LoopFault;
use shared_types::valid::Goal;
use tests::process::wait_for;
use tests::servo_bank::Faults;
use tests::servo_stack::{BAUD, ServoStack, bank, home, start};
use tests::stack::PATIENCE;
use tests::world::{Settings, World};

const TIP_M: [f64; 3] = [1.0, 0.5, 2.3];

/// Held by each test while it runs: servos answer within a millisecond, so that two banks are too much for two processors.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Daemon and controller, and a driver of servos that were homed.
fn driven() -> ServoStack {
    ServoStack::driven(&Settings::default().patient()).unwrap()
}

fn hold(all: &mut ServoStack) {
    let held = all.hold();
    held.unwrap_or_else(|error| panic!("{error}: {}", all.driver.log()));
}

#[test]
fn a_homed_robot_goes_where_it_is_sent() {
    let _alone = alone();
    let mut all = driven();
    let begun_m = all.bank.lengths_m();
    let id = all.stack.begin_motion(Goal::tip(TIP_M)).unwrap();
    all.stack.wait_for_end(id).unwrap();
    hold(&mut all);
    let state = all.stack.controller_state();
    let measured = &state.values.measured_configuration_rad;
    let body = all.stack.world.body();
    let error_m = body.tip_error(measured, &TIP_M);
    assert!(error_m <= 0.03, "{error_m} m: {}", all.driver.log());
    // What the motors did themselves, without the driver's word for it: relative to the homed robot.
    let ended_m = all.bank.lengths_m();
    let moved_m = std::array::from_fn(|k| ended_m[k] - begun_m[k]);
    let shape = body.explain(&moved_m).configuration;
    let error_m = body.tip_error(&shape, &TIP_M);
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
    assert!(home(&world).unwrap().0);
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
    let (is_homed, said) = home(&world).unwrap();
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
    assert!(home(&world).unwrap().0);
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
    let mut all = driven();
    all.bank
        .set(|faults| (faults.drop_one_in, faults.damage_one_in) = (17, 23));
    let id = all.stack.begin_motion(Goal::tip(TIP_M)).unwrap();
    let ended = all.stack.wait_for_end(id);
    ended.unwrap_or_else(|error| panic!("{error}: {}", all.driver.log()));
    hold(&mut all);
    all.bank.set(|faults| faults.unplugged = true);
    let controller = &mut all.stack.controller;
    let fault = wait_for("a fault", PATIENCE, || {
        let state = controller.latest_state().ok().flatten()?;
        (state.fault != LoopFault::None).then_some(state.fault)
    });
    assert_eq!(fault.unwrap(), LoopFault::RobotFault);
    let driver = &all.driver;
    let told = wait_for("the driver tells", PATIENCE, || {
        driver.log().contains("no servo answers").then_some(())
    });
    told.unwrap_or_else(|error| panic!("{error}: {}", driver.log()));
    // Plugged in again, the line must be opened anew.
    all.bank.set(|faults| *faults = Faults::default());
    all.driver.sigterm(PATIENCE).unwrap();
    all.driver = start(&all.stack.world, "dynamixel-robot", &[]);
    all.stack.clear_fault().unwrap();
    let id = all.stack.begin_motion(Goal::tip(TIP_M)).unwrap();
    let ended = all.stack.wait_for_end(id);
    ended.unwrap_or_else(|error| panic!("{error}: {}", all.driver.log()));
}

#[test]
fn replies_that_come_in_the_next_cycle_are_borne() {
    let _alone = alone();
    let mut all = ServoStack::driven(&Settings::default()).unwrap();
    let said_before = all.driver.log().len();
    all.bank
        .set(|faults| faults.late = Duration::from_millis(5));
    let id = all.stack.begin_motion(Goal::tip(TIP_M)).unwrap();
    let ended = all.stack.wait_for_end(id);
    ended.unwrap_or_else(|error| panic!("{error}: {}", all.driver.log()));
    let said = all.driver.log();
    assert!(!said[said_before..].contains("WARN"), "{said}");
}
