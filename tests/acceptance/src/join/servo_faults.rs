//! What goes wrong with servos and their line while the robot moves: what driver and controller do, how far each motor moves, how it goes on.

use std::fmt::Write as _;
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::ensure;
use shared_types::codes::LoopFault;
use shared_types::valid::Goal;
use tests::servo_bank::{Faults, SERVOS, ServoBank};
use tests::servo_stack::{ServoStack, bank, home, start};
use tests::stack::PATIENCE;
use tests::world::{Settings, World};

use super::examples::TIP_M;
use crate::report::Report;

/// Path time of the motion at which the fault comes, s.
const UNDER_WAY_S: f64 = 0.3;
/// How long is looked at what the motors do.
const LOOKED_AT: Duration = Duration::from_secs(2);
/// Lateness of replies that come in the next cycle, of 4 ms, while the driver waits for that one's.
const LATER_THAN_A_CYCLE: Duration = Duration::from_millis(5);
/// Time in which the servos have come to where they are held.
const SETTLED: Duration = Duration::from_millis(200);
/// Speed of a line that is too slow, bit/s.
const SLOW_BAUD: u32 = 57_600;
/// Status of a servo that is overloaded (e-manual, "Hardware Error Status").
const OVERLOAD: u8 = 0x20;
/// Time from a fault until the stop begins, s: the servos' silence (20 ms), slack that must last (0.2 s), and a cycle.
const NOTICED_WITHIN_S: f64 = 0.25;
/// The longest stop along a path, s.
const LONGEST_STOP_S: f64 = 0.4;

