//! Whether what was sent to the robot, and what the robot made of it, keeps the limits of its file: from the messages alone.

use std::collections::VecDeque;
use std::sync::LazyLock;

use pcc_model::TendonLimits;
use serde::{Deserialize, Serialize};
use shared_types::codes::{LoopState, MotorState};
use shared_types::message::{RobotState, Setpoint};

use crate::listener::Heard;
use crate::motion::{largest, raise};
use crate::world::shipped_number;

/// Set-points of one piece that the robot's states of the next one may still follow.
const REMEMBERED: usize = 1024;
/// The robot goes on from a set-point at constant velocity for at most so long, s: the shipped `lost_setpoint_ms`.
static EXTRAPOLATED_S: LazyLock<f64> =
    LazyLock::new(|| 1e-3 * shipped_number("simulated-robot.toml", "lost_setpoint_ms"));
/// Stamps are whole nanoseconds, and lengths are rounded; m, m/s.
const ROUNDING: f64 = 1e-9;
/// What is sent is within its limits but for the rounding of sums.
pub const SENT_USE: f64 = 1.0 + 1e-6;
/// A step ÷ time beyond this is an offence: the stamps of both ends are rounded and a length is a difference of two.
pub const ALLOWED_USE: f64 = 1.001;
/// Offences that are kept in words.
const KEPT_OFFENCES: usize = 50;

/// Largest use of the limits between two successive samples, by their own stamps; 1: at the limit.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize)]
pub struct StepUse {
    /// |Δposition| ÷ (velocity limit × Δt).
    pub position: f64,
    /// |Δvelocity| ÷ (acceleration limit × Δt).
    pub velocity: f64,
    /// Pairs looked at.
    pub pairs: usize,
    /// Longest time between two of them, s.
    pub elapsed_s: f64,
}

/// What was found.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub struct Verdict {
    /// Set-points looked at.
    pub setpoints: usize,
    /// Robot states looked at.
    pub robot_states: usize,
    /// Set-points, robot states and cycles that were not heard between two of one process that were, by the gaps in their numbers.
    pub lost: [u64; 3],
    /// Those before the first one that was heard of a process that had begun anew.
    pub first_unheard: [u64; 3],
    /// Set-points that the robot followed and that were not heard, the last ones of a controller: a killed one's memory may be gone
    /// before the listener comes to it.
    pub last_unheard: u64,
    /// Each of these gaps in words.
    pub losses: Vec<String>,
    /// Largest velocity of a set-point over the limit.
    pub velocity: f64,
    /// Largest acceleration of a set-point over the limit.
    pub acceleration: f64,
    /// Largest |Δacceleration| ÷ (jerk limit × Δt) between two successive set-points of a loop that follows a motion.
    pub jerk: f64,
    /// Steps from set-point to set-point, over pauses, too.
    pub sent: StepUse,
    /// Steps from the robot's reference to the first set-point of a controller that takes hold of it.
    pub taken: StepUse,
    /// Steps of the robot's own reference where it does not follow: ramps to rest, rests, restarts, and taking hold again.
    pub unled: StepUse,
    /// Controllers and robots that began anew in between.
    pub restarts: usize,
    /// Times that set-points took hold of a robot at rest.
    pub holds_taken: usize,
    /// Largest distance of a following robot's reference from the set-point that it says it follows, m.
    pub reference_error_m: f64,
    /// States whose set-point was not heard.
    pub unmatched: usize,
    /// States in fault: a set-point broke a rule while the robot followed.
    pub faults: usize,
    /// What went beyond a limit, in words; the first ones.
    pub offences: Vec<String>,
    /// How many there were.
    pub offence_count: usize,
}

/// Looks at what is heard, in pieces that follow one another.
#[derive(Debug)]
pub struct Judge {
    limits: TendonLimits,
    verdict: Verdict,
    known: VecDeque<Setpoint>,
    /// Number of the newest set-point that the robot has said to follow and that was not heard; 0: none of this controller's.
    unheard: u64,
    robot: Option<RobotState>,
    cycle: Option<u64>,
}

