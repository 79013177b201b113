//! Codes of plan requests and answers.

use super::declaration::{UnknownCode, codes};

codes! {
    /// The source of the proposed paths.
    "sampler"
    pub enum Sampler {
        /// Learned few-step paths, straight segments that compete with them, and RRT-Connect for what is missing.
        Default = 0 "default",
        /// The fast learned model.
        Fast = 1 "fast",
        /// Straight segments in configuration space to the goal configurations.
        Straight = 2 "straight",
        /// Paths of RRT-Connect on certified edges.
        RrtConnect = 3 "rrt-connect",
        /// The paper's diffusion model.
        Diffusion = 4 "diffusion",
        /// The paper's diffusion model with post correction.
        DiffusionPost = 5 "diffusion-post",
        /// The paper's diffusion model with guided prediction.
        DiffusionGuided = 6 "diffusion-guided",
        /// Straight segments, corrected, smoothed and timed like learned paths.
        StraightDrawn = 7 "straight-drawn",
        /// Paths of RRT-Connect, corrected, smoothed and timed like learned paths.
        RrtSmooth = 8 "rrt-smooth",
    }
}

codes! {
    /// Which candidate is selected.
    "selection"
    pub enum Selection {
        /// The candidate of least duration.
        ShortestTime = 0 "shortest time",
        /// The candidate whose tip travels least.
        ShortestTipPath = 1 "shortest tip path",
        /// The candidate that stays farthest from obstacles.
        LargestClearance = 2 "largest clearance",
        /// The smoothest candidate.
        Smoothest = 3 "smoothest",
        /// The candidate whose goal configuration is nearest to the start's.
        NearestGoalConfiguration = 4 "nearest goal configuration",
        /// The candidate that the request names by its index.
        ByIndex = 5 "by index",
    }
}

codes! {
    /// What a plan request has executed.
    "execution"
    pub enum Execute {
        /// Nothing: it only plans.
        Nothing = 0 "nothing",
        /// The candidate that is selected of those that it has planned.
        Selected = 1 "the selected candidate",
        /// A candidate of a plan that was answered before; nothing is planned.
        Named = 2 "a candidate of an earlier plan",
    }
}

codes! {
    /// What kind of goal a request has.
    "goal kind"
    pub enum GoalKind {
        /// A position of the tip.
        Tip = 0 "tip",
        /// A configuration.
        Configuration = 1 "configuration",
    }
}

codes! {
    /// The origin of a candidate.
    "source"
    pub enum Source {
        /// The learned sampler.
        Learned = 1 "learned",
        /// A tree: RRT-Connect, or one seeded with the motions found.
        Classical = 2 "classical",
        /// A straight segment in configuration space.
        StraightLine = 3 "straight line",
        /// The rest of the previous plan's motion.
        Kept = 4 "kept",
        /// The learned sampler, from wider noise, where none of the draws asked for was certified.
        Explored = 5 "explored",
        /// The motion that is followed, its end moved to a target that moves.
        MovedEnd = 6 "moved end",
    }
}

codes! {
    /// The outcome of a plan request.
    "outcome"
    pub enum Outcome {
        /// All candidates wanted are there.
        Ok = 0 "ok",
        /// The deadline passed, or the motion was on its way and a request came for which it is left: fewer candidates than wanted, all of them
        /// certified.
        Truncated = 1 "truncated",
        /// The start bends more than the robot may.
        StartOutOfLimits = 2 "start out of limits",
        /// The body touches an obstacle at the start.
        StartInCollision = 3 "start in collision",
        /// No configuration found within limits puts the tip at the goal.
        GoalOutOfReach = 4 "goal out of reach",
        /// Every configuration found that reaches the goal touches an obstacle.
        GoalInCollision = 5 "goal in collision",
        /// No path was found and certified.
        NoPath = 6 "no path found",
        /// A field of the request is wrong.
        InvalidRequest = 7 "invalid request",
        /// The sampler wanted is not loaded.
        SamplerNotLoaded = 8 "sampler not loaded",
        /// More requests than the daemon takes.
        Overloaded = 9 "overloaded",
        /// The daemon ends before it planned this request.
        Cancelled = 10 "cancelled",
        /// The request speaks another version of the protocol.
        WrongVersion = 11 "wrong version",
        /// Planned, but not published for execution: the text says why.
        ExecutionRefused = 12 "execution refused",
        /// Some candidates, all of them certified; the whole answer follows.
        Early = 13 "early",
        /// The start moves faster than the robot may, or cannot brake without contact.
        StartCannotStop = 14 "start cannot stop",
        /// The motion is to begin where the robot is, and the controller is not there, stops, or is in fault.
        RobotNotReady = 15 "robot not ready",
        /// The request is for another robot than the daemon plans for: the text has both hashes.
        WrongRobot = 16 "wrong robot",
    }
}

