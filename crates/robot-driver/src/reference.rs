//! The reference that a robot's motors track: set-point checks, extrapolation, and the ramp to rest.
//!
//! Between set-points the reference goes on at constant velocity. After [`ReferenceLimits::lost_after_ns`] without one
//! it ramps to rest: all tendon velocities are scaled by one factor, so that the robot decelerates along its path's tangent,
//! and that factor falls so fast that the fastest tendon decelerates at the acceleration limit. A ramp that has begun
//! is finished: set-points are refused until the robot is at rest, and then only those that begin where it stands.
//!
//! No cycle counts for more than [`ReferenceLimits::longest_cycle_ns`], or than the shortest of the last [`USUAL_CYCLES`] where a loop takes longer than
//! it was set up for. In a pause of the whole machine nobody can send, so that the controller
//! is not lost, and its next set-point is a short step further; where the driver alone is held up, the controller has gone on, and what it
//! then sends is too far: a ramp to rest from where the motors are, and no fault of the controller's.
//!
//! A set-point that breaks a rule while the robot follows latches a fault: the old reference is kept and ramped to
//! rest. The fault lasts until the line has been silent for [`FAULT_SILENCE_NS`]: a controller goes silent only when
//! it starts or is reset.

use crate::setpoint::{Mode, MotorTargets, ReferenceLimits, Refusal, TendonState};
use crate::tendon_vector::{TENDONS, TendonVector};
use shared_types::clock::seconds;
use shared_types::message::Setpoint;

/// Silence after which a latched fault is forgiven, ns.
pub const FAULT_SILENCE_NS: i64 = 100_000_000;

/// A set-point may be stamped this far in the future, ns (both ends read the same clock).
const STAMP_ALLOWANCE_NS: i64 = 1_000_000;

/// Cycles of which the shortest is the usual one of a loop.
const USUAL_CYCLES: usize = 8;

/// Slack of a step in position and velocity: what the limits allow in this time, s.
const SLACK_S: f64 = 1e-4;

/// The reference that the motors track.
#[derive(Clone, Debug)]
pub struct Reference {
    limits: ReferenceLimits,
    mode: Mode,
    /// The last accepted set-point, or the reference at the begin of a ramp.
    anchor: Setpoint,
    /// Factor on the anchor's velocity: 1 while following, falling to 0 in a ramp.
    ramp: f64,
    position_m: TendonVector,
    stepped_ns: i64,
    /// How long the last cycles were, the oldest first.
    cycles_ns: [i64; USUAL_CYCLES],
    /// Cycle time since the last set-point, good or not.
    silent_ns: i64,
    ramps_to_rest: u32,
    refused: u32,
}

impl Reference {
    /// A reference that begins in a state: at rest it is [`Mode::Idle`], otherwise it ramps to rest.
    #[must_use]
    pub fn new(limits: ReferenceLimits, now_ns: i64, state: &TendonState) -> Self {
        let TendonState {
            position_m,
            velocity_m_s,
        } = *state;
        let moving = largest(&velocity_m_s) > 0.0;
        Self {
            limits,
            mode: if moving { Mode::Ramping } else { Mode::Idle },
            anchor: Setpoint {
                stamp_mono_ns: now_ns,
                position_m,
                velocity_m_s,
                ..Setpoint::ZEROED
            },
            ramp: if moving { 1.0 } else { 0.0 },
            position_m,
            stepped_ns: now_ns,
            cycles_ns: [0; USUAL_CYCLES],
            silent_ns: 0,
            ramps_to_rest: u32::from(moving),
            refused: 0,
        }
    }

    /// One cycle: takes `setpoint` where one arrived, moves on to `now_ns`, and says what the motors are to do.
    pub fn step(&mut self, now_ns: i64, setpoint: Option<&Setpoint>) -> MotorTargets {
        let counted_ns = self.count_cycle(now_ns);
        if let Some(setpoint) = setpoint {
            // A refusal is kept in mode and counter.
            let _ = self.offer(now_ns, setpoint);
        }
        self.go_on(now_ns, counted_ns);
        MotorTargets {
            stamp_ns: now_ns,
            position_m: self.position_m,
            velocity_m_s: self.velocity_m_s(),
            acceleration_m_s2: self.acceleration_m_s2(),
        }
    }

    /// Whether the reference follows set-points, ramps to rest, or rests.
    #[must_use]
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Position of the reference, m.
    #[must_use]
    pub fn position_m(&self) -> &TendonVector {
        &self.position_m
    }

    /// Velocity of the reference, m/s.
    #[must_use]
    pub fn velocity_m_s(&self) -> TendonVector {
        self.anchor
            .velocity_m_s
            .map(|velocity| velocity * self.ramp)
    }