impl Judge {
    /// For a robot with these limits.
    #[must_use]
    pub fn new(limits: TendonLimits) -> Self {
        Self {
            limits,
            verdict: Verdict::default(),
            known: VecDeque::new(),
            unheard: 0,
            robot: None,
            cycle: None,
        }
    }

    /// What was found so far.
    #[must_use]
    pub fn verdict(&self) -> &Verdict {
        &self.verdict
    }

    /// Looks at the next piece.
    pub fn look(&mut self, heard: &Heard) {
        let mut setpoints = heard.setpoints.iter().peekable();
        for state in &heard.robot {
            let is_before = |setpoint: &&Setpoint| setpoint.stamp_mono_ns <= state.stamp_mono_ns;
            while let Some(setpoint) = setpoints.next_if(is_before) {
                self.look_at_setpoint(setpoint);
            }
            self.look_at_robot(state);
        }
        setpoints.for_each(|setpoint| self.look_at_setpoint(setpoint));
        let old = self.known.len().saturating_sub(REMEMBERED);
        self.known.drain(..old);
        for cycle in &heard.cycles {
            self.verdict.lose(2, self.cycle, cycle.sequence);
            self.cycle = Some(cycle.sequence);
        }
    }

    fn look_at_setpoint(&mut self, now: &Setpoint) {
        let verdict = &mut self.verdict;
        verdict.setpoints += 1;
        let velocity = largest(&now.velocity_m_s) / self.limits.velocity;
        let acceleration = largest(&now.acceleration_m_s2) / self.limits.acceleration;
        raise(&mut verdict.velocity, velocity);
        raise(&mut verdict.acceleration, acceleration);
        if is_beyond(velocity, SENT_USE) || is_beyond(acceleration, SENT_USE) {
            self.offend(format!(
                "set-point {}: velocity {velocity:.7}, acceleration {acceleration:.7} of their limits",
                now.sequence
            ));
        }
        if let Some(before) = self.known.back().copied() {
            let verdict = &mut self.verdict;
            verdict.lose(0, Some(before.sequence), now.sequence);
            if now.sequence <= before.sequence {
                verdict.restarts += 1;
            } else {
                // They were not the last ones: they are in the gap.
                verdict.last_unheard -= self.unheard.saturating_sub(before.sequence);
            }
            self.unheard = 0;
            self.look_at_jerk(&before, now);
            self.look_at_step(&before, now);
        }
        self.known.push_back(*now);
    }

    fn look_at_jerk(&mut self, before: &Setpoint, now: &Setpoint) {
        let executing = LoopState::Executing.code();
        let is_next = now.sequence == before.sequence + 1;
        if before.state != executing || now.state != executing || !is_next {
            return;
        }
        let elapsed_s = (now.stamp_mono_ns - before.stamp_mono_ns) as f64 * 1e-9;
        let changes = now.acceleration_m_s2.iter().zip(before.acceleration_m_s2);
        let largest_change = changes
            .map(|(now, before)| (now - before).abs())
            .fold(0.0, f64::max);
        raise(
            &mut self.verdict.jerk,
            largest_change / (self.limits.jerk * elapsed_s),
        );
    }

    /// A set-point goes on from the one before, or, where the controller takes hold of a robot anew, from the robot's reference: of
    /// the set-points before, the robot may have followed the last ones no more.
    fn look_at_step(&mut self, before: &Setpoint, now: &Setpoint) {
        let starting = LoopState::Starting.code();
        let takes_hold = now.state == starting && before.state != starting;
        let from = match self.robot.filter(|_| takes_hold) {
            Some(robot) => Sample::of_robot(&robot),
            None => Sample::of_setpoint(before),
        };
        let step = self.step(&from, &Sample::of_setpoint(now));
        let verdict = &mut self.verdict;
        let used = if takes_hold {
            &mut verdict.taken
        } else {
            &mut verdict.sent
        };
        used.add(&step);
        self.judge_step(&step, || {
            let [from, to] = [before, now].map(|sent| (sent.sequence, sent.state));
            format!("set-points (number, state) {from:?} to {to:?}")
        });
    }