impl Outcome {
    /// The outcome and a reason for it, which may begin with the outcome's own words: these are said once.
    #[must_use]
    pub fn explained(self, reason: &str) -> String {
        let outcome = self.text();
        match reason {
            "" => outcome.to_owned(),
            reason if reason.starts_with(outcome) => reason.to_owned(),
            reason => format!("{outcome}: {reason}"),
        }
    }

    /// Whether the answer carries candidates that may be used.
    #[must_use]
    pub const fn has_candidates(self) -> bool {
        matches!(
            self,
            Self::Ok | Self::Truncated | Self::ExecutionRefused | Self::Early
        )
    }
}

codes! {
    /// A stage of planning that the answer times: the index into `stages_ns`.
    ///
    /// Paths go through correction, time parameterization, certification and their figures one after the other, several paths at
    /// once: the time of all is divided among these stages by what each took on the workers.
    "stage"
    pub enum Stage {
        /// From reception until work began.
        Wait = 0 "wait",
        /// Goal configurations (for diffusion: whether there is one) and features.
        Condition = 1 "condition",
        /// Drawing from the learned sampler, or growing trees.
        Sample = 2 "sample",
        /// Collision correction and tip paths, the ends of paths by diffusion included.
        Correct = 3 "correct",
        /// Certification of paths and motions.
        Certify = 4 "certify",
        /// Time parameterization.
        Time = 5 "time",
        /// Figures of merit, filling by trees, selection.
        Select = 6 "select",
        /// Writing the answer in place.
        Write = 7 "write",
    }
}

// The codes of stages are their places in `Stage::ALL`, since they index arrays with a time for each.
const _: () = {
    let mut place = 0;
    while place < Stage::ALL.len() {
        assert!(Stage::ALL[place].code() as usize == place);
        place += 1;
    }
};

codes! {
    /// Where the motion of a plan request begins.
    "start"
    pub enum StartKind {
        /// In the state that the request states.
        Given = 0 "given",
        /// Where the robot is: where it holds, or on its motion, which the new one joins as soon as it is planned.
        Robot = 1 "robot",
        /// Where the robot is, and the goals are reached after those that are still ahead of its motion.
        AfterGoals = 2 "after the goals ahead",
    }
}

codes! {
    /// What a plan depends on beside its request, the daemon's configuration and its weights.
    "plan dependence"
    pub enum PlanDependence {
        /// Nothing: the same request has the same plan, bit for bit.
        Nothing = 0 "nothing else",
        /// It was answered without planning.
        NotPlanned = 1 "not planned",
        /// On obstacles of the live scene.
        LiveScene = 2 "the live scene",
        /// On the motion that it leaves, and when that could be left.
        Motion = 3 "the motion that it leaves",
        /// On the plan that it goes on from.
        EarlierPlan = 4 "an earlier plan",
        /// On how far planning had come when the time was over.
        Deadline = 5 "its deadline",
    }
}

codes! {
    /// A field of a plan request that can be wrong.
    "plan field"
    pub enum PlanField {
        /// No field is wrong.
        None = 0 "none",
        /// `protocol_version`.
        ProtocolVersion = 1 "protocol_version",
        /// `candidate_count`.
        CandidateCount = 2 "candidate_count",
        /// `deadline_ns`.
        Deadline = 3 "deadline_ns",
        /// `sampler`.
        Sampler = 4 "sampler",
        /// `selection`.
        Selection = 5 "selection",
        /// `selected_index`.
        SelectedIndex = 6 "selected_index",
        /// `execute`.
        Execute = 7 "execute",
        /// `goals.kind`.
        GoalKind = 8 "goals.kind",
        /// `ball_count`.
        BallCount = 9 "ball_count",
        /// `start_configuration_rad`.
        StartConfiguration = 10 "start_configuration_rad",
        /// `start_velocity_rad_s`.
        StartVelocity = 11 "start_velocity_rad_s",
        /// `start_acceleration_rad_s2`.
        StartAcceleration = 12 "start_acceleration_rad_s2",
        /// `goals.tip_m`.
        GoalTip = 13 "goals.tip_m",
        /// `goals.configuration_rad`.
        GoalConfiguration = 14 "goals.configuration_rad",
        /// `goals.tip_tolerance_m`.
        TipTolerance = 15 "goals.tip_tolerance_m",
        /// `limits_scale`.
        LimitsScale = 16 "limits_scale",
        /// `begin_mono_ns`.
        Begin = 17 "begin_mono_ns",
        /// `balls`.
        Balls = 18 "balls",
        /// `early_candidate_count`.
        EarlyCandidateCount = 19 "early_candidate_count",
        /// `previous_plan_id`.
        PreviousPlan = 20 "previous_plan_id",
        /// `previous_candidate`.
        PreviousCandidate = 21 "previous_candidate",
        /// `requested_mono_ns`.
        Requested = 22 "requested_mono_ns",
        /// `start`.
        Start = 23 "start",
        /// `ignores_live_scene`.
        IgnoresLiveScene = 24 "ignores_live_scene",
        /// `goal_count`.
        GoalCount = 25 "goal_count",
    }
}
