//! The goal that counts, and the motions to it.

use pcc_model::{Configuration, UnitRobot};
use shared_types::codes::LoopState;
use shared_types::valid::{Goal, StandingGoal};

use super::moving_target::Anticipation;
use crate::execution::RobotMotion;

/// Longest wait of a robot at rest for the result of its motion, which may be lost, nanoseconds.
const RESULT_WAIT_NS: i64 = 100_000_000;

/// Longest time in which a robot is about to be ready, nanoseconds.
const BUSY_WAIT_NS: i64 = 100_000_000;
/// Difference within which configurations of a robot at rest are the same, rad.
pub(super) const SAME_CONFIGURATION_RAD: f64 = 1e-6;
/// Distance of tips nearby, section lengths.
const NEARBY: f64 = 0.1;
/// Distance of configurations nearby, rad: where one section bends so much further, its own end moves by half as many section lengths.
const NEARBY_RAD: f64 = 0.1;

/// A motion that was published for the goal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PublishedMotion {
    pub(crate) trajectory_id: u32,
    pub(crate) duration_s: f64,
}

/// Where a goal was when a plan was made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Target {
    pub(super) given_mono_ns: i64,
    pub(super) goal: Goal,
    pub(super) limits_scale: f64,
}

impl Target {
    /// Whether a motion to the other one is a motion to this one.
    pub(super) fn is_same(&self, other: &Self) -> bool {
        (self.goal, self.limits_scale) == (other.goal, other.limits_scale)
    }
}

/// A motion to the goal that is under way, or about to be.
#[derive(Clone, Copy, Debug)]
pub(super) struct Heading {
    pub(super) motion: PublishedMotion,
    pub(super) target: Target,
}

/// A goal that the robot has reached.
#[derive(Clone, Copy, Debug)]
struct Arrival {
    goal: Goal,
    /// Where the robot rests, as soon as that is known.
    rests_at: Option<Configuration>,
}

/// A goal that was not given up.
#[derive(Clone, Debug)]
pub(super) struct KeptGoal {
    pub(super) newest: StandingGoal,
    /// What the last plan was made for, where that still counts.
    pub(super) last_planned_for: Option<Target>,
    /// Where the goal was when the last plan was made.
    pub(super) last_goal: Option<Goal>,
    /// The motions that are not known to have ended: the newest, and before it the one that it leaves.
    pub(super) headings: Vec<Heading>,
    /// Since when the robot rests although no result of the newest motion was heard, nanoseconds.
    pub(super) rests_since_mono_ns: Option<i64>,
    /// Since when the robot has been about to be ready, nanoseconds.
    busy_since_mono_ns: Option<i64>,
    /// Whether the controller has refused the last motion.
    pub(super) was_refused: bool,
    /// The goal that the robot has reached, and has not been away from since.
    arrival: Option<Arrival>,
    pub(super) previous_plan_id: Option<u64>,
    /// Whether the motion that is followed is not certified to its end any more.
    pub(super) is_blocked: bool,
    pub(super) anticipation: Anticipation,
    /// No plan to where the goal has moved on begins before this time, nanoseconds.
    next_plan_mono_ns: i64,
    /// No plan to where the goal has jumped begins before this time, nanoseconds.
    next_jump_mono_ns: i64,
    /// No plan for the same as the last one begins before this time, nanoseconds.
    pub(super) look_again_mono_ns: i64,
}

impl KeptGoal {
    /// A goal that takes the place of another one, whose motions go on until they are left.
    pub(super) fn after(before: Option<Self>, newest: StandingGoal) -> Self {
        let next = |of: fn(&Self) -> i64| before.as_ref().map_or(0, of);
        let next_plan_mono_ns = next(|it| it.next_plan_mono_ns);
        let next_jump_mono_ns = next(|it| it.next_jump_mono_ns);
        Self {
            newest,
            last_planned_for: None,
            last_goal: None,
            headings: before.map(|before| before.headings).unwrap_or_default(),
            rests_since_mono_ns: None,
            busy_since_mono_ns: None,
            was_refused: false,
            arrival: None,
            previous_plan_id: None,
            is_blocked: false,
            anticipation: Anticipation::default(),
            next_plan_mono_ns,
            next_jump_mono_ns,
            look_again_mono_ns: 0,
        }
    }

    /// No plan begins before this time, nanoseconds: the first one to where a goal has jumped does not wait.
    pub(super) fn next_plan_mono_ns(&self, has_jumped: bool) -> i64 {
        match has_jumped {
            true => self.next_jump_mono_ns,
            false => self.next_plan_mono_ns,
        }
    }

