//! Codes of what moves the robot: loop, motors, scenes, commands, processes.

use super::declaration::{UnknownCode, codes};

codes! {
    /// State of the controller's loop.
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
        /// No fault.
        None = 0 "none",
        /// No newer state of the robot for too long.
        RobotLost = 1 "robot lost",
        /// Cycles came late one after the other for longer than the controller's `late_run_ms`.
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
        /// The controller's guard made no round for too long and would have missed an order to stop.
        GuardHeldUp = 10 "guard held up",
    }
}

codes! {
    /// Why the controller's loop does not hold the robot: what it waits for while it is starting, or in fault and let go.
    "reason to wait"
    pub enum Waiting {
        /// The loop holds the robot.
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
        /// The robot's body is farther from its reference than half of `hold_tolerance_rad`: its motors still come, or cannot.
        OffReference = 11 "robot away from its reference",
        /// The robot is another one than the controller's robot file says.
        OtherRobot = 12 "another robot",
    }
}

codes! {
    /// How a trajectory begins.
    "motion start"
    pub enum MotionStart {
        /// At rest, where the robot holds.
        AtRest = 0 "at rest",
        /// In motion, where it leaves the trajectory that is executed.
        InMotion = 1 "in motion",
    }
}

codes! {
    /// Why the controller refused a trajectory; the one before goes on.
    "refusal"
    pub enum Refusal {
        /// No refusal.
        None = 0 "none",
        /// Another version of the protocol.
        WrongVersion = 1 "wrong version",
        /// Malformed: counts, times, values that are not finite.
        Malformed = 2 "malformed",
        /// The trajectory exceeds a limit of the robot.
        OutOfLimits = 3 "out of limits",
        /// The trajectory does not start at the commanded state.
        StartsElsewhere = 4 "starts elsewhere",
        /// The trajectory begins in the past.
        BeginsInThePast = 5 "begins in the past",
        /// The trajectory begins too far in the future.
        BeginsTooLate = 6 "begins too late",
        /// The trajectory does not end at rest.
        EndsInMotion = 7 "ends in motion",
        /// The controller is in fault.
        Faulted = 8 "in fault",
        /// The controller has no robot yet.
        NotReady = 9 "not ready",
        /// The controller executes, stops, or has another trajectory waiting.
        Busy = 10 "busy",
        /// The trajectory has the id and the begin of the last one taken.
        OldId = 11 "old trajectory id",
        /// The trajectory names another controller than this one: one that was killed since, or has ended.
        OtherController = 12 "meant for another controller",
        /// The trajectory was published by another daemon than the one that sends heartbeats, so nothing supervises it.
        OtherDaemon = 13 "published by another daemon",
        /// A stop or a reset was ordered, or the controller was started, after the trajectory was requested.
        RequestedBefore = 14 "requested before a stop, a reset or the controller's start",
        /// The trajectory was taken, and a stop, a reset, a fault or the loss of robot or daemon came before its begin or its
        /// switch.
        SetAside = 15 "set aside before its begin",
        /// The trajectory leaves another one than the one that is executed.
        LeavesAnother = 16 "leaves another trajectory than the executing one",
        /// The place where the trajectory leaves the one that is executed was passed before it came.
        SwitchMissed = 17 "came after its switch",
        /// The place where the trajectory leaves the one that is executed is at a knot of that, or not on it.
        SwitchAtKnot = 18 "switch at a knot",
        /// The trajectory does not begin in the state in which the one that it leaves is there.
        Discontinuous = 19 "discontinuous at its switch",
        /// The trajectory is of another robot than this controller's.
        OtherRobot = 20 "of another robot",
    }
}

codes! {
    /// Why a scene does not count; the one before of the same source stays until its lifetime ends.
    "scene refusal"
    pub enum SceneRefusal {
        /// The scene counts.
        None = 0 "none",
        /// Another version of the protocol.
        WrongVersion = 1 "wrong version",
        /// Malformed: name, counts, lifetime, values that are not finite.
        Malformed = 2 "malformed",
        /// The stamp is near the time of day: stamps are of `CLOCK_MONOTONIC`.
        OtherClock = 3 "stamped by the wall clock, not by CLOCK_MONOTONIC",
        /// The stamp is later than now.
        InTheFuture = 4 "stamped in the future",
        /// The scene's lifetime, counted from its stamp, is over.
        TooOld = 5 "too old: its lifetime is over",
        /// The same publisher has sent a newer one before.
        Superseded = 6 "older than the one before",
        /// There are as many sources as the daemon keeps.
        TooManySources = 7 "too many sources",
        /// Another live publisher, or one that published while this one was live, has the source's name.
        NameTaken = 8 "another publisher has the source's name",
        /// There is no source of that name to be signed off.
        NoSuchSource = 9 "no source has that name",
        /// The publisher has sent scenes under another name before: its port is one source's, and counts no more until it is gone.
        SeveralNames = 10 "a publisher has one source name, and this one has sent scenes under another",
    }
}

