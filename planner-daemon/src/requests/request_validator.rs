//! Validation of a plan request: converts SI units to the planner's (lengths in sections), or refuses it with a reason.

use std::sync::Arc;
use std::time::Duration;

use collision::{Ball, Scene};
use pcc_model::{Configuration, SECTIONS, UnitRobot};
use planning::{
    Candidate, Goal, MOST_CORRECTIONS, MovingObstacles, PreviousPlan, Problem, Request,
    StartMotion, Via,
};
use shared_types::capacity::MAX_KNOTS;
use shared_types::clock::mono_now_ns;
use shared_types::codes::{PlanField, Selection, Source, StartKind};
use shared_types::ipc::PlanServiceCapacity;
use shared_types::valid::{self, PlanRequest, SelectionRule};
use trajectory::STOPPING_KNOTS;

use super::planner_kind::PlannerKind;
use super::recent_plans::RecentPlans;
use super::refusal::Refusal;
use crate::tip_tolerance::tip_tolerance;

/// Checks plan requests against this daemon's capacity and clock, and adds its static scene and defaults.
#[derive(Clone, Debug)]
pub(crate) struct RequestValidator {
    /// The robot, whose section length is the planner's unit.
    pub(crate) robot: UnitRobot,
    /// What the plan service holds.
    pub(crate) capacity: PlanServiceCapacity,
    /// Time that an answer may take where the request does not say.
    pub(crate) default_deadline: Duration,
    /// Padding of each section's tube that every certificate includes, section lengths.
    pub(crate) padding: [f64; SECTIONS],
    /// Obstacles of every request, in units of the section length.
    pub(crate) static_scene: Scene,
    /// What answers.
    pub(crate) planner: PlannerKind,
}

/// A validated request in the planner's units.
#[derive(Clone, Debug)]
pub(crate) struct PlanTask {
    /// The client's number of the request.
    pub(crate) request_id: u64,
    /// The problem in units of the section length.
    pub(crate) problem: Arc<Problem>,
    /// The planner's request: what to deliver.
    pub(crate) request: Request,
    pub(crate) knots: MostKnots,
    /// Whether it begins where the robot is when planning begins; `problem` and `request` hold no start until then.
    pub(crate) starts_at_robot: bool,
    /// Whether the live scene's obstacles are left out of planning.
    pub(crate) ignores_live_scene: bool,
    /// Goals that the motion passes before the problem's own.
    pub(crate) via: Vec<Via>,
    /// Goals that the robot's motion still has ahead when planning begins, to be passed before `via`; none until then.
    pub(crate) ahead: Vec<Via>,
    /// Whether its goals are reached after those ahead.
    pub(crate) appends: bool,
    /// The motion whose end may be moved to the goal, if the robot follows it.
    pub(crate) moves_end_of: Option<u32>,
    /// Time that the answer may take.
    pub(crate) deadline: Duration,
    /// Distance from the goal that counts as reached, section lengths.
    pub(crate) tip_tolerance: f64,
    /// Which candidate is selected.
    pub(crate) selection: SelectionRule,
    /// When it was asked for, nanoseconds of `CLOCK_MONOTONIC`, if the selected motion is to be executed.
    pub(crate) requested_mono_ns: Option<i64>,
    /// The earliest begin, nanoseconds of `CLOCK_MONOTONIC`; none: as soon as possible.
    pub(crate) begin_mono_ns: Option<i64>,
    /// Certified candidates that are answered before the whole answer.
    pub(crate) early: Option<usize>,
}

/// Knots that a motion of a task may have.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MostKnots {
    pub(crate) from_rest: usize,
    /// In motion it brakes, too.
    pub(crate) in_motion: usize,
    /// One whose end is moved has those of earlier displacements, too.
    pub(crate) end_moved: usize,
}

impl MostKnots {
    /// Those of a motion that begins in motion, or at rest.
    pub(super) fn of(self, is_in_motion: bool) -> usize {
        if is_in_motion {
            self.in_motion
        } else {
            self.from_rest
        }
    }
}