    /// Acceleration of the reference, m/s²: the set-point's while following, the ramp's otherwise.
    #[must_use]
    pub fn acceleration_m_s2(&self) -> TendonVector {
        match self.mode {
            Mode::Following => self.anchor.acceleration_m_s2,
            _ if self.ramp > 0.0 => {
                let rate = self.ramp_rate_per_s();
                self.anchor.velocity_m_s.map(|velocity| -velocity * rate)
            }
            _ => [0.0; TENDONS],
        }
    }

    /// Sequence of the last accepted set-point, 0 before the first.
    #[must_use]
    pub fn accepted_sequence(&self) -> u64 {
        self.anchor.sequence
    }

    /// Cycle time since the last set-point, good or not, s.
    #[must_use]
    pub fn silent_s(&self) -> f64 {
        seconds(self.silent_ns)
    }

    /// Time since the last accepted set-point's stamp, s.
    #[must_use]
    pub fn set_point_age_s(&self, now_ns: i64) -> f64 {
        seconds(now_ns - self.anchor.stamp_mono_ns)
    }

    /// How often the reference went to rest by itself: set-points stopped coming or broke a rule, the driver was shut down in motion, or the
    /// motors moved when it began.
    #[must_use]
    pub fn ramps_to_rest(&self) -> u32 {
        self.ramps_to_rest
    }

    /// How many set-points were refused.
    #[must_use]
    pub fn refused(&self) -> u32 {
        self.refused
    }

    /// Moves the reference on to `now_ns`.
    pub fn advance(&mut self, now_ns: i64) {
        let counted_ns = self.count_cycle(now_ns);
        self.go_on(now_ns, counted_ns);
    }

    /// Ends a cycle at `now_ns`; how much it counts for, ns.
    fn count_cycle(&mut self, now_ns: i64) -> i64 {
        let elapsed_ns = (now_ns - self.stepped_ns).max(0);
        self.stepped_ns += elapsed_ns;
        self.cycles_ns.rotate_left(1);
        self.cycles_ns[USUAL_CYCLES - 1] = elapsed_ns;
        let usual_ns = self.cycles_ns.iter().copied().min().unwrap_or(0);
        let counted_ns = elapsed_ns.min(self.limits.longest_cycle_ns.max(usual_ns));
        self.silent_ns += counted_ns;
        counted_ns
    }

    /// Moves the reference on to `now_ns` in a cycle that counts for so much.
    fn go_on(&mut self, now_ns: i64, counted_ns: i64) {
        let (elapsed_s, silent_ns) = (seconds(counted_ns), self.silent_ns);
        match self.mode {
            Mode::Following if silent_ns > self.limits.lost_after_ns => {
                self.begin_ramp(Mode::Ramping);
                self.ramp_on(elapsed_s);
            }
            Mode::Following => self.extrapolate(now_ns),
            Mode::Ramping => self.ramp_on(elapsed_s),
            Mode::Fault(_) => {
                self.ramp_on(elapsed_s);
                if self.ramp == 0.0 && silent_ns > FAULT_SILENCE_NS {
                    self.mode = Mode::AtRestAfterLoss;
                }
            }
            Mode::Idle | Mode::AtRestAfterLoss => {}
        }
    }

    /// Ramps to rest from now on.
    pub fn ramp_to_rest(&mut self) {
        if self.mode == Mode::Following {
            self.begin_ramp(Mode::Ramping);
        }
    }

    /// Takes a set-point that arrived at `now_ns`, or refuses it and keeps the old reference.
    ///
    /// # Errors
    /// The first rule of [`Refusal`] that it breaks. While following, that rule is latched as a fault.
    pub fn offer(&mut self, now_ns: i64, target: &Setpoint) -> Result<(), Refusal> {
        self.silent_ns = 0;
        let checked = self.check(now_ns, target);
        match checked {
            Ok(()) => self.accept(now_ns, target),
            Err(refusal) => {
                self.refused = self.refused.wrapping_add(1);
                if self.mode == Mode::Following {
                    let is_held_up = now_ns - self.anchor.stamp_mono_ns > self.longest_step_ns();
                    let is_too_far =
                        matches!(refusal, Refusal::PositionStep | Refusal::VelocityStep);
                    self.begin_ramp(match is_held_up && is_too_far {
                        true => Mode::Ramping,
                        false => Mode::Fault(refusal),
                    });
                }
            }
        }
        checked
    }

    fn accept(&mut self, now_ns: i64, target: &Setpoint) {
        self.mode = Mode::Following;
        self.anchor = *target;
        self.ramp = 1.0;
        self.extrapolate(now_ns);
    }

