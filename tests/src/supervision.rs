//! Whether a motion is stopped for a ball that came into its way while a process was disturbed.

use std::time::Duration;

use shared_types::codes::LoopState;
use shared_types::message::{ControllerState, Cycle, RobotState};

use crate::disturbance::Kind;
use crate::listener::Heard;
use crate::stack::Part;

/// A stop is ordered, or the robot is at rest, so long after the first fresh state of the controller, ns.
pub const SUPERVISED_WITHIN_NS: i64 = 100_000_000;
/// The shipped `daemon_lost_ms`, ns: a motion whose daemon was killed is stopped then, by the controller.
const DAEMON_LOST_NS: i64 = 200_000_000;
/// Slower is at rest, m/s.
const AT_REST_M_S: f64 = 1e-6;

/// One disturbance of a motion, at whose end there is a ball in the way.
#[derive(Clone, Copy, Debug)]
pub struct Watch {
    /// What was disturbed.
    pub part: Part,
    /// How.
    pub kind: Kind,
    /// When it began, ns of CLOCK_MONOTONIC.
    pub begun_ns: i64,
    /// When the ball was published, shortly before its end.
    pub shown_ns: i64,
    /// When it ended.
    pub ended_ns: i64,
}

/// What came of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// Nobody executed anything any more when the ball was published.
    NothingMoved,
    /// A motion was under way, and a stop was ordered (or it was at rest) so long after the first fresh state, ns; below 0: before.
    Stopped(i64),
    /// It went on, for as long as was looked.
    WentOn,
    /// The controller has published nothing since.
    Silent,
}

/// The balls put in the way, and what came of them.
#[derive(Clone, Debug, Default)]
pub struct Watched {
    /// Balls.
    pub balls: usize,
    /// Those in whose cases a motion was still under way, so that somebody had to stop it.
    pub had_to_stop: usize,
    /// Times until a stop was ordered, ms.
    pub reactions_ms: Vec<f64>,
    /// Those that took too long.
    pub late: Vec<String>,
}

impl Watched {
    /// Adds one.
    pub fn add(&mut self, watch: &Watch, reaction: &Reaction) {
        self.balls += 1;
        let held_ms = (watch.ended_ns - watch.begun_ns) as f64 * 1e-6;
        let what = format!(
            "{:?} of {} for {held_ms:.0} ms",
            watch.kind,
            watch.part.program()
        );
        match reaction {
            Reaction::NothingMoved => {}
            Reaction::Stopped(after_ns) => {
                self.had_to_stop += 1;
                let after_ms = *after_ns as f64 * 1e-6;
                self.reactions_ms.push(after_ms);
                if *after_ns > SUPERVISED_WITHIN_NS {
                    self.late
                        .push(format!("{what}: stopped after {after_ms:.0} ms"));
                }
            }
            Reaction::WentOn => {
                self.had_to_stop += 1;
                self.late.push(format!("{what}: went on through the ball"));
            }
            Reaction::Silent => self
                .late
                .push(format!("{what}: no state of the controller")),
        }
    }
}

impl Watch {
    /// How long to listen before judging: past what is allowed, and until the messages of that time have come.
    #[must_use]
    pub fn patience(&self) -> Duration {
        let allowed = Duration::from_nanos(SUPERVISED_WITHIN_NS.unsigned_abs());
        let lost = Duration::from_nanos(DAEMON_LOST_NS.unsigned_abs());
        3 * allowed
            + if self.killed_daemon() {
                lost
            } else {
                Duration::ZERO
            }
    }

    fn killed_daemon(&self) -> bool {
        (self.part, self.kind) == (Part::Daemon, Kind::Kill)
    }

    /// From when on the time counts: the first state of the controller that is of an instant after the disturbance, or, where the
    /// daemon is dead, the instant at which the controller has to know that.
    fn counts_from(&self, states: &[ControllerState]) -> Option<i64> {
        if self.killed_daemon() {
            return Some(self.begun_ns + DAEMON_LOST_NS);
        }
        let fresh = states
            .iter()
            .find(|state| state.stamp_mono_ns > self.ended_ns);
        fresh.map(|state| state.stamp_mono_ns)
    }