impl PlanTask {
    /// Knots that a candidate may have.
    pub(super) fn most_knots(&self, candidate: &Candidate) -> usize {
        match candidate.source {
            Source::MovedEnd => self.knots.end_moved,
            _ => self.request.knots,
        }
    }

    /// Whether it goes through several goals.
    pub(super) fn has_several_goals(&self) -> bool {
        self.appends || !self.via.is_empty()
    }

    /// Whether the fastest motion is to be executed.
    pub(super) fn executes_fastest(&self) -> bool {
        let rule = SelectionRule::Best(Selection::ShortestTime);
        self.requested_mono_ns.is_some() && self.selection == rule
    }

    /// All goals before the problem's own, in their order.
    pub(crate) fn whole_via(&self) -> Vec<Via> {
        [self.ahead.as_slice(), &self.via].concat()
    }

    /// All goals, in their order.
    pub(crate) fn goals(&self) -> Vec<Via> {
        let last = Via {
            goal: self.problem.goal,
            tip_tolerance: self.tip_tolerance,
        };
        let mut goals = self.whole_via();
        goals.push(last);
        goals
    }
}

impl RequestValidator {
    /// Validates a request to plan; `plans` are the plans that it may go on from.
    ///
    /// # Errors
    /// [`Refusal`]: the outcome, the field that is wrong, and what is allowed.
    pub(crate) fn validate(
        &self,
        asked: &PlanRequest,
        plans: &RecentPlans,
    ) -> Result<PlanTask, Refusal> {
        let most = self.capacity.candidates;
        if asked.candidate_count > most {
            let reason = format!(
                "candidate_count is {}; this daemon serves 1..={most}",
                asked.candidate_count
            );
            return Err(Refusal::field(PlanField::CandidateCount, reason));
        }
        if asked.execute {
            self.check_executes()?;
        }
        let previous = asked.previous.map(|p| plans.previous(&p)).transpose()?;
        let requested_mono_ns = asked.requested_mono_ns.filter(|_| asked.execute);
        requested_mono_ns.map_or(Ok(()), |at| check_requested(at, mono_now_ns()))?;
        Ok(PlanTask {
            request_id: asked.request_id,
            problem: Arc::new(self.problem(asked)?),
            request: self.request(asked, previous),
            knots: self.knots(asked),
            ignores_live_scene: asked.ignores_live_scene,
            starts_at_robot: asked.start != StartKind::Given,
            via: asked.via.iter().map(|goal| self.via(goal)).collect(),
            ahead: Vec::new(),
            appends: asked.start == StartKind::AfterGoals,
            moves_end_of: None,
            deadline: asked.deadline.unwrap_or(self.default_deadline),
            tip_tolerance: match self.planner {
                PlannerKind::Pcc => tip_tolerance(&asked.goal, &self.robot),
                PlannerKind::Null => f64::INFINITY,
            },
            selection: asked.selection,
            requested_mono_ns,
            begin_mono_ns: asked.begin_mono_ns,
            early: asked.early_candidate_count,
        })
    }

    /// Refuses execution by the planner `null`, whose motions answer another request.
    pub(super) fn check_executes(&self) -> Result<(), Refusal> {
        match self.planner {
            PlannerKind::Pcc => Ok(()),
            PlannerKind::Null => Err(Refusal::field(
                PlanField::Execute,
                "this daemon's planner is \"null\": its motions are those of another request; only execute = nothing is allowed",
            )),
        }
    }

    fn problem(&self, asked: &PlanRequest) -> Result<Problem, Refusal> {
        let balls = asked.balls.iter().map(|ball| Ball {
            centre: self.robot.point_in_section_lengths(ball.centre_m),
            radius: self.robot.in_section_lengths(ball.radius_m),
        });
        let scene = self.static_scene.with_balls(balls.collect());
        Ok(Problem {
            start: Configuration::from(asked.start_configuration_rad),
            goal: self.goal(&asked.goal),
            scene: scene.map_err(|error| Refusal::field(PlanField::Balls, error.to_string()))?,
            moving: MovingObstacles::default(),
        })
    }