    fn check(&self, now_ns: i64, target: &Setpoint) -> Result<(), Refusal> {
        let numbers = [
            &target.position_m,
            &target.velocity_m_s,
            &target.acceleration_m_s2,
        ];
        if !numbers
            .iter()
            .all(|numbers| numbers.iter().all(|x| x.is_finite()))
        {
            return Err(Refusal::NotFinite);
        }
        let elapsed_s = match self.mode {
            Mode::Ramping | Mode::Fault(_) => return Err(Refusal::NotAtRest),
            Mode::Idle | Mode::AtRestAfterLoss
                if target.stamp_mono_ns < now_ns - self.limits.lost_after_ns =>
            {
                return Err(Refusal::Stamp);
            }
            Mode::Idle | Mode::AtRestAfterLoss => 0.0,
            Mode::Following if target.stamp_mono_ns <= self.anchor.stamp_mono_ns => {
                return Err(Refusal::Stamp);
            }
            Mode::Following => {
                let elapsed_ns = target.stamp_mono_ns - self.anchor.stamp_mono_ns;
                seconds(elapsed_ns.min(self.longest_step_ns()))
            }
        };
        if target.stamp_mono_ns > now_ns + STAMP_ALLOWANCE_NS {
            return Err(Refusal::Stamp);
        }
        self.check_steps(elapsed_s, target)
    }

    /// The longest time that a set-point may be ahead of the one before it in its motion, ns: after a pause of the whole machine the controller
    /// goes on by as much as without it, and then by every cycle until the driver looks.
    fn longest_step_ns(&self) -> i64 {
        self.limits.lost_after_ns + self.limits.longest_cycle_ns
    }

    fn check_steps(&self, elapsed_s: f64, target: &Setpoint) -> Result<(), Refusal> {
        let velocity_m_s = self.limits.velocity_m_s * self.limits.allowance;
        let acceleration_m_s2 = self.limits.acceleration_m_s2 * self.limits.allowance;
        let (position_m, current_m_s) = match self.mode {
            Mode::Following => (self.anchor.position_m, self.anchor.velocity_m_s),
            _ => (self.position_m, [0.0; TENDONS]),
        };
        let allowed_s = elapsed_s + SLACK_S;
        if largest_difference(&target.position_m, &position_m) > velocity_m_s * allowed_s {
            return Err(Refusal::PositionStep);
        }
        if largest(&target.velocity_m_s) > velocity_m_s {
            return Err(Refusal::Velocity);
        }
        if largest_difference(&target.velocity_m_s, &current_m_s) > acceleration_m_s2 * allowed_s {
            return Err(Refusal::VelocityStep);
        }
        if largest(&target.acceleration_m_s2) > acceleration_m_s2 {
            return Err(Refusal::Acceleration);
        }
        Ok(())
    }

    fn extrapolate(&mut self, now_ns: i64) {
        let age_s =
            seconds((now_ns - self.anchor.stamp_mono_ns).clamp(0, self.limits.lost_after_ns));
        for (tendon, position_m) in self.position_m.iter_mut().enumerate() {
            *position_m = self.anchor.position_m[tendon] + self.anchor.velocity_m_s[tendon] * age_s;
        }
    }

    fn begin_ramp(&mut self, mode: Mode) {
        self.mode = mode;
        self.ramps_to_rest = self.ramps_to_rest.wrapping_add(1);
    }

    /// How fast the ramp factor falls, 1/s: the fastest tendon decelerates at the limit.
    fn ramp_rate_per_s(&self) -> f64 {
        let fastest_m_s = largest(&self.anchor.velocity_m_s);
        if fastest_m_s > 0.0 {
            self.limits.acceleration_m_s2 / fastest_m_s
        } else {
            f64::INFINITY
        }
    }

    fn ramp_on(&mut self, elapsed_s: f64) {
        if self.ramp == 0.0 {
            return;
        }
        let rate_per_s = self.ramp_rate_per_s();
        let left_s = self.ramp / rate_per_s;
        let braked_s = elapsed_s.min(left_s);
        let next = if left_s <= elapsed_s {
            0.0
        } else {
            self.ramp - rate_per_s * braked_s
        };
        let travelled_s = 0.5 * (self.ramp + next) * braked_s;
        for (position_m, velocity_m_s) in self.position_m.iter_mut().zip(&self.anchor.velocity_m_s)
        {
            *position_m += velocity_m_s * travelled_s;
        }
        self.ramp = next;
        if next == 0.0 && self.mode == Mode::Ramping {
            self.mode = Mode::AtRestAfterLoss;
        }
    }
}

fn largest(values: &TendonVector) -> f64 {
    values
        .iter()
        .fold(0.0, |most: f64, value| most.max(value.abs()))
}

/// The largest difference of two vectors' elements.
pub(crate) fn largest_difference(a: &TendonVector, b: &TendonVector) -> f64 {
    a.iter()
        .zip(b)
        .fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()))
}

#[cfg(test)]
mod tests;