codes! {
    /// State of the motor end.
    "motor state"
    pub enum MotorState {
        /// The motor end was never commanded.
        Idle = 0 "idle",
        /// The motor end follows set-points.
        Following = 1 "following",
        /// Set-points stay away: the motor end ramps to rest.
        RampingToRest = 2 "ramping to rest",
        /// The motor end is at rest after set-points stayed away.
        AtRestAfterLoss = 3 "at rest after loss",
        /// The motor end refuses set-points: it ramps to rest, or is at rest.
        Fault = 4 "fault",
    }
}

codes! {
    /// Fault of the motor end.
    "motor fault"
    pub enum MotorFault {
        /// No fault.
        None = 0 "none",
        /// A motor reports an error or does not move.
        Motor = 1 "motor",
        /// A measurement is missing or not plausible.
        Sensor = 2 "sensor",
        /// The bus to the motors does not answer.
        Bus = 3 "bus",
        /// A fault injected by a test.
        Injected = 4 "injected",
        /// The robot refused a set-point while following: not finite, badly stamped, or one that the motors could not have followed.
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
        /// Brake along the path and stay on it, the motion kept.
        Pause = 4 "pause",
        /// Go on after a pause, at the speed that was ordered last.
        Resume = 5 "resume",
    }
}

codes! {
    /// Why a command has no effect.
    "command refusal"
    pub enum CommandRefusal {
        /// The order was accepted.
        None = 0 "none",
        /// Another version of the protocol.
        WrongVersion = 1 "wrong version",
        /// The command's kind is unknown.
        UnknownKind = 2 "unknown kind",
        /// The speed is not in 0..=1.
        InvalidSpeed = 3 "invalid speed",
        /// The fault's cause is still there.
        FaultPersists = 4 "fault persists",
        /// There is nothing to stop or to reset.
        NothingToDo = 5 "nothing to do",
        /// The loop did not take the command in time; it was withdrawn, and is not carried out later.
        LoopBusy = 6 "loop busy",
        /// The loop did not take a stop in time; it stays in force, and is obeyed as soon as the loop goes on.
        StopPending = 7 "stop pending: the loop has not taken it yet, and will",
    }
}

codes! {
    /// Who gives the controller a command.
    "sender of a command"
    pub enum CommandSender {
        /// A person, or a program that acts for one.
        Program = 0 "a person or a program",
        /// The daemon's supervision of motions.
        Supervision = 1 "the daemon's supervision",
        /// The daemon, which keeps the robot on its way to a goal.
        GoalKeeper = 2 "the daemon's goal keeper",
    }
}

codes! {
    /// How a trajectory ended that the controller has received.
    "outcome of a motion"
    pub enum MotionOutcome {
        /// The robot was commanded along it to its end.
        Reached = 1 "reached",
        /// Another trajectory left it at its switch.
        Joined = 2 "joined by another trajectory",
        /// The robot was stopped before its end.
        Stopped = 3 "stopped",
        /// It was taken, and given up before its begin or its switch.
        SetAside = 4 "set aside before its begin",
        /// It was never taken, or no longer valid at its begin.
        Refused = 5 "refused",
    }
}

codes! {
    /// What stopped a motion, or set it aside.
    "cause of a stop"
    pub enum StopCause {
        /// Nothing did.
        None = 0 "none",
        /// A command to stop.
        Command = 1 "a command to stop",
        /// A command to reset.
        Reset = 2 "a reset",
        /// The daemon's heartbeats stayed away.
        DaemonLost = 3 "the daemon was lost",
        /// Another daemon took the place of the one that had published it.
        OtherDaemon = 4 "another daemon took over",
        /// A signal to the controller's process.
        Signal = 5 "a signal",
        /// The controller's process ends.
        Shutdown = 6 "the controller ends",
        /// The machine was suspended.
        Suspension = 7 "the machine was suspended",
        /// A fault of the loop.
        Fault = 8 "a fault",
        /// The robot took no set-points any more while it was at rest.
        RobotGone = 9 "the robot was let go of",
    }
}

codes! {
    /// What becomes of the goal that the daemon keeps the robot on its way to.
    "state of a goal"
    pub enum GoalState {
        /// No goal was given yet.
        None = 0 "no goal",
        /// A motion to it is being planned, and none is under way.
        Planning = 1 "planning",
        /// A certified motion is under way to it, or to where it was a moment ago.
        Underway = 2 "on the way",
        /// The robot rests there.
        Reached = 3 "reached",
        /// No certified motion to it was found; the robot comes to rest, and it is tried again.
        Unreachable = 4 "no way to it now",
        /// The robot cannot be moved now; it is tried again.
        RobotNotReady = 5 "robot not ready",
        /// It was given up: withdrawn, replaced, or ended by a stop or a fault. The robot goes on only to another one.
        Ended = 6 "ended",
        /// The message is not acceptable; the goal before it stays.
        Refused = 7 "refused",
    }
}
