//! What goes wrong with servos and their line while the robot moves: what driver and controller do, how far each motor moves, how it goes on.

use std::fmt::Write as _;
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::ensure;
use shared_types::codes::LoopFault;
use shared_types::valid::Goal;
use tests::servo_bank::{Faults, SERVOS};
use tests::servo_stack::{ServoStack, home, start};
use tests::stack::PATIENCE;

use super::examples::TIP_M;
use crate::report::Report;

/// When the fault comes after the motion was asked for: it is under way then.
const UNDER_WAY: Duration = Duration::from_millis(600);
/// How long is looked at what the motors do.
const LOOKED_AT: Duration = Duration::from_secs(2);
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
    /// How it goes on.
    recovery: Recovery,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Recovery {
    /// By itself.
    Borne,
    /// Once the cause is gone, by `pcc reset`.
    Reset,
    /// By homing and another start of the driver.
    Homing,
}

const CASES: [Case; 8] = [
    Case {
        what: "one packet in 17 is lost",
        begin: |faults| faults.drop_one_in = 17,
        faults: &[],
        recovery: Recovery::Borne,
    },
    Case {
        what: "one packet in 23 has a wrong checksum",
        begin: |faults| faults.damage_one_in = 23,
        faults: &[],
        recovery: Recovery::Borne,
    },
    Case {
        what: "replies are 1 ms late",
        begin: |faults| faults.late = Duration::from_millis(1),
        faults: &[],
        recovery: Recovery::Borne,
    },
    Case {
        what: "a servo is in error (overload)",
        begin: |faults| faults.in_error = Some((2, OVERLOAD)),
        faults: &[LoopFault::RobotFault],
        recovery: Recovery::Homing,
    },
    Case {
        what: "a servo loses power",
        begin: |faults| faults.unpowered = Some(4),
        faults: &[LoopFault::RobotFault, LoopFault::TrackingError],
        recovery: Recovery::Homing,
    },
    Case {
        what: "a servo sticks",
        begin: |faults| faults.stuck = Some(0),
        faults: &[LoopFault::TrackingError],
        recovery: Recovery::Reset,
    },
    Case {
        what: "a tendon comes off",
        begin: |faults| faults.loose = Some(6),
        faults: &[LoopFault::RobotFault],
        recovery: Recovery::Reset,
    },
    Case {
        what: "the line is unplugged",
        begin: |faults| faults.unplugged = true,
        faults: &[LoopFault::RobotFault],
        recovery: Recovery::Reset,
    },
];

pub(super) fn run(report: &mut Report) {
    for case in &CASES {
        let command = "dynamixel-robot on the servo bank";
        report.group(&format!("servos: {}", case.what), command, |report| {
            case.run(report)
        });
    }
}

impl Case {
    fn run(&self, report: &mut Report) -> anyhow::Result<()> {
        let line = |what: &str| format!("servos: {}: {what}", self.what);
        let mut all = ServoStack::driven()?;
        let id = all.stack.begin_motion(Goal::tip(TIP_M))?;
        sleep(UNDER_WAY);
        all.bank.set(self.begin);
        let moved_m = moved(&all);
        let ended = all.stack.wait_for_end(id);
        let state = all.stack.controller_state();
        report.check(
            &line("what the controller says"),
            format!("{}, {}", state.state, state.fault),
            &self.expected(),
            match self.faults {
                [] => state.fault == LoopFault::None,
                faults => faults.contains(&state.fault),
            },
        );
        report.shown(
            &line("what the driver says"),
            last_warning(&all.driver.log()),
        );
        let mut each = String::new();
        for motor in moved_m {
            let _ = write!(each, "{:.1} ", motor * 1e3);
        }
        report.shown(&line("how far each motor moved from then on, mm"), each);
        if !self.faults.is_empty() {
            let limits = &all.stack.world.robot.tendon_limits;
            let bar = limits.velocity * (NOTICED_WITHIN_S + 0.5 * LONGEST_STOP_S);
            let most = moved_m.into_iter().fold(0.0, f64::max);
            report.at_most(
                &line("farthest, m (at full speed until it is noticed, and a stop)"),
                most,
                bar,
            );
        }
        ensure!(
            !self.faults.is_empty() || ended.is_ok(),
            "the motion ended otherwise"
        );
        self.recover(&mut all)?;
        let id = all
            .stack
            .begin_motion(Goal::tip([TIP_M[0], -TIP_M[1], TIP_M[2]]))?;
        let ended = all.stack.wait_for_end(id);
        let figure = ended
            .as_ref()
            .map_or_else(ToString::to_string, |it| it.fault.to_string());
        report.check(
            &line("a motion afterwards"),
            format!("{:?}: {figure}", self.recovery),
            "reached, without a fault",
            ended.is_ok(),
        );
        Ok(())
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
        if self.recovery == Recovery::Homing {
            all.driver.sigterm(PATIENCE)?;
            all.bank.reboot();
            let (is_homed, said) = home(&all.stack.world)?;
            ensure!(is_homed, "{said}");
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

fn last_warning(log: &str) -> String {
    let mut warnings = log
        .lines()
        .rev()
        .filter(|line| line.contains("WARN") || line.contains("ERROR"));
    warnings.next().unwrap_or("nothing").to_owned()
}
