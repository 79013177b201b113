//! What each `u32` code on the wire means: one enum a field, one meaning a code.

/// A code that this version of the protocol does not know.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnknownCode {
    /// The field's meaning.
    pub what: &'static str,
    /// The code found.
    pub code: u32,
    /// The codes known, with their texts.
    pub known: &'static [(u32, &'static str)],
}

impl std::fmt::Display for UnknownCode {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{} is no {}; allowed are", self.code, self.what)?;
        let separators = std::iter::once(" ").chain(std::iter::repeat(", "));
        self.known
            .iter()
            .zip(separators)
            .try_for_each(|((code, text), separator)| {
                write!(formatter, "{separator}{code} ({text})")
            })
    }
}

impl std::error::Error for UnknownCode {}

/// Declares a code: the enum, its numbers on the wire, and its text for people.
macro_rules! codes {
    ($(#[$attribute:meta])* $what:literal pub enum $name:ident {
        $( $(#[$variant_attribute:meta])* $variant:ident = $code:literal $text:literal, )*
    }) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u32)]
        pub enum $name { $( $(#[$variant_attribute])* $variant = $code, )* }

        impl $name {
            /// All of them, by code.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// The number on the wire.
            #[must_use]
            pub const fn code(self) -> u32 {
                self as u32
            }

            /// The text for people.
            #[must_use]
            pub const fn text(self) -> &'static str {
                match self { $(Self::$variant => $text,)* }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                formatter.pad(self.text())
            }
        }

        impl From<$name> for u32 {
            fn from(value: $name) -> u32 {
                value.code()
            }
        }

        impl TryFrom<u32> for $name {
            type Error = UnknownCode;

            fn try_from(code: u32) -> Result<Self, UnknownCode> {
                match code {
                    $($code => Ok(Self::$variant),)*
                    _ => Err(UnknownCode { what: $what, code, known: &[$(($code, $text),)*] }),
                }
            }
        }
    };
}

codes! {
    /// Who is to propose paths.
    "sampler"
    pub enum Sampler {
        /// The daemon's own choice.
        Default = 0 "default",
        /// The fast learned model.
        Fast = 1 "fast",
        /// Straight segments in configuration space to the goal's end shapes.
        Straight = 2 "straight",
        /// The classical planner alone.
        RrtConnect = 3 "rrt-connect",
        /// The paper's diffusion model.
        Diffusion = 4 "diffusion",
        /// The paper's diffusion model with post correction.
        DiffusionPost = 5 "diffusion-post",
        /// The paper's diffusion model with guided prediction.
        DiffusionGuided = 6 "diffusion-guided",
    }
}

codes! {
    /// Which candidate is selected.
    "selection"
    pub enum Selection {
        /// The one of least duration.
        ShortestTime = 0 "shortest time",
        /// The one whose tip travels least.
        ShortestTipPath = 1 "shortest tip path",
        /// The one that stays farthest from the balls.
        LargestClearance = 2 "largest clearance",
        /// The smoothest one.
        Smoothest = 3 "smoothest",
        /// The one whose end shape is nearest to the start's.
        NearestTerminalShape = 4 "nearest terminal shape",
        /// The one that the request names.
        ByIndex = 5 "by index",
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
    /// Who proposed a candidate.
    "source"
    pub enum Source {
        /// The learned sampler.
        Learned = 1 "learned",
        /// The classical planner.
        Classical = 2 "classical",
        /// A straight segment in configuration space.
        StraightLine = 3 "straight line",
        /// The rest of the previous plan's motion.
        Kept = 4 "kept",
    }
}

codes! {
    /// What became of a plan request.
    "outcome"
    pub enum Outcome {
        /// All candidates wanted are there.
        Ok = 0 "ok",
        /// The deadline passed: fewer candidates than wanted, all of them certified.
        Truncated = 1 "truncated by the deadline",
        /// The start bends more than the robot may.
        StartOutOfLimits = 2 "start out of limits",
        /// The body touches a ball at the start.
        StartInCollision = 3 "start in collision",
        /// No configuration within limits puts the tip there.
        GoalOutOfReach = 4 "goal out of reach",
        /// Every configuration that reaches the goal touches a ball.
        GoalInCollision = 5 "goal in collision",
        /// No path was found and certified.
        NoPath = 6 "no path found",
        /// A field of the request is wrong.
        InvalidRequest = 7 "invalid request",
        /// The sampler wanted is not loaded.
        SamplerNotLoaded = 8 "sampler not loaded",
        /// More requests than the daemon takes.
        Overloaded = 9 "overloaded",
        /// The client gave up.
        Cancelled = 10 "cancelled",
        /// The request speaks another version of the protocol.
        WrongVersion = 11 "wrong version",
        /// Planned, but not published for execution: the text says why.
        ExecutionRefused = 12 "execution refused",
        /// Some candidates, all of them certified; the whole answer follows.
        Early = 13 "early",
        /// The start moves faster than the robot may, or cannot brake without contact.
        StartCannotStop = 14 "start cannot stop",
    }
}

impl Outcome {
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
    /// Paths go through correction, time allocation, certification and their figures one after the other, several paths at
    /// once: the time of all is divided among these stages by what each took on the workers.
    "stage"
    pub enum Stage {
        /// From reception until work began.
        Wait = 0 "wait",
        /// End shapes and features.
        Condition = 1 "condition",
        /// Drawing from the model.
        Sample = 2 "sample",
        /// Straightening and analytic correction.
        Correct = 3 "correct",
        /// Certification of paths and motions.
        Certify = 4 "certify",
        /// Time allocation.
        Time = 5 "time",
        /// Figures of merit, filling by trees, selection.
        Select = 6 "select",
        /// Writing the answer in place.
        Write = 7 "write",
    }
}

codes! {
    /// A field of a plan request that can be wrong.
    "plan field"
    pub enum PlanField {
        /// None.
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
        /// `goal_kind`.
        GoalKind = 8 "goal_kind",
        /// `ball_count`.
        BallCount = 9 "ball_count",
        /// `start_configuration_rad`.
        StartConfiguration = 10 "start_configuration_rad",
        /// `start_velocity_rad_s`.
        StartVelocity = 11 "start_velocity_rad_s",
        /// `start_acceleration_rad_s2`.
        StartAcceleration = 12 "start_acceleration_rad_s2",
        /// `goal_tip_m`.
        GoalTip = 13 "goal_tip_m",
        /// `goal_configuration_rad`.
        GoalConfiguration = 14 "goal_configuration_rad",
        /// `tip_tolerance_m`.
        TipTolerance = 15 "tip_tolerance_m",
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
    }
}

codes! {
    /// What the controller's loop does.
    "loop state"
    pub enum LoopState {
        /// Waits for the robot's state.
        Starting = 0 "starting",
        /// Holds a configuration.
        Holding = 1 "holding",
        /// Follows a trajectory.
        Executing = 2 "executing",
        /// Brakes along the trajectory.
        Stopping = 3 "stopping",
        /// Holds, and waits for a reset.
        Fault = 4 "fault",
    }
}

codes! {
    /// Why the controller is in fault.
    "loop fault"
    pub enum LoopFault {
        /// It is not.
        None = 0 "none",
        /// No newer state of the robot for too long.
        RobotLost = 1 "robot lost",
        /// Too many late cycles in a row.
        TooLate = 3 "too many late cycles",
        /// The robot does not follow.
        TrackingError = 4 "tracking error",
        /// The robot reports a fault.
        RobotFault = 5 "robot fault",
        /// The robot ramped to rest by itself: set-points did not reach it.
        RobotRampedToRest = 6 "robot ramped to rest",
        /// The robot's state is not finite or not plausible.
        InvalidRobotState = 7 "invalid robot state",
        /// A set-point would have been beyond the limits or not finite.
        InvalidSetpoint = 9 "invalid set-point",
        /// The controller's guard made no round for too long: no stop would have been heard.
        GuardHeldUp = 10 "guard held up",
    }
}

codes! {
    /// Why the controller's loop does not hold the robot: what it waits for while it is starting, or in fault and let go.
    "reason to wait"
    pub enum Waiting {
        /// It holds the robot.
        None = 0 "none",
        /// No state of the robot arrives.
        NoRobotState = 1 "no robot state",
        /// The robot's states hold numbers that cannot be, or codes that mean nothing.
        InvalidRobotState = 2 "invalid robot state",
        /// The robot's states repeat the stamp of the one before, or go back behind it.
        RepeatedRobotState = 3 "robot state repeated",
        /// The robot's states are older than the time after which a robot is lost.
        OldRobotState = 4 "robot state too old",
        /// The robot's states are stamped in the future: not by `CLOCK_MONOTONIC` of this machine.
        FutureRobotState = 5 "robot state from the future",
        /// The robot is in fault.
        RobotFault = 6 "robot in fault",
        /// The robot's reference is not at rest.
        RobotMoves = 7 "robot not at rest",
        /// The robot follows set-points that are not this controller's.
        RobotFollowsAnother = 8 "robot follows another controller",
        /// The robot's accepted set-point is no configuration's.
        OffTendonMap = 9 "accepted set-point fits no configuration",
        /// The robot does not follow the set-points sent to it yet.
        NotTakenUp = 10 "set-points not taken up",
    }
}

codes! {
    /// Why the controller refused a trajectory; the one before goes on.
    "refusal"
    pub enum Refusal {
        /// It did not.
        None = 0 "none",
        /// Another version of the protocol.
        WrongVersion = 1 "wrong version",
        /// Malformed: counts, times, values that are not finite.
        Malformed = 2 "malformed",
        /// It exceeds a limit of the robot.
        OutOfLimits = 3 "out of limits",
        /// It does not start at the commanded state.
        StartsElsewhere = 4 "starts elsewhere",
        /// It begins in the past.
        BeginsInThePast = 5 "begins in the past",
        /// It begins too far in the future.
        BeginsTooLate = 6 "begins too late",
        /// It does not end at rest.
        EndsInMotion = 7 "ends in motion",
        /// The controller is in fault.
        Faulted = 8 "in fault",
        /// The controller has no robot yet.
        NotReady = 9 "not ready",
        /// The controller executes, stops, or has another one waiting.
        Busy = 10 "busy",
        /// It has the id and the begin of the last one taken.
        OldId = 11 "old trajectory id",
        /// It names another controller than this one: one that was killed since, or has ended.
        OtherController = 12 "meant for another controller",
        /// Another daemon than the one whose heart beats has published it: nobody watches over it.
        OtherDaemon = 13 "published by another daemon",
        /// A stop was ordered after it was published.
        BeforeStop = 14 "published before a stop",
    }
}

codes! {
    /// Why a scene does not count; the one before of the same source stays until its lifetime ends.
    "scene refusal"
    pub enum SceneRefusal {
        /// It does.
        None = 0 "none",
        /// Another version of the protocol.
        WrongVersion = 1 "wrong version",
        /// Malformed: name, counts, lifetime, values that are not finite.
        Malformed = 2 "malformed",
        /// The stamp is near the time of day: stamps are of `CLOCK_MONOTONIC`.
        OtherClock = 3 "stamped by the wall clock, not by CLOCK_MONOTONIC",
        /// The stamp is later than now.
        InTheFuture = 4 "stamped in the future",
        /// The stamp and the lifetime are over.
        TooOld = 5 "too old: its lifetime is over",
        /// The same publisher has sent a newer one before.
        Superseded = 6 "older than the one before",
        /// There are as many sources as the daemon keeps.
        TooManySources = 7 "too many sources",
        /// Another publisher that is there, or that spoke while this one was there, has the source's name.
        NameTaken = 8 "another publisher has the source's name",
    }
}

codes! {
    /// What the motor end does.
    "motor state"
    pub enum MotorState {
        /// It was never commanded.
        Idle = 0 "idle",
        /// It follows set-points.
        Following = 1 "following",
        /// Set-points stay away: it ramps to rest.
        RampingToRest = 2 "ramping to rest",
        /// It is at rest after such a loss.
        AtRestAfterLoss = 3 "at rest after loss",
        /// It does not move.
        Fault = 4 "fault",
    }
}

codes! {
    /// What is wrong with the motor end.
    "motor fault"
    pub enum MotorFault {
        /// Nothing.
        None = 0 "none",
        /// A motor reports an error or does not move.
        Motor = 1 "motor",
        /// A measurement is missing or not plausible.
        Sensor = 2 "sensor",
        /// The bus to the motors does not answer.
        Bus = 3 "bus",
        /// A fault injected by a test.
        Injected = 4 "injected",
        /// A set-point was refused: the motors could not have followed it.
        Setpoint = 5 "set-point",
    }
}

codes! {
    /// Which process sends a heartbeat.
    "process kind"
    pub enum ProcessKind {
        /// The planner daemon.
        Daemon = 1 "daemon",
        /// The controller.
        Controller = 2 "controller",
        /// The robot.
        Robot = 3 "robot",
    }
}

codes! {
    /// What the controller is ordered to do.
    "command kind"
    pub enum CommandKind {
        /// Brake along the path, then hold.
        Stop = 1 "stop",
        /// Leave the fault state.
        ResetFault = 2 "reset fault",
        /// Run at another rate, reached by a ramp.
        SetSpeed = 3 "set speed",
    }
}

codes! {
    /// Why a command has no effect.
    "command refusal"
    pub enum CommandRefusal {
        /// It has.
        None = 0 "none",
        /// Another version of the protocol.
        WrongVersion = 1 "wrong version",
        /// No known kind.
        UnknownKind = 2 "unknown kind",
        /// The speed is not in 0..=1.
        InvalidSpeed = 3 "invalid speed",
        /// The fault's cause is still there.
        FaultPersists = 4 "fault persists",
        /// There is nothing to stop or to reset.
        NothingToDo = 5 "nothing to do",
        /// The loop did not take it in time; it was withdrawn, and is not carried out later.
        LoopBusy = 6 "loop busy",
        /// The loop did not take a stop in time; it stays in force, and is obeyed as soon as the loop goes on.
        StopPending = 7 "stop pending: the loop has not taken it yet, and will",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;
    use std::fmt::Debug;
    use std::hash::Hash;

    fn assert_one_meaning_a_code<T>(all: &[T])
    where
        T: Copy + Debug + Eq + Hash + Into<u32> + TryFrom<u32, Error = UnknownCode> + ToString,
    {
        let codes: HashSet<u32> = all.iter().map(|&value| value.into()).collect();
        let texts: HashSet<String> = all.iter().map(ToString::to_string).collect();
        assert_eq!(codes.len(), all.len(), "{all:?}");
        assert_eq!(texts.len(), all.len(), "{all:?}");
        let found: HashSet<T> = (0..1000)
            .filter_map(|code| T::try_from(code).ok())
            .collect();
        assert_eq!(
            found.len(),
            all.len(),
            "a code means nothing that is listed"
        );
        for &value in all {
            assert_eq!(T::try_from(value.into()), Ok(value));
        }
        let unknown = T::try_from(u32::MAX).unwrap_err();
        assert!(
            all.iter()
                .all(|value| unknown.to_string().contains(&value.to_string())),
            "{unknown}"
        );
    }

    #[test]
    fn every_code_has_exactly_one_meaning() {
        assert_one_meaning_a_code(Sampler::ALL);
        assert_one_meaning_a_code(Selection::ALL);
        assert_one_meaning_a_code(GoalKind::ALL);
        assert_one_meaning_a_code(Source::ALL);
        assert_one_meaning_a_code(Outcome::ALL);
        assert_one_meaning_a_code(Stage::ALL);
        assert_one_meaning_a_code(PlanField::ALL);
        assert_one_meaning_a_code(LoopState::ALL);
        assert_one_meaning_a_code(LoopFault::ALL);
        assert_one_meaning_a_code(Waiting::ALL);
        assert_one_meaning_a_code(Refusal::ALL);
        assert_one_meaning_a_code(SceneRefusal::ALL);
        assert_one_meaning_a_code(MotorState::ALL);
        assert_one_meaning_a_code(MotorFault::ALL);
        assert_one_meaning_a_code(ProcessKind::ALL);
        assert_one_meaning_a_code(CommandKind::ALL);
        assert_one_meaning_a_code(CommandRefusal::ALL);
    }

    #[test]
    fn the_stages_fill_their_array() {
        assert_eq!(Stage::ALL.len(), crate::capacity::STAGES);
    }

    #[test]
    fn an_unknown_code_says_what_is_allowed() {
        let error = GoalKind::try_from(7).unwrap_err();
        assert_eq!(
            error.to_string(),
            "7 is no goal kind; allowed are 0 (tip), 1 (configuration)"
        );
    }
}