/// One thing that goes wrong.
struct Case {
    what: &'static str,
    begin: fn(&mut Faults),
    /// What the controller may say of it, whichever is noticed first: nothing where it is borne.
    faults: &'static [LoopFault],
    /// What the driver warns of; nothing where it bears it or does not see it.
    driver: Option<&'static str>,
    /// How it goes on.
    recovery: Recovery,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Recovery {
    /// By itself.
    Borne,
    /// Once the cause is gone, by `pcc reset`.
    Reset,
    /// By another start of the driver, once the line is plugged in again.
    Restart,
    /// By homing and another start of the driver.
    Homing,
}

const CASES: [Case; 11] = [
    Case {
        what: "one reply in 17 is lost",
        begin: |faults| faults.drop_one_in = 17,
        faults: &[],
        driver: None,
        recovery: Recovery::Borne,
    },
    Case {
        what: "one reply in 23 has a wrong checksum",
        begin: |faults| faults.damage_one_in = 23,
        faults: &[],
        driver: None,
        recovery: Recovery::Borne,
    },
    Case {
        what: "one instruction in 17, goals among them, is lost",
        begin: |faults| faults.unheard_one_in = 17,
        faults: &[],
        driver: None,
        recovery: Recovery::Borne,
    },
    Case {
        what: "one instruction in 23, goals among them, has a wrong checksum",
        begin: |faults| faults.garbled_one_in = 23,
        faults: &[],
        driver: None,
        recovery: Recovery::Borne,
    },
    Case {
        what: "replies are 5 ms late, more than a cycle",
        begin: |faults| faults.late = LATER_THAN_A_CYCLE,
        faults: &[],
        driver: None,
        recovery: Recovery::Borne,
    },
    Case {
        what: "a servo is in error (overload)",
        begin: |faults| faults.in_error = Some((2, OVERLOAD)),
        faults: &[LoopFault::RobotFault],
        driver: Some("servo 3 is in error: its hardware error status says why"),
        recovery: Recovery::Homing,
    },
    Case {
        what: "a servo loses power",
        begin: |faults| faults.unpowered = Some(4),
        faults: &[LoopFault::RobotFault, LoopFault::TrackingError],
        driver: Some("servo 5 does not answer, or its tendon is slack"),
        recovery: Recovery::Homing,
    },
    Case {
        what: "a servo sticks",
        begin: |faults| faults.stuck = Some(0),
        faults: &[LoopFault::TrackingError],
        driver: None,
        recovery: Recovery::Reset,
    },
    Case {
        what: "a tendon comes off",
        begin: |faults| faults.loose = Some(6),
        faults: &[LoopFault::RobotFault],
        driver: Some("servo 7 does not answer, or its tendon is slack"),
        recovery: Recovery::Reset,
    },
    Case {
        what: "no servo hears or answers",
        begin: |faults| faults.silent = true,
        faults: &[LoopFault::RobotFault],
        driver: Some("no servo answers"),
        recovery: Recovery::Restart,
    },
    Case {
        what: "the line is unplugged",
        begin: |faults| faults.unplugged = true,
        faults: &[LoopFault::RobotFault],
        driver: Some("no servo answers"),
        recovery: Recovery::Restart,
    },
];

pub(super) fn run(report: &mut Report) {
    let command = format!(
        "dynamixel-robot on the servo bank, {}",
        ServoBank::settings()
    );
    for case in &CASES {
        report.group(&format!("servos: {}", case.what), &command, |report| {
            case.run(report)
        });
    }
    let command = "dynamixel-robot on a servo bank of 57,600 baud";
    report.group("servos: a bus too slow for the loop", command, too_slow);
}

/// A line that does not carry what a cycle needs is said at the start, and nothing is driven.
fn too_slow(report: &mut Report) -> anyhow::Result<()> {
    let world = World::new(&Settings::default());
    let _bank = bank(&world, SLOW_BAUD);
    let (is_homed, said) = home(&world)?;
    ensure!(is_homed, "{said}");
    let mut driver = start(&world, "dynamixel-robot", &[]);
    let status = driver.wait(PATIENCE)?;
    let log = driver.log();
    let said = log.lines().last().unwrap_or_default();
    report.check(
        "servos: a bus too slow for the loop: what the driver says at the start",
        format!("{status}: {said}"),
        "the serial line is too slow, and it does not drive",
        !status.success() && log.contains("the serial line is too slow"),
    );
    Ok(())
}

impl Case {
    fn run(&self, report: &mut Report) -> anyhow::Result<()> {
        let mut all = ServoStack::driven(&Settings::default())?;
        let id = all.stack.begin_motion(Goal::tip(TIP_M))?;
        all.stack.wait_for_progress(id, UNDER_WAY_S)?;
        let said_before = all.driver.log().len();
        let spoilt_before = all.bank.spoilt();
        all.bank.set(self.begin);
        let moved_m = moved(&all);
        let ended = all.stack.wait_for_end(id);
        let state = all.stack.controller_state();
        report.check(
            &self.line("what the controller says"),
            format!("{}, {}", state.state, state.fault),
            &self.expected(),
            match self.faults {
                [] => state.fault == LoopFault::None,
                faults => faults.contains(&state.fault),
            },
        );
        self.judge_driver(report, &all.driver.log()[said_before..]);
        if self.recovery == Recovery::Borne {
            let spoilt = all.bank.spoilt() - spoilt_before;
            let line = self.line("packets, or bursts of them, that were lost, damaged or late");
            report.check(&line, spoilt.to_string(), "> 0", spoilt > 0);
            let measured_rad = &state.values.measured_configuration_rad;
            let error = all.stack.world.body().tip_error(measured_rad, &TIP_M);
            report.at_most(&self.line("tip error as measured, m"), error, 0.03);
            sleep(SETTLED);
            self.judge_tip(report, &all, "tip error", &TIP_M);
        }
        self.judge_motors(report, &all, &moved_m);
        ensure!(
            !self.faults.is_empty() || ended.is_ok(),
            "the motion ended otherwise"
        );
        self.recover(&mut all)?;
        self.judge_next_motion(report, &mut all)
    }

    /// Whether a motion afterwards is followed as if nothing had been.
    fn judge_next_motion(&self, report: &mut Report, all: &mut ServoStack) -> anyhow::Result<()> {
        let to = [TIP_M[0], -TIP_M[1], TIP_M[2]];
        let id = all.stack.begin_motion(Goal::tip(to))?;
        let ended = all.stack.wait_for_end(id);
        let figure = ended
            .as_ref()
            .map_or_else(ToString::to_string, |it| it.fault.to_string());
        report.check(
            &self.line("a motion afterwards"),
            format!("{:?}: {figure}", self.recovery),
            "reached, without a fault",
            ended.is_ok(),
        );
        sleep(SETTLED);
        self.judge_tip(report, all, "tip error afterwards", &to);
        Ok(())
    }

