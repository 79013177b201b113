//! The demonstration by a robot whose tendons Dynamixel servos wind.

use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{scope, sleep};
use std::time::Duration;

use anyhow::ensure;
use pcc_model::Robot;
use shared_types::clock::mono_now_ns;
use tests::brute_force::Body;
use tests::programs::repository;
use tests::recording::Recording;
use tests::servo_bank::{SERVOS, ServoBank};

use super::ends::Ends;
use crate::demo::{judge, on_a_clean_clone};
use crate::report::Report;
use crate::scale::Scale;

/// Speed of the line, bit/s.
const BAUD: u32 = 4_000_000;
/// How slack each tendon is before it is homed, m.
const SLACK_M: [f64; SERVOS] = [0.002, 0.01, 0.0, 0.004, 0.02, 0.001, 0.006, 0.015, 0.003];
/// Time between two looks at the bank's tendons.
const LOOK: Duration = Duration::from_millis(10);
/// When a motion has come to rest after its last set-point, and until when it holds at least, ns.
const HOLD_NS: [i64; 2] = [500_000_000, 800_000_000];

pub(super) fn run(report: &mut Report, scale: Scale) {
    let command = "scripts/demo --dynamixel FILE --record DIR";
    report.group("demonstration by servos", command, |report| {
        let folder = tempfile::tempdir()?;
        let robot_file = repository().join("config/robots/unit.toml");
        let text = std::fs::read_to_string(&robot_file)?;
        let table: toml::Table = text.parse()?;
        let radius_m = table["spool_radius_m"].as_float().unwrap_or(f64::NAN);
        let body = Body::from_robot_file(&text);
        let bank = ServoBank::start(&body, radius_m, BAUD, SLACK_M);
        report.shown("settings of the driver", ServoBank::settings());
        let config = folder.path().join("dynamixel-robot.toml");
        bank.write_config(&config, &robot_file, None);
        let recorded = folder.path().join("recording");
        let by_servos = ["--dynamixel", &config.to_string_lossy()];
        let (printed, wound) = WoundTendons::watch(&bank, || {
            on_a_clean_clone(report, scale, folder.path(), &recorded, &by_servos)
        });
        judge(report, &recorded, &printed?)?;
        let robot = Robot::from_file(&robot_file)?;
        let by_servos = Recording::read(&recorded)?;
        tips(report, &by_servos, &robot, &body, &wound)?;
        let recorded = folder.path().join("recording-of-the-simulated-robot");
        on_a_clean_clone(report, scale, folder.path(), &recorded, &[])?;
        same_figures(report, &by_servos, &Recording::read(&recorded)?, &body)
    });
}

/// Holds the motions by servos against those of the simulated robot: the same ones, as fast, to the same tips, as far from the obstacles.
fn same_figures(
    report: &mut Report,
    by_servos: &Recording,
    simulated: &Recording,
    body: &Body,
) -> anyhow::Result<()> {
    let both = [by_servos, simulated];
    let names = both.map(|it| {
        let told = it.told.motions.iter();
        told.map(|it| format!("{}: {}", it.experiment, it.name))
            .collect::<Vec<_>>()
    });
    let counts = names.each_ref().map(Vec::len);
    let line = "motions by servos and by the simulated robot";
    report.check(
        line,
        format!("{counts:?}"),
        "the same",
        names[0] == names[1],
    );
    ensure!(
        names[0] == names[1],
        "there is nothing to compare: {names:?}"
    );
    let figures = both.map(|it| figures(it, body));
    for (name, (servos, simulated)) in names[0].iter().zip(figures[0].iter().zip(&figures[1])) {
        let [duration_s, tip_m, measured_m, clearance_m] = [0, 1, 2, 3].map(|k| {
            let (servos, simulated) = (servos[k], simulated[k]);
            if servos == simulated {
                0.0
            } else {
                (servos - simulated).abs()
            }
        });
        report.check(
            &format!("experiment {name}: duration, tip error as commanded and as measured, least clearance by servos, and by the simulated robot"),
            format!("{servos:.4?} and {simulated:.4?}"),
            "apart by <= 0.1 s, 0.001 m, 0.03 m, 0.01 m",
            duration_s <= 0.1 && tip_m <= 1e-3 && measured_m <= 0.03 && clearance_m <= 0.01,
        );
    }
    Ok(())
}

