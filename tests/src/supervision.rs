//! Whether a motion is stopped for a ball that came into its way while a process was disturbed.

use std::collections::BTreeMap;
use std::time::Duration;

use shared_types::codes::LoopState;
use shared_types::message::{Cycle, RobotState};

use crate::disturbance::Kind;
use crate::listener::Heard;
use crate::stack::Part;

/// A stop is ordered, or the robot is at rest, so long after the first fresh state of the controller, ns.
pub const SUPERVISED_WITHIN_NS: i64 = 100_000_000;
/// The motion of a killed daemon rests so long after the next daemon was started: the controller gives a lost one 0.2 s, and stops
/// in less than 0.4 s.
const RESTS_WITHIN: Duration = Duration::from_millis(700);
/// A motion that is stopped in the very next cycle has its last one so long before the ball at most: two cycles, ns.
const LAST_CYCLE_NS: i64 = 2_000_000;
/// Slower is at rest, m/s.
const AT_REST_M_S: f64 = 1e-6;

/// From when on the time counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Since {
    /// The first state of the controller that is of an instant after the disturbance.
    FreshState,
    /// The first state of the controller that is of an instant after the first heartbeat of the next daemon: the one before was
    /// killed.
    NextDaemon,
    /// The ball's publication: everything runs.
    Scene,
}

/// One disturbance of a motion, at whose end there is a ball in the way.
#[derive(Clone, Copy, Debug)]
pub struct Watch {
    /// What was disturbed.
    pub part: Part,
    /// How.
    pub kind: Kind,
    /// From when on the time counts.
    pub since: Since,
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
    /// It came to rest, and no fresh state or no next daemon was heard before.
    CameToRest,
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
    /// For each way of disturbing a process: balls put in the way, and those for which somebody had to stop.
    pub ways: BTreeMap<String, [usize; 2]>,
    /// Times until a stop was ordered, ms.
    pub reactions_ms: Vec<f64>,
    /// Those that took too long.
    pub late: Vec<String>,
}

