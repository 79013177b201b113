//! Where a request begins that begins where the robot is: where it holds, or where it can leave the motion that it follows.

use std::sync::Arc;
use std::time::Duration;

use pcc_model::Configuration;
use planning::{Problem, Request, StartMotion};
use shared_types::codes::{Outcome, Sampler};

use super::refusal::Refusal;
use super::request_validator::PlanTask;
use crate::execution::{RobotMotion, Switch};

/// Time from a plan until the controller's loop has it, beside the time that planning takes.
const TO_THE_LOOP: Duration = Duration::from_micros(2_500);
/// Lead of the first requests of a sampler, before it is known how long they take.
const FIRST_LEAD: Duration = Duration::from_millis(15);
/// Plans by which the next one's duration is foreseen.
const REMEMBERED: usize = 32;
/// Plans that may have taken longer than what is foreseen.
const EXCEPTIONS: usize = 1;
/// Share of time that is added to what is foreseen.
const MARGIN: f64 = 1.1;

/// Why a request cannot begin where the robot is.
#[derive(Debug, PartialEq)]
pub(super) enum NotReady {
    /// It can in a moment: the motion ends, or is about to be left.
    Passes(Refusal),
    /// It cannot.
    Stays(Refusal),
}

/// Sets the start of a task to where the robot is, `lead` from now; returns where it leaves the motion that is followed, if it does.
pub(super) fn begin_at_robot(
    task: &mut PlanTask,
    robot: &RobotMotion,
    lead: Duration,
    now_mono_ns: i64,
) -> Result<Option<Switch>, NotReady> {
    match robot {
        RobotMotion::Holding(configuration) => {
            set_start(task, *configuration, None);
            Ok(None)
        }
        RobotMotion::Following(followed) => {
            let switch = followed.switch_after(lead, now_mono_ns).ok_or_else(|| {
                let id = followed.trajectory_id;
                NotReady::Passes(refusal(&format!("trajectory {id} is about to end")))
            })?;
            let motion = StartMotion {
                velocity: switch.state.velocity,
                acceleration: switch.state.acceleration,
            };
            set_start(task, switch.state.position, Some(motion));
            Ok(Some(switch))
        }
        RobotMotion::Busy {
            state,
            fault,
            passes,
        } => {
            let reason = refusal(&format!("the controller is {state} (fault: {fault})"));
            Err(if *passes {
                NotReady::Passes(reason)
            } else {
                NotReady::Stays(reason)
            })
        }
        RobotMotion::Unknown => Err(NotReady::Stays(refusal(
            "no controller: its state is missing or older than 200 ms",
        ))),
    }
}

fn refusal(what: &str) -> Refusal {
    let reason = format!("the motion cannot begin where the robot is: {what}");
    Refusal::new(Outcome::RobotNotReady, reason)
}

fn set_start(task: &mut PlanTask, start: Configuration, motion: Option<StartMotion>) {
    task.problem = Arc::new(Problem {
        start,
        ..Problem::clone(&task.problem)
    });
    task.request = Request {
        start_motion: motion,
        ..task.request.clone()
    };
}

/// How long plans of each sampler took lately, from their begin until they were handed over for publication.
#[derive(Debug, Default)]
pub(super) struct LeadTimes {
    recent: Vec<(Sampler, Vec<Duration>)>,
}

impl LeadTimes {
    /// Remembers how long a plan took.
    pub(super) fn note(&mut self, sampler: Sampler, took: Duration) {
        let known = self.recent.iter().position(|(known, _)| *known == sampler);
        let index = known.unwrap_or_else(|| {
            self.recent.push((sampler, Vec::new()));
            self.recent.len() - 1
        });
        let recent = &mut self.recent[index].1;
        if recent.len() == REMEMBERED {
            recent.remove(0);
        }
        recent.push(took);
    }

    /// How far ahead a plan of this sampler is to begin, so that it is in the loop by then.
    pub(super) fn lead(&self, sampler: Sampler) -> Duration {
        let known = self.recent.iter().find(|(known, _)| *known == sampler);
        let mut recent = known.map(|(_, recent)| recent.clone()).unwrap_or_default();
        recent.sort_unstable();
        let foreseen = recent.iter().rev().nth(EXCEPTIONS);
        foreseen.map_or(FIRST_LEAD, |took| took.mul_f64(MARGIN) + TO_THE_LOOP)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::task;
    use shared_types::codes::{LoopFault, LoopState};

    const LEAD: Duration = Duration::from_millis(5);

    #[test]
    fn a_request_begins_where_the_robot_holds() {
        let mut task = task();
        let held = Configuration::repeat(0.3);
        let switch = begin_at_robot(&mut task, &RobotMotion::Holding(held), LEAD, 0);
        assert_eq!(switch, Ok(None));
        assert_eq!(task.problem.start, held);
        assert!(task.request.start_motion.is_none());
    }

    #[test]
    fn who_does_not_hold_and_does_not_follow_is_told_why() {
        let busy = |state, passes| RobotMotion::Busy {
            state,
            fault: LoopFault::None,
            passes,
        };
        for (robot, text) in [
            (busy(LoopState::Stopping, false), "stopping"),
            (busy(LoopState::Executing, true), "executing"),
            (RobotMotion::Unknown, "no controller"),
        ] {
            let not_ready = begin_at_robot(&mut task(), &robot, LEAD, 0).unwrap_err();
            let (NotReady::Passes(refusal) | NotReady::Stays(refusal)) = not_ready;
            assert_eq!(refusal.outcome, Outcome::RobotNotReady);
            assert!(refusal.reason.contains(text), "{}", refusal.reason);
        }
    }

    #[test]
    fn the_lead_follows_what_plans_took_and_forgets_single_exceptions() {
        let ms = Duration::from_millis;
        let mut times = LeadTimes::default();
        assert_eq!(times.lead(Sampler::Default), FIRST_LEAD);
        for _ in 0..40 {
            times.note(Sampler::Default, ms(2));
        }
        times.note(Sampler::Default, ms(90));
        times.note(Sampler::Diffusion, ms(200));
        assert_eq!(
            times.lead(Sampler::Default),
            ms(2).mul_f64(MARGIN) + TO_THE_LOOP
        );
        times.note(Sampler::Default, ms(80));
        assert!(times.lead(Sampler::Default) > ms(80));
    }
}