    /// Notes that a plan begins, and when the next one may.
    pub(super) fn note_plan(&mut self, has_jumped: bool, next_mono_ns: i64) {
        self.next_plan_mono_ns = next_mono_ns;
        if has_jumped {
            self.next_jump_mono_ns = next_mono_ns;
        }
    }

    /// Lets the next plan begin now: the motion of the last one came too late for its switch.
    pub(super) fn plan_at_once(&mut self) {
        self.next_plan_mono_ns = 0;
        self.next_jump_mono_ns = 0;
    }

    /// What a plan that begins now is for: where a goal that moves will be.
    pub(super) fn target(
        &mut self,
        unit: &UnitRobot,
        robot: &RobotMotion,
        now_mono_ns: i64,
    ) -> Target {
        let newest = &self.newest;
        Target {
            given_mono_ns: newest.given_mono_ns,
            goal: self.anticipation.aim(newest, unit, robot, now_mono_ns),
            limits_scale: newest.limits_scale,
        }
    }

    /// Whether the last plan was for this goal, and for a place near the target.
    pub(super) fn was_planned_nearby(&self, target: &Target, unit: &UnitRobot) -> bool {
        self.last_planned_for
            .filter(|last| last.given_mono_ns == target.given_mono_ns)
            .is_some_and(|last| are_nearby(&last.goal, &target.goal, unit))
    }

    pub(super) fn is_headed_for(&self, target: &Target) -> bool {
        let heading = self.headings.last();
        heading.is_some_and(|heading| heading.target.is_same(target))
    }

    pub(super) fn head(&mut self, heading: Heading) {
        // What was left before this one's own was left is over.
        let left = self.headings.pop();
        self.headings = left.into_iter().chain([heading]).collect();
        self.arrival = None;
        self.rests_since_mono_ns = None;
    }

    /// Whether a robot that is about to be ready has been so for longer than that takes. One that follows a motion until another one joins may take
    /// as long as a pause, or as a low speed, has it.
    pub(super) fn is_long_busy(&mut self, robot: &RobotMotion, now_mono_ns: i64) -> bool {
        let RobotMotion::Busy {
            state,
            passes: true,
            ..
        } = robot
        else {
            self.busy_since_mono_ns = None;
            return false;
        };
        if *state == LoopState::Executing {
            self.busy_since_mono_ns = None;
            return false;
        }
        let since = *self.busy_since_mono_ns.get_or_insert(now_mono_ns);
        now_mono_ns - since > BUSY_WAIT_NS
    }

    /// Notes that a motion to a goal has ended there.
    pub(super) fn arrive(&mut self, goal: Goal) {
        self.arrival = Some(Arrival {
            goal,
            rests_at: None,
        });
    }

    /// Whether the robot has reached this goal, and is not known to have been away from it since.
    pub(super) fn has_arrived(&self, goal: &Goal) -> bool {
        self.arrival.is_some_and(|arrival| arrival.goal == *goal)
    }

    /// Whether a robot that holds this configuration rests where it was first seen to hold after its motion to this goal. Elsewhere, as after its driver began anew, it has
    /// left the goal.
    pub(super) fn still_rests(&mut self, goal: &Goal, configuration: &Configuration) -> bool {
        let arrival = self.arrival.as_mut().filter(|it| it.goal == *goal);
        let Some(arrival) = arrival else {
            return false;
        };
        let rests_at = *arrival.rests_at.get_or_insert(*configuration);
        let is_there = (rests_at - configuration).amax() <= SAME_CONFIGURATION_RAD;
        if !is_there {
            self.arrival = None;
        }
        is_there
    }

    /// Whether the result of a motion is awaited by a robot that rests; where it does not come the motion is over all the same.
    pub(super) fn awaits_result(&mut self, now_mono_ns: i64) -> bool {
        if self.headings.is_empty() {
            return false;
        }
        let since = *self.rests_since_mono_ns.get_or_insert(now_mono_ns);
        if now_mono_ns - since < RESULT_WAIT_NS {
            return true;
        }
        self.headings.clear();
        self.last_planned_for = None;
        false
    }
}

/// Whether two goals are tips or configurations near to each other.
pub(super) fn are_nearby(a: &Goal, b: &Goal, robot: &UnitRobot) -> bool {
    match (*a, *b) {
        (Goal::Configuration(a), Goal::Configuration(b)) => {
            (Configuration::from(a) - Configuration::from(b)).norm() <= NEARBY_RAD
        }
        (Goal::Tip { position_m: a, .. }, Goal::Tip { position_m: b, .. }) => {
            let [a, b] = [a, b].map(|it| robot.point_in_section_lengths(it));
            (a - b).norm() <= NEARBY
        }
        _ => false,
    }
}