    fn look_at_robot(&mut self, now: &RobotState) {
        let is = |state: &RobotState, wanted: MotorState| state.state == wanted.code();
        self.verdict.robot_states += 1;
        self.verdict.faults += usize::from(is(now, MotorState::Fault));
        let follows = is(now, MotorState::Following);
        if follows {
            self.compare_with_setpoint(now);
        }
        let Some(before) = self.robot.replace(*now) else {
            return;
        };
        let verdict = &mut self.verdict;
        verdict.lose(1, Some(before.sequence), now.sequence);
        verdict.restarts += usize::from(now.sequence <= before.sequence);
        let followed = is(&before, MotorState::Following);
        verdict.holds_taken += usize::from(follows && !followed);
        // While it follows, its reference is the set-points', which are judged by the times that they are of.
        if follows && followed {
            return;
        }
        let step = self.step(&Sample::of_robot(&before), &Sample::of_robot(now));
        self.verdict.unled.add(&step);
        self.judge_step(&step, || {
            let (from, to) = (before.state, now.state);
            format!("robot's state {}, from state {from} to {to}", now.sequence)
        });
    }

    /// The robot's reference is its last set-point, gone on with at constant velocity.
    ///
    /// Before the first set-point that was heard there is nothing to compare with: those were sent before anybody listened.
    fn compare_with_setpoint(&mut self, state: &RobotState) {
        if self.known.is_empty() {
            return;
        }
        let followed = |setpoint: &&Setpoint| {
            setpoint.sequence == state.accepted_sequence
                && setpoint.stamp_mono_ns <= state.stamp_mono_ns
        };
        let Some(setpoint) = self.known.iter().rev().find(followed) else {
            self.verdict.unmatched += 1;
            self.note_unmatched(state);
            return;
        };
        let age_s = seconds(state.stamp_mono_ns - setpoint.stamp_mono_ns).min(*EXTRAPOLATED_S);
        let error = |tendon: usize| {
            let ahead = setpoint.velocity_m_s[tendon] * age_s;
            let expected = setpoint.position_m[tendon] + ahead;
            (state.accepted_setpoint_m[tendon] - expected).abs()
        };
        let errors = std::array::from_fn(error);
        raise(&mut self.verdict.reference_error_m, largest(&errors));
    }

    /// Notes what a state follows that is not known: the last set-points of a controller that was killed before the listener came to them, or
    /// else the numbers by which to find out.
    fn note_unmatched(&mut self, state: &RobotState) {
        let followed = state.accepted_sequence;
        let heard = self.known.back().map_or(0, |last| last.sequence);
        let before = heard.max(self.unheard);
        if followed > before {
            self.unheard = followed;
            let lost = followed - before;
            self.verdict.last_unheard += lost;
            let last =
                format!("{lost} set-points up to number {followed}, which the robot followed");
            self.verdict.losses.push(last);
        } else if followed != self.unheard {
            let of_number = self.known.iter().filter(|it| it.sequence == followed);
            let stamps_ns: Vec<i64> = of_number.map(|it| it.stamp_mono_ns).collect();
            let unmatched = format!(
                "robot's state {} of {} ns, which follows number {followed}, of {stamps_ns:?} ns; the newest number then is {heard}",
                state.sequence, state.stamp_mono_ns
            );
            self.verdict.losses.push(unmatched);
        }
    }

    fn step(&self, before: &Sample, now: &Sample) -> StepUse {
        let elapsed_s = seconds(now.stamp_ns - before.stamp_ns).max(1e-9);
        let ratio = |step: f64, limit: f64| {
            let beyond_rounding = if step <= ROUNDING {
                0.0
            } else {
                step - ROUNDING
            };
            beyond_rounding / (limit * elapsed_s)
        };
        let position = largest_step(&before.position_m, &now.position_m);
        let velocity = largest_step(&before.velocity_m_s, &now.velocity_m_s);
        StepUse {
            position: ratio(position, self.limits.velocity),
            velocity: ratio(velocity, self.limits.acceleration),
            pairs: 1,
            elapsed_s,
        }
    }