impl Watched {
    /// Adds one.
    pub fn add(&mut self, watch: &Watch, reaction: &Reaction) {
        self.balls += 1;
        let had_to_stop = !matches!(reaction, Reaction::NothingMoved | Reaction::Silent);
        self.had_to_stop += usize::from(had_to_stop);
        let way = format!("{:?} {}", watch.kind, watch.part.program());
        let [balls, stops] = self.ways.entry(way).or_default();
        *balls += 1;
        *stops += usize::from(had_to_stop);
        let held_ms = (watch.ended_ns - watch.begun_ns) as f64 * 1e-6;
        let what = match watch.since {
            Since::Scene => format!("a motion after a {:?}", watch.kind),
            _ => format!("{:?}", watch.kind),
        };
        let what = format!("{what} of {} for {held_ms:.0} ms", watch.part.program());
        match reaction {
            Reaction::NothingMoved | Reaction::CameToRest => {}
            Reaction::Stopped(after_ns) => {
                let after_ms = *after_ns as f64 * 1e-6;
                self.reactions_ms.push(after_ms);
                if *after_ns > SUPERVISED_WITHIN_NS {
                    self.late
                        .push(format!("{what}: stopped after {after_ms:.0} ms"));
                }
            }
            Reaction::WentOn => {
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
        let rests = match self.since {
            Since::NextDaemon => RESTS_WITHIN,
            Since::FreshState | Since::Scene => Duration::ZERO,
        };
        3 * allowed + rests
    }

    fn counts_from(&self, heard: &Heard) -> Option<i64> {
        let after_ns = match self.since {
            Since::FreshState => self.ended_ns,
            Since::NextDaemon => {
                let mut beats = heard.daemon.iter();
                let next = beats.find(|beat| beat.stamp_mono_ns > self.shown_ns)?;
                next.stamp_mono_ns
            }
            Since::Scene => return Some(self.shown_ns),
        };
        let mut states = heard.controller.iter();
        let fresh = states.find(|state| state.stamp_mono_ns > after_ns);
        fresh.map(|state| state.stamp_mono_ns)
    }

    /// What came of it, from what was published.
    #[must_use]
    pub fn judge(&self, heard: &Heard) -> Reaction {
        let executing = |cycle: &&Cycle| cycle.state == LoopState::Executing.code();
        let moved = heard.cycles.iter().filter(executing);
        let last_moved = moved
            .map(|cycle| cycle.stamp_mono_ns)
            .filter(|stamp_ns| *stamp_ns >= self.shown_ns - LAST_CYCLE_NS)
            .max();
        let Some(last_moved) = last_moved else {
            return if heard.controller.is_empty() {
                Reaction::Silent
            } else {
                Reaction::NothingMoved
            };
        };
        let heard_until = heard.cycles.last().map_or(0, |cycle| cycle.stamp_mono_ns);
        let stopped_ns = (last_moved < heard_until).then_some(last_moved);
        let rested_ns = first_rest(&heard.robot, self.shown_ns);
        let at_ns = [stopped_ns, rested_ns].into_iter().flatten().min();
        match (at_ns, self.counts_from(heard)) {
            (Some(at_ns), Some(from_ns)) => Reaction::Stopped(at_ns - from_ns),
            // Whoever has no daemon must rest: a stop that has begun is not enough.
            (Some(_), None) if rested_ns.is_some() => Reaction::CameToRest,
            (_, None) => Reaction::Silent,
            (None, Some(_)) => Reaction::WentOn,
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
    use shared_types::message::{ControllerState, Heartbeat};

    use super::*;

    const MS: i64 = 1_000_000;
    const WATCH: Watch = Watch {
        part: Part::Controller,
        kind: Kind::Hold,
        since: Since::FreshState,
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
            ..Heard::default()
        }
    }

    #[test]
    fn the_time_counts_from_the_first_fresh_state_to_the_stop_or_to_rest() {
        assert_eq!(WATCH.judge(&heard(990, 1400)), Reaction::NothingMoved);
        assert_eq!(WATCH.judge(&heard(994, 1400)), Reaction::Stopped(-16 * MS));
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
        assert_eq!(watched.ways["Hold controller"], [5, 3]);
        assert_eq!(watched.late.len(), 3, "{watched:?}");
    }

    #[test]
    fn a_dead_daemons_motion_is_stopped_when_the_next_one_can_know_or_rests() {
        let killed = Watch {
            part: Part::Daemon,
            kind: Kind::Kill,
            since: Since::NextDaemon,
            shown_ns: 600 * MS,
            ended_ns: 600 * MS,
            ..WATCH
        };
        assert_eq!(killed.judge(&heard(590, 1400)), Reaction::NothingMoved);
        assert_eq!(killed.judge(&heard(720, 1000)), Reaction::CameToRest);
        assert_eq!(killed.judge(&heard(720, 1400)), Reaction::Silent);
        let beats = |executing_until_ms, at_ms: i64| Heard {
            daemon: vec![Heartbeat {
                stamp_mono_ns: at_ms * MS,
                ..Heartbeat::ZEROED
            }],
            ..heard(executing_until_ms, 1400)
        };
        assert_eq!(
            killed.judge(&beats(720, 1000)),
            Reaction::Stopped(-290 * MS)
        );
        assert_eq!(
            killed.judge(&beats(1130, 1000)),
            Reaction::Stopped(120 * MS)
        );
        assert_eq!(killed.judge(&beats(1400, 1000)), Reaction::WentOn);
    }

    #[test]
    fn in_a_motion_after_a_kill_the_time_counts_from_the_ball() {
        let after = Watch {
            since: Since::Scene,
            ..WATCH
        };
        assert_eq!(after.judge(&heard(1060, 1400)), Reaction::Stopped(65 * MS));
        assert_eq!(after.judge(&heard(1400, 1400)), Reaction::WentOn);
    }
}
