//! The results of motions: one for each trajectory that was received, kept until it is published.

use std::collections::VecDeque;

use shared_types::{
    clock::mono_now_ns,
    codes::MotionOutcome,
    message::{MotionResult, ReasonText},
    valid::{MAX_DURATION_S, Signature},
};

use crate::executive::{EndedMotion, Ending, Motion, StopOrigin, TrajectoryRefusal};

/// The trajectory that a result is about.
#[derive(Clone, Copy)]
pub(super) struct Subject {
    pub(super) trajectory_id: u32,
    pub(super) plan_id: u64,
    /// 0 where it is malformed.
    pub(super) duration_s: f64,
}

impl From<&Motion> for Subject {
    fn from(motion: &Motion) -> Self {
        let duration_s = motion.duration_s();
        let is_possible = (0.0..=MAX_DURATION_S).contains(&duration_s);
        Self {
            trajectory_id: motion.id,
            plan_id: motion.plan_id,
            duration_s: if is_possible { duration_s } else { 0.0 },
        }
    }
}

/// Results that were not published yet, and the motions that will have one.
pub(super) struct Results {
    /// Instance of this controller.
    instance: u64,
    sequence: u64,
    /// Motions that were handed to the loop and did not come back.
    at_loop: Vec<Subject>,
    unsent: VecDeque<MotionResult>,
}

impl Results {
    pub(super) fn new(instance: u64) -> Self {
        Self {
            instance,
            sequence: 0,
            at_loop: Vec::new(),
            unsent: VecDeque::new(),
        }
    }

    /// Whether the loop has the motion with this id.
    pub(super) fn is_at_loop(&self, trajectory_id: u32) -> bool {
        let mut open = self.at_loop.iter();
        open.any(|open| open.trajectory_id == trajectory_id)
    }

    /// Whether a motion is at the loop.
    pub(super) fn are_open(&self) -> bool {
        !self.at_loop.is_empty()
    }

    /// Notes that a motion is handed to the loop.
    pub(super) fn handed_over(&mut self, motion: &Motion) {
        self.at_loop.push(motion.into());
    }

    /// The result of a motion that the loop gives back; `fault` says what happened where a fault has stopped it.
    pub(super) fn ended(&mut self, ended: &EndedMotion, fault: &str) {
        let reason = match &ended.ending {
            Ending::Reached => String::new(),
            Ending::Joined(id) => format!("trajectory {id} left it at {:.3} s", ended.path_time_s),
            Ending::Stopped(StopOrigin::Fault(code))
            | Ending::SetAside(StopOrigin::Fault(code)) => {
                format!("{code}: {fault}")
            }
            Ending::Stopped(origin) | Ending::SetAside(origin) => origin.to_string(),
        };
        let mut result = told(&ended.ending);
        result.stamp_mono_ns = ended.stamp_ns;
        result.path_time_s = ended.path_time_s;
        result.reason = ReasonText::new(&reason);
        self.add(&(&ended.motion).into(), result);
    }

    /// The result of a trajectory that is not taken, or not begun.
    pub(super) fn refused(&mut self, subject: &Subject, reason: &TrajectoryRefusal) {
        let result = MotionResult {
            stamp_mono_ns: mono_now_ns(),
            outcome: MotionOutcome::Refused.code(),
            refusal: reason.code().code(),
            reason: ReasonText::new(&reason.to_string()),
            ..MotionResult::ZEROED
        };
        self.add(subject, result);
    }

    /// The results of the motions that the loop does not give back, since the process ends; `path_time_s` is the path time of those that
    /// have begun.
    pub(super) fn give_up(&mut self, path_time_s: impl Fn(u32) -> Option<f64>) {
        for subject in std::mem::take(&mut self.at_loop) {
            let begun = path_time_s(subject.trajectory_id);
            let ending = match begun {
                Some(_) => Ending::Stopped(StopOrigin::Shutdown),
                None => Ending::SetAside(StopOrigin::Shutdown),
            };
            let mut result = told(&ending);
            result.stamp_mono_ns = mono_now_ns();
            result.path_time_s = begun.unwrap_or(0.0);
            result.reason = ReasonText::new(StopOrigin::Shutdown.code().text());
            self.add(&subject, result);
        }
    }

    fn add(&mut self, subject: &Subject, result: MotionResult) {
        let id = subject.trajectory_id;
        self.at_loop.retain(|open| open.trajectory_id != id);
        // Nobody could ask for it.
        if id == 0 {
            return;
        }
        self.sequence += 1;
        self.unsent.push_back(MotionResult {
            instance: self.instance,
            sequence: self.sequence,
            trajectory_id: id,
            plan_id: subject.plan_id,
            duration_s: subject.duration_s,
            ..result
        });
    }

    /// Publishes results in order, up to the first one that `send` cannot send.
    pub(super) fn send(&mut self, mut send: impl FnMut(&MotionResult) -> bool) {
        while self.unsent.front().is_some_and(&mut send) {
            self.unsent.pop_front();
        }
    }
}

/// The codes of a result.
fn told(ending: &Ending) -> MotionResult {
    let mut result = MotionResult {
        outcome: ending.code().code(),
        ..MotionResult::ZEROED
    };
    if let Ending::Joined(id) = ending {
        result.joined_by = *id;
    }
    if let Some(origin) = ending.origin() {
        result.cause = origin.code().code();
        if let Some(Signature {
            sender, sender_pid, ..
        }) = origin.signature()
        {
            result.sender = sender.code();
            result.sender_pid = *sender_pid;
        }
        if let StopOrigin::Fault(fault) = origin {
            result.fault = fault.code();
        }
    }
    result
}