    /// Where the tip is by what the servos themselves have done.
    fn judge_tip(&self, report: &mut Report, all: &ServoStack, what: &str, tip_m: &[f64; 3]) {
        let body = all.stack.world.body();
        let shape_rad = body.explain(&all.bank.lengths_m()).configuration;
        let line = format!("{what} by the lengths that the servos have wound, m");
        report.at_most(&self.line(&line), body.tip_error(&shape_rad, tip_m), 0.03);
    }

    fn line(&self, what: &str) -> String {
        format!("servos: {}: {what}", self.what)
    }

    /// What the driver has logged since the fault came.
    fn judge_driver(&self, report: &mut Report, log: &str) {
        let warnings = warnings(log);
        report.check(
            &self.line("what the driver warns of"),
            warnings.join("; "),
            self.driver.unwrap_or("nothing"),
            match self.driver {
                Some(text) => warnings.iter().any(|it| it.contains(text)),
                None => warnings.is_empty(),
            },
        );
    }

    fn judge_motors(&self, report: &mut Report, all: &ServoStack, moved_m: &[f64; SERVOS]) {
        let mut each = String::new();
        for motor in moved_m {
            let _ = write!(each, "{:.1} ", motor * 1e3);
        }
        let line = self.line("how far each motor moved from then on, mm");
        report.shown(&line, each);
        if !self.faults.is_empty() {
            let limits = &all.stack.world.robot.tendon_limits;
            let bar = limits.velocity * (NOTICED_WITHIN_S + 0.5 * LONGEST_STOP_S);
            let most = moved_m.iter().copied().fold(0.0, f64::max);
            report.at_most(
                &self.line("farthest, m (at full speed until it is noticed, and a stop)"),
                most,
                bar,
            );
        }
    }

    /// What the controller is to say.
    fn expected(&self) -> String {
        let texts: Vec<String> = self.faults.iter().map(ToString::to_string).collect();
        match texts.as_slice() {
            [] => "no fault".to_owned(),
            texts => texts.join(" or "),
        }
    }

    fn recover(&self, all: &mut ServoStack) -> anyhow::Result<()> {
        if self.recovery == Recovery::Borne {
            return Ok(());
        }
        all.bank.set(|faults| *faults = Faults::default());
        ensure!(
            all.driver.is_running(),
            "the driver ended: {}",
            all.driver.log()
        );
        if self.recovery != Recovery::Reset {
            all.driver.sigterm(PATIENCE)?;
        }
        if self.recovery == Recovery::Homing {
            all.bank.reboot();
            let (is_homed, said) = home(&all.stack.world)?;
            ensure!(is_homed, "{said}");
        }
        if self.recovery != Recovery::Reset {
            all.driver = start(&all.stack.world, "dynamixel-robot", &[]);
        }
        all.stack.clear_fault()?;
        Ok(())
    }
}

/// How far each motor moves within [`LOOKED_AT`], m.
fn moved(all: &ServoStack) -> [f64; SERVOS] {
    let begun = Instant::now();
    let (mut last, mut moved) = (all.bank.lengths_m(), [0.0; SERVOS]);
    while begun.elapsed() < LOOKED_AT {
        sleep(Duration::from_millis(5));
        let now = all.bank.lengths_m();
        for ((moved, now), last) in moved.iter_mut().zip(now).zip(last) {
            *moved += (now - last).abs();
        }
        last = now;
    }
    moved
}

/// Warnings and errors of a log, without what comes before their texts.
fn warnings(log: &str) -> Vec<String> {
    let text = |line: &str| {
        let (_, text) = line.split_once("WARN").or(line.split_once("ERROR"))?;
        Some(text.trim().to_owned())
    };
    log.lines().filter_map(text).collect()
}