/// Of each motion its duration, s, and, m, the error of the tip at its end as commanded and as measured, and the least clearance on its way.
fn figures(recording: &Recording, body: &Body) -> Vec<[f64; 4]> {
    let (motions, told) = (recording.motions(), &recording.told.motions);
    let figures = motions.iter().zip(told).map(|(motion, told)| {
        let stamp_ns = |sample: usize| recording.samples[sample].stamp_ns;
        [
            (stamp_ns(motion.range.1) - stamp_ns(motion.range.0)) as f64 * 1e-9,
            body.tip_error(&motion.end.into(), &told.requested_tip_m),
            body.tip_error(&motion.measured_end.into(), &told.requested_tip_m),
            recording.clearance(body, motion.range).sampled_m,
        ]
    });
    figures.collect()
}

/// Lengths of the tendons as the servos have wound them, by the bank itself.
struct WoundTendons {
    /// When, ns of CLOCK_MONOTONIC, and the lengths, m.
    looks: Vec<(i64, [f64; SERVOS])>,
}

impl WoundTendons {
    /// Looks at a bank while something is done.
    fn watch<T>(bank: &ServoBank, meanwhile: impl FnOnce() -> T) -> (T, Self) {
        let is_over = AtomicBool::new(false);
        scope(|scope| {
            let watching = scope.spawn(|| {
                let mut looks = Vec::new();
                while !is_over.load(Ordering::Relaxed) {
                    looks.push((mono_now_ns(), bank.lengths_m()));
                    sleep(LOOK);
                }
                looks
            });
            let ends = Ends(&is_over);
            let done = meanwhile();
            drop(ends);
            let looks = watching.join().expect("it does not panic");
            (done, Self { looks })
        })
    }

    /// Mean lengths between two instants, m.
    fn mean_m(&self, [begin_ns, end_ns]: [i64; 2]) -> anyhow::Result<[f64; SERVOS]> {
        let within = |(at_ns, _): &&(i64, _)| (begin_ns..=end_ns).contains(at_ns);
        let within: Vec<_> = self.looks.iter().filter(within).collect();
        ensure!(!within.is_empty(), "nobody looked at the bank then");
        let sum = |k: usize| {
            within
                .iter()
                .map(|(_, lengths_m)| lengths_m[k])
                .sum::<f64>()
        };
        Ok(std::array::from_fn(|k| sum(k) / within.len() as f64))
    }
}

/// Tip errors at the end of each motion, by what the servos have wound since the tendons were taut on the straight robot: of all tendons as
/// much, for the tension, and else what bends it.
fn tips(
    report: &mut Report,
    recording: &Recording,
    robot: &Robot,
    body: &Body,
    wound: &WoundTendons,
) -> anyhow::Result<()> {
    let motions = recording.motions();
    ensure!(!motions.is_empty(), "nothing was moved");
    for (motion, told) in motions.iter().zip(&recording.told.motions) {
        let end_ns = recording.samples[motion.range.1].stamp_ns;
        let held_m = wound.mean_m(HOLD_NS.map(|after_ns| end_ns + after_ns))?;
        let shape_rad = body.explain(&held_m).configuration;
        let error_m = body.tip_error(&shape_rad, &told.requested_tip_m);
        let line = format!(
            "experiment {}, {}: tip error by the lengths that the servos have wound, in section lengths",
            told.experiment, told.name
        );
        report.at_most(&line, error_m / robot.section_lengths[0], 0.03);
    }
    Ok(())
}
