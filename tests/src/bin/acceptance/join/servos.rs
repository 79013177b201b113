//! The demonstration by a robot whose tendons Dynamixel servos wind.

use tests::brute_force::Body;
use tests::programs::repository;
use tests::servo_bank::{SERVOS, ServoBank};

use crate::demo::{judge, on_a_clean_clone};
use crate::report::Report;
use crate::scale::Scale;

/// Speed of the line, bit/s.
const BAUD: u32 = 4_000_000;
/// How slack each tendon is before it is homed, m.
const SLACK_M: [f64; SERVOS] = [0.002, 0.01, 0.0, 0.004, 0.02, 0.001, 0.006, 0.015, 0.003];

pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "scripts/demo --dynamixel FILE --record DIR";
    report.group("demonstration by servos", command, |report| {
        let folder = tempfile::tempdir()?;
        let robot_file = repository().join("config/robots/unit.toml");
        let text = std::fs::read_to_string(&robot_file)?;
        let table: toml::Table = text.parse()?;
        let radius_m = table["spool_radius_m"].as_float().unwrap_or(f64::NAN);
        let bank = ServoBank::start(&Body::from_robot_file(&text), radius_m, BAUD, SLACK_M);
        let config = folder.path().join("dynamixel-robot.toml");
        bank.write_config(&config, &robot_file);
        let recorded = folder.path().join("recording");
        let by_servos = ["--dynamixel", &config.to_string_lossy()];
        let printed = on_a_clean_clone(report, scale, folder.path(), &recorded, &by_servos)?;
        judge(report, &recorded, &printed)
    });
}