    fn goal(&self, goal: &valid::Goal) -> Goal {
        match goal {
            valid::Goal::Tip { position_m, .. } => {
                Goal::Tip(self.robot.point_in_section_lengths(*position_m))
            }
            valid::Goal::Configuration(shape) => Goal::Configuration((*shape).into()),
        }
    }

    fn via(&self, goal: &valid::Goal) -> Via {
        Via {
            goal: self.goal(goal),
            tip_tolerance: tip_tolerance(goal, &self.robot),
        }
    }

    /// Knots that a motion from rest may have, and one that begins in motion, which may have those of its braking more. One through several
    /// goals may have as many for each goal as one to a single goal. All as far as the answer holds so many candidates of them; one whose
    /// end is moved is alone in its answer.
    fn knots(&self, asked: &PlanRequest) -> MostKnots {
        let of_one = self.capacity.knots_per_candidate;
        let is_route = !asked.via.is_empty() || asked.start == StartKind::AfterGoals;
        let from_rest = if is_route { MAX_KNOTS } else { of_one };
        let in_motion = (from_rest + STOPPING_KNOTS).min(MAX_KNOTS);
        let all = self.capacity.knots_per_response();
        let share = all / asked.candidate_count;
        let [from_rest, in_motion] = [from_rest, in_motion].map(|most| share.clamp(of_one, most));
        MostKnots {
            from_rest,
            in_motion,
            end_moved: all.min(MAX_KNOTS),
        }
    }

    fn request(&self, asked: &PlanRequest, previous: Option<PreviousPlan>) -> Request {
        let is_in_motion = asked.starts_in_motion();
        Request {
            candidates: asked.candidate_count,
            seed: asked.seed,
            sampler: asked.sampler,
            limits_scale: asked.limits_scale,
            padding: self.padding,
            knots: self.knots(asked).of(is_in_motion),
            corrections: MOST_CORRECTIONS,
            start_motion: is_in_motion.then(|| StartMotion {
                velocity: asked.start_velocity_rad_s.into(),
                acceleration: asked.start_acceleration_rad_s2.into(),
            }),
            previous: previous.map(Arc::new),
            end_to_move: None,
        }
    }
}