    fn judge_step(&mut self, step: &StepUse, what: impl FnOnce() -> String) {
        if is_beyond(step.position, ALLOWED_USE) || is_beyond(step.velocity, ALLOWED_USE) {
            let (position, velocity) = (step.position, step.velocity);
            self.offend(format!(
                "{}: position step {position:.4}, velocity step {velocity:.4} of what the limits allow in their {:.3} ms",
                what(),
                1e3 * step.elapsed_s
            ));
        }
    }

    fn offend(&mut self, offence: String) {
        self.verdict.offence_count += 1;
        if self.verdict.offences.len() < KEPT_OFFENCES {
            self.verdict.offences.push(offence);
        }
    }
}

impl Verdict {
    /// With what another judge has found.
    #[must_use]
    pub fn and(mut self, other: &Self) -> Self {
        self.setpoints += other.setpoints;
        self.robot_states += other.robot_states;
        self.last_unheard += other.last_unheard;
        self.restarts += other.restarts;
        self.holds_taken += other.holds_taken;
        self.unmatched += other.unmatched;
        self.faults += other.faults;
        self.offence_count += other.offence_count;
        for what in 0..3 {
            self.lost[what] += other.lost[what];
            self.first_unheard[what] += other.first_unheard[what];
        }
        raise(&mut self.velocity, other.velocity);
        raise(&mut self.acceleration, other.acceleration);
        raise(&mut self.reference_error_m, other.reference_error_m);
        self.sent.add(&other.sent);
        self.taken.add(&other.taken);
        self.unled.add(&other.unled);
        self.losses.extend_from_slice(&other.losses);
        self.offences.extend_from_slice(&other.offences);
        self
    }

    /// Notes the numbers between two messages that were heard one after the other.
    fn lose(&mut self, what: usize, before: Option<u64>, now: u64) {
        let Some(before) = before else { return };
        // A number that does not rise is a new process's, which counts from 1.
        let is_new = now <= before;
        let lost = now.saturating_sub(if is_new { 0 } else { before });
        let lost = lost.saturating_sub(1);
        if lost == 0 {
            return;
        }
        let (kind, whose) = if is_new {
            (
                &mut self.first_unheard,
                ", the first heard of a new process",
            )
        } else {
            (&mut self.lost, "")
        };
        kind[what] += lost;
        let messages = ["set-points", "robot states", "cycles"][what];
        self.losses
            .push(format!("{lost} {messages} before number {now}{whose}"));
    }
}

impl StepUse {
    fn add(&mut self, other: &Self) {
        raise(&mut self.position, other.position);
        raise(&mut self.velocity, other.velocity);
        self.pairs += other.pairs;
        self.elapsed_s = self.elapsed_s.max(other.elapsed_s);
    }
}

/// The tendons at one instant.
struct Sample {
    stamp_ns: i64,
    position_m: [f64; 9],
    velocity_m_s: [f64; 9],
}

impl Sample {
    fn of_setpoint(setpoint: &Setpoint) -> Self {
        Self {
            stamp_ns: setpoint.stamp_mono_ns,
            position_m: setpoint.position_m,
            velocity_m_s: setpoint.velocity_m_s,
        }
    }

    fn of_robot(state: &RobotState) -> Self {
        Self {
            stamp_ns: state.stamp_mono_ns,
            position_m: state.accepted_setpoint_m,
            velocity_m_s: state.accepted_velocity_m_s,
        }
    }
}

fn seconds(interval_ns: i64) -> f64 {
    interval_ns as f64 * 1e-9
}

fn largest_step(before: &[f64; 9], now: &[f64; 9]) -> f64 {
    largest(&std::array::from_fn(|tendon| now[tendon] - before[tendon]))
}

/// Whether a use of a limit is an offence; one that is no number is.
fn is_beyond(used: f64, allowed: f64) -> bool {
    used.is_nan() || used > allowed
}

#[cfg(test)]
mod tests;