    /// What came of it, from what was published.
    #[must_use]
    pub fn judge(&self, heard: &Heard) -> Reaction {
        let Some(from_ns) = self.counts_from(&heard.controller) else {
            return Reaction::Silent;
        };
        let executing = |cycle: &&Cycle| cycle.state == LoopState::Executing.code();
        let moved = heard.cycles.iter().filter(executing);
        let last_moved = moved
            .map(|cycle| cycle.stamp_mono_ns)
            .filter(|stamp_ns| *stamp_ns >= self.shown_ns)
            .max();
        let Some(last_moved) = last_moved else {
            return Reaction::NothingMoved;
        };
        let heard_until = heard.cycles.last().map_or(0, |cycle| cycle.stamp_mono_ns);
        let stopped_ns = (last_moved < heard_until).then_some(last_moved);
        let rested_ns = first_rest(&heard.robot, self.shown_ns);
        match [stopped_ns, rested_ns].into_iter().flatten().min() {
            Some(at_ns) => Reaction::Stopped(at_ns - from_ns),
            None => Reaction::WentOn,
        }
    }
}

/// When the robot's reference was first at rest from an instant on.
fn first_rest(states: &[RobotState], from_ns: i64) -> Option<i64> {
    let rests = |state: &&RobotState| {
        let slow = |velocity: &f64| velocity.abs() < AT_REST_M_S;
        state.stamp_mono_ns >= from_ns && state.accepted_velocity_m_s.iter().all(slow)
    };
    states.iter().find(rests).map(|state| state.stamp_mono_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;
    const WATCH: Watch = Watch {
        part: Part::Controller,
        kind: Kind::Hold,
        begun_ns: 500 * MS,
        shown_ns: 995 * MS,
        ended_ns: 1000 * MS,
    };

    /// A controller that executes until an instant and a robot that moves as long, both heard until 1.4 s.
    fn heard(executing_until_ms: i64, moving_until_ms: i64) -> Heard {
        let cycle = |ms: i64| Cycle {
            stamp_mono_ns: ms * MS,
            state: if ms <= executing_until_ms {
                LoopState::Executing.code()
            } else {
                LoopState::Stopping.code()
            },
            ..Cycle::ZEROED
        };
        let robot = |ms: i64| RobotState {
            stamp_mono_ns: ms * MS,
            accepted_velocity_m_s: [if ms < moving_until_ms { 0.05 } else { 0.0 }; 9],
            ..RobotState::ZEROED
        };
        let state = |ms: i64| ControllerState {
            stamp_mono_ns: ms * MS,
            ..ControllerState::ZEROED
        };
        Heard {
            cycles: (0..1400).map(cycle).collect(),
            robot: (0..1400).map(robot).collect(),
            controller: [400, 1010, 1030].map(state).to_vec(),
            setpoints: Vec::new(),
        }
    }

    #[test]
    fn the_time_counts_from_the_first_fresh_state_to_the_stop_or_to_rest() {
        assert_eq!(WATCH.judge(&heard(990, 1400)), Reaction::NothingMoved);
        assert_eq!(WATCH.judge(&heard(1000, 1400)), Reaction::Stopped(-10 * MS));
        assert_eq!(WATCH.judge(&heard(1060, 1400)), Reaction::Stopped(50 * MS));
        assert_eq!(WATCH.judge(&heard(1400, 1090)), Reaction::Stopped(80 * MS));
        assert_eq!(WATCH.judge(&heard(1400, 1400)), Reaction::WentOn);
        let silent = Heard {
            controller: Vec::new(),
            ..heard(1400, 1400)
        };
        assert_eq!(WATCH.judge(&silent), Reaction::Silent);
    }

    #[test]
    fn what_took_too_long_is_kept() {
        let mut watched = Watched::default();
        for reaction in [
            Reaction::NothingMoved,
            Reaction::Stopped(90 * MS),
            Reaction::Stopped(110 * MS),
            Reaction::WentOn,
            Reaction::Silent,
        ] {
            watched.add(&WATCH, &reaction);
        }
        assert_eq!((watched.balls, watched.had_to_stop), (5, 3));
        assert_eq!(watched.late.len(), 3, "{watched:?}");
    }

    #[test]
    fn a_dead_daemons_motion_is_stopped_by_the_controller() {
        let killed = Watch {
            part: Part::Daemon,
            kind: Kind::Kill,
            shown_ns: 600 * MS,
            ended_ns: 600 * MS,
            ..WATCH
        };
        assert_eq!(killed.judge(&heard(590, 1400)), Reaction::NothingMoved);
        assert_eq!(killed.judge(&heard(720, 1400)), Reaction::Stopped(20 * MS));
    }
}