/// Checks that something to be executed was not asked for in the future.
pub(super) fn check_requested(requested_mono_ns: i64, now_mono_ns: i64) -> Result<(), Refusal> {
    if requested_mono_ns > now_mono_ns {
        let reason = format!(
            "requested_mono_ns is {requested_mono_ns}, now is {now_mono_ns}: it is of another clock than this machine's \
             CLOCK_MONOTONIC; now or earlier is allowed"
        );
        return Err(Refusal::field(PlanField::Requested, reason));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::robot_of_sections;
    use collision::Solid;
    use nalgebra::Isometry3;
    use pcc_model::Point;
    use shared_types::codes::Outcome;
    use shared_types::message;

    fn validator() -> RequestValidator {
        RequestValidator {
            robot: robot_of_sections(0.25),
            capacity: PlanServiceCapacity::default(),
            default_deadline: Duration::from_millis(20),
            padding: [0.0225; SECTIONS],
            static_scene: Scene::default(),
            planner: PlannerKind::Pcc,
        }
    }

    fn asked() -> PlanRequest {
        let goal = valid::Goal::Tip {
            position_m: [0.25, 0.0, 0.5],
            tolerance_m: None,
        };
        PlanRequest {
            balls: vec![message::Ball {
                centre_m: [0.5, 0.0, 0.25],
                radius_m: 0.1,
            }],
            ..PlanRequest::new([0.1; 6], goal)
        }
    }

    fn validate(asked: &PlanRequest) -> Result<PlanTask, Refusal> {
        validator().validate(asked, &RecentPlans::default())
    }

    #[test]
    fn metres_become_section_lengths_and_defaults_are_filled_in() {
        let task = validate(&asked()).unwrap();
        assert_eq!(task.problem.goal, Goal::Tip(Point::new(1.0, 0.0, 2.0)));
        let ball = task.problem.scene.balls()[0];
        assert_eq!((ball.centre, ball.radius), (Point::new(2.0, 0.0, 1.0), 0.4));
        assert_eq!(task.problem.start, Configuration::repeat(0.1));
        assert_eq!(task.deadline, Duration::from_millis(20));
        assert_eq!(task.tip_tolerance, 0.01);
        assert_eq!((task.requested_mono_ns, task.begin_mono_ns), (None, None));
        assert_eq!(
            (task.request.padding, task.request.knots),
            ([0.0225; SECTIONS], 96)
        );
    }

    #[test]
    fn what_is_said_replaces_the_defaults() {
        let task = validate(&PlanRequest {
            goal: valid::Goal::Tip {
                position_m: [0.25, 0.0, 0.5],
                tolerance_m: Some(0.005),
            },
            deadline: Some(Duration::from_secs(1)),
            execute: true,
            requested_mono_ns: Some(5),
            begin_mono_ns: Some(77),
            limits_scale: 0.5,
            seed: 9,
            ..asked()
        });
        let task = task.unwrap();
        assert_eq!(task.tip_tolerance, 0.02);
        assert_eq!(task.deadline, Duration::from_secs(1));
        assert_eq!(
            (task.requested_mono_ns, task.begin_mono_ns),
            (Some(5), Some(77))
        );
        assert_eq!((task.request.limits_scale, task.request.seed), (0.5, 9));
    }

    #[test]
    fn a_motion_may_have_the_knots_that_an_answer_holds() {
        for (candidates, expected) in [(16, [96, 99, 256]), (1, [96, 96, 96])] {
            let mut validator = validator();
            validator.capacity.candidates = candidates;
            let asked = PlanRequest {
                candidate_count: 1,
                ..asked()
            };
            let knots = validator.knots(&asked);
            assert_eq!(
                [knots.from_rest, knots.in_motion, knots.end_moved],
                expected
            );
        }
    }

    #[test]
    fn a_motion_that_was_asked_for_in_the_future_is_of_another_clock() {
        let now_mono_ns = mono_now_ns();
        let asked_for = |requested_mono_ns| PlanRequest {
            execute: true,
            requested_mono_ns: Some(requested_mono_ns),
            ..asked()
        };
        let earlier = validate(&asked_for(now_mono_ns - 5_000_000_000)).unwrap();
        assert_eq!(earlier.requested_mono_ns, Some(now_mono_ns - 5_000_000_000));
        let refusal = validate(&asked_for(now_mono_ns + 60_000_000_000)).unwrap_err();
        assert_eq!(refusal.field, PlanField::Requested);
        assert!(refusal.reason.contains("another clock"), "{refusal:?}");
    }

    #[test]
    fn a_static_scene_is_part_of_every_request() {
        let wall = Solid::cuboid(
            &Point::new(0.1, 4.0, 4.0),
            &Isometry3::translation(2.5, 0.0, 1.0),
        );
        let fixed = Ball {
            centre: Point::new(-2.0, 0.0, 1.0),
            radius: 0.5,
        };
        let validator = RequestValidator {
            static_scene: Scene::with_solids(vec![fixed], vec![Arc::new(wall.unwrap())]).unwrap(),
            ..validator()
        };
        let scene = &validator
            .validate(&asked(), &RecentPlans::default())
            .unwrap()
            .problem
            .scene;
        assert_eq!((scene.balls().len(), scene.solids().len()), (2, 1));
        assert_eq!(scene.balls()[0].centre, Point::new(2.0, 0.0, 1.0));
        assert_eq!(scene.balls()[1], fixed);
    }

    #[test]
    fn a_refusal_names_the_field_and_what_is_allowed() {
        let many = PlanRequest {
            candidate_count: 17,
            ..asked()
        };
        let refusal = validate(&many).unwrap_err();
        assert_eq!(refusal.outcome, Outcome::InvalidRequest);
        assert_eq!(refusal.field, PlanField::CandidateCount);
        assert!(refusal.reason.contains("1..=16"), "{}", refusal.reason);
    }
}
