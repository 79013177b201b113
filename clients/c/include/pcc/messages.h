/* The messages of the planner, its controller and the robot: see docs/wire.md.
   Written from shared-types by its test `description`; edit there. */
#ifndef PCC_MESSAGES_H
#define PCC_MESSAGES_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
#define PCC_ASSERT(condition) static_assert(condition, #condition)
#else
#define PCC_ASSERT(condition) _Static_assert(condition, #condition)
#endif

#define PCC_PROTOCOL_VERSION 7

/* Degrees of freedom: two bending components a section, three sections. */
#define PCC_DOF 6u
/* Bins of the loop's lateness histogram (`lateness`). */
#define PCC_HISTOGRAM_BINS 64u
/* Obstacle balls in one plan request. */
#define PCC_MAX_BALLS 64u
/* Candidates in one plan response. */
#define PCC_MAX_CANDIDATES 64u
/* Goals of one plan request, and goals ahead of a motion. */
#define PCC_MAX_GOALS 8u
/* Knots of one trajectory. */
#define PCC_MAX_KNOTS 256u
/* Obstacle balls in one source's live scene. */
#define PCC_MAX_SCENE_BALLS 1024u
/* No candidate is selected or named. */
#define PCC_NONE_SELECTED 4294967295u
/* Bytes of a `ReasonText`. */
#define PCC_REASON_BYTES 164u
/* Plans that the daemon retains, from which a request can go on. */
#define PCC_RECENT_PLANS 16u
/* Bytes of the name of a robot. */
#define PCC_ROBOT_NAME_BYTES 64u
/* Sections of the robot. */
#define PCC_SECTIONS 3u
/* Bytes of the name of a source of live scenes. */
#define PCC_SOURCE_NAME_BYTES 32u
/* Stages of planning that a response times (`Stage`). */
#define PCC_STAGES 8u
/* Tendons of the robot: three a section. */
#define PCC_TENDONS 9u

/* What the controller is ordered to do. */
typedef enum PccCommandKind {
  /* Brake along the path, then hold. */
  PCC_COMMAND_KIND_STOP = 1,
  /* Leave the fault state. */
  PCC_COMMAND_KIND_RESET_FAULT = 2,
  /* Run at another rate, reached by a ramp. */
  PCC_COMMAND_KIND_SET_SPEED = 3,
  /* Brake along the path and stay on it, the motion kept. */
  PCC_COMMAND_KIND_PAUSE = 4,
  /* Go on after a pause, at the speed that was ordered last. */
  PCC_COMMAND_KIND_RESUME = 5,
} PccCommandKind;

/* Why a command has no effect. */
typedef enum PccCommandRefusal {
  /* The order was accepted. */
  PCC_COMMAND_REFUSAL_NONE = 0,
  /* Another version of the protocol. */
  PCC_COMMAND_REFUSAL_WRONG_VERSION = 1,
  /* The command's kind is unknown. */
  PCC_COMMAND_REFUSAL_UNKNOWN_KIND = 2,
  /* The speed is not in 0..=1. */
  PCC_COMMAND_REFUSAL_INVALID_SPEED = 3,
  /* The fault's cause is still there. */
  PCC_COMMAND_REFUSAL_FAULT_PERSISTS = 4,
  /* There is nothing to stop or to reset. */
  PCC_COMMAND_REFUSAL_NOTHING_TO_DO = 5,
  /* The loop did not take the command in time; it was withdrawn, and is not carried out later. */
  PCC_COMMAND_REFUSAL_LOOP_BUSY = 6,
  /* The loop did not take a stop in time; it stays in force, and is obeyed as soon as the loop goes on. */
  PCC_COMMAND_REFUSAL_STOP_PENDING = 7,
} PccCommandRefusal;

/* Who gives the controller a command. */
typedef enum PccCommandSender {
  /* A person, or a program that acts for one. */
  PCC_COMMAND_SENDER_PROGRAM = 0,
  /* The daemon's supervision of motions. */
  PCC_COMMAND_SENDER_SUPERVISION = 1,
  /* The daemon, which keeps the robot on its way to a goal. */
  PCC_COMMAND_SENDER_GOAL_KEEPER = 2,
} PccCommandSender;

/* What a plan request has executed. */
typedef enum PccExecute {
  /* Nothing: it only plans. */
  PCC_EXECUTE_NOTHING = 0,
  /* The candidate that is selected of those that it has planned. */
  PCC_EXECUTE_SELECTED = 1,
  /* A candidate of a plan that was answered before; nothing is planned. */
  PCC_EXECUTE_NAMED = 2,
} PccExecute;

/* What kind of goal a request has. */
typedef enum PccGoalKind {
  /* A position of the tip. */
  PCC_GOAL_KIND_TIP = 0,
  /* A configuration. */
  PCC_GOAL_KIND_CONFIGURATION = 1,
} PccGoalKind;

/* What becomes of the goal that the daemon keeps the robot on its way to. */
typedef enum PccGoalState {
  /* No goal was given yet. */
  PCC_GOAL_STATE_NONE = 0,
  /* A motion to it is being planned, and none is under way. */
  PCC_GOAL_STATE_PLANNING = 1,
  /* A certified motion is under way to it, or to where it was a moment ago. */
  PCC_GOAL_STATE_UNDERWAY = 2,
  /* The robot rests there. */
  PCC_GOAL_STATE_REACHED = 3,
  /* No certified motion to it was found; the robot comes to rest, and it is tried again. */
  PCC_GOAL_STATE_UNREACHABLE = 4,
  /* The robot cannot be moved now; it is tried again. */
  PCC_GOAL_STATE_ROBOT_NOT_READY = 5,
  /* It was given up: withdrawn, replaced, or ended by a stop or a fault. The robot goes on only to another one. */
  PCC_GOAL_STATE_ENDED = 6,
  /* The message is not acceptable; the goal before it stays. */
  PCC_GOAL_STATE_REFUSED = 7,
} PccGoalState;

/* Why the controller is in fault. */
typedef enum PccLoopFault {
  /* No fault. */
  PCC_LOOP_FAULT_NONE = 0,
  /* No newer state of the robot for too long. */
  PCC_LOOP_FAULT_ROBOT_LOST = 1,
  /* Cycles came late one after the other for longer than the controller's `late_run_ms`. */
  PCC_LOOP_FAULT_TOO_LATE = 3,
  /* The robot does not follow. */
  PCC_LOOP_FAULT_TRACKING_ERROR = 4,
  /* The robot reports a fault. */
  PCC_LOOP_FAULT_ROBOT_FAULT = 5,
  /* The robot ramped to rest by itself: set-points did not reach it. */
  PCC_LOOP_FAULT_ROBOT_RAMPED_TO_REST = 6,
  /* The robot's state is not finite or not plausible. */
  PCC_LOOP_FAULT_INVALID_ROBOT_STATE = 7,
  /* A set-point would have been beyond the limits or not finite. */
  PCC_LOOP_FAULT_INVALID_SETPOINT = 9,
  /* The controller's guard made no round for too long and would have missed an order to stop. */
  PCC_LOOP_FAULT_GUARD_HELD_UP = 10,
} PccLoopFault;

/* State of the controller's loop. */
typedef enum PccLoopState {
  /* Waits for the robot's state. */
  PCC_LOOP_STATE_STARTING = 0,
  /* Holds a configuration. */
  PCC_LOOP_STATE_HOLDING = 1,
  /* Follows a trajectory. */
  PCC_LOOP_STATE_EXECUTING = 2,
  /* Brakes along the trajectory. */
  PCC_LOOP_STATE_STOPPING = 3,
  /* Holds, and waits for a reset. */
  PCC_LOOP_STATE_FAULT = 4,
} PccLoopState;

/* How a trajectory ended that the controller has received. */
typedef enum PccMotionOutcome {
  /* The robot was commanded along it to its end. */
  PCC_MOTION_OUTCOME_REACHED = 1,
  /* Another trajectory left it at its switch. */
  PCC_MOTION_OUTCOME_JOINED = 2,
  /* The robot was stopped before its end. */
  PCC_MOTION_OUTCOME_STOPPED = 3,
  /* It was taken, and given up before its begin or its switch. */
  PCC_MOTION_OUTCOME_SET_ASIDE = 4,
  /* It was never taken, or no longer valid at its begin. */
  PCC_MOTION_OUTCOME_REFUSED = 5,
} PccMotionOutcome;

/* How a trajectory begins. */
typedef enum PccMotionStart {
  /* At rest, where the robot holds. */
  PCC_MOTION_START_AT_REST = 0,
  /* In motion, where it leaves the trajectory that is executed. */
  PCC_MOTION_START_IN_MOTION = 1,
} PccMotionStart;

/* Fault of the motor end. */
typedef enum PccMotorFault {
  /* No fault. */
  PCC_MOTOR_FAULT_NONE = 0,
  /* A motor reports an error or does not move. */
  PCC_MOTOR_FAULT_MOTOR = 1,
  /* A measurement is missing or not plausible. */
  PCC_MOTOR_FAULT_SENSOR = 2,
  /* The bus to the motors does not answer. */
  PCC_MOTOR_FAULT_BUS = 3,
  /* A fault injected by a test. */
  PCC_MOTOR_FAULT_INJECTED = 4,
  /* The robot refused a set-point while following: not finite, badly stamped, or one that the motors could not have followed. */
  PCC_MOTOR_FAULT_SETPOINT = 5,
} PccMotorFault;

/* State of the motor end. */
typedef enum PccMotorState {
  /* The motor end was never commanded. */
  PCC_MOTOR_STATE_IDLE = 0,
  /* The motor end follows set-points. */
  PCC_MOTOR_STATE_FOLLOWING = 1,
  /* Set-points stay away: the motor end ramps to rest. */
  PCC_MOTOR_STATE_RAMPING_TO_REST = 2,
  /* The motor end is at rest after set-points stayed away. */
  PCC_MOTOR_STATE_AT_REST_AFTER_LOSS = 3,
  /* The motor end refuses set-points: it ramps to rest, or is at rest. */
  PCC_MOTOR_STATE_FAULT = 4,
} PccMotorState;

/* The outcome of a plan request. */
typedef enum PccOutcome {
  /* All candidates wanted are there. */
  PCC_OUTCOME_OK = 0,
  /* The deadline passed, or the motion was on its way and a request came for which it is left: fewer candidates than wanted, all of them certified. */
  PCC_OUTCOME_TRUNCATED = 1,
  /* The start bends more than the robot may. */
  PCC_OUTCOME_START_OUT_OF_LIMITS = 2,
  /* The body touches an obstacle at the start. */
  PCC_OUTCOME_START_IN_COLLISION = 3,
  /* No configuration found within limits puts the tip at the goal. */
  PCC_OUTCOME_GOAL_OUT_OF_REACH = 4,
  /* Every configuration found that reaches the goal touches an obstacle. */
  PCC_OUTCOME_GOAL_IN_COLLISION = 5,
  /* No path was found and certified. */
  PCC_OUTCOME_NO_PATH = 6,
  /* A field of the request is wrong. */
  PCC_OUTCOME_INVALID_REQUEST = 7,
  /* The sampler wanted is not loaded. */
  PCC_OUTCOME_SAMPLER_NOT_LOADED = 8,
  /* More requests than the daemon takes. */
  PCC_OUTCOME_OVERLOADED = 9,
  /* The daemon ends before it planned this request. */
  PCC_OUTCOME_CANCELLED = 10,
  /* The request speaks another version of the protocol. */
  PCC_OUTCOME_WRONG_VERSION = 11,
  /* Planned, but not published for execution: the text says why. */
  PCC_OUTCOME_EXECUTION_REFUSED = 12,
  /* Some candidates, all of them certified; the whole answer follows. */
  PCC_OUTCOME_EARLY = 13,
  /* The start moves faster than the robot may, or cannot brake without contact. */
  PCC_OUTCOME_START_CANNOT_STOP = 14,
  /* The motion is to begin where the robot is, and the controller is not there, stops, or is in fault. */
  PCC_OUTCOME_ROBOT_NOT_READY = 15,
  /* The request is for another robot than the daemon plans for: the text has both hashes. */
  PCC_OUTCOME_WRONG_ROBOT = 16,
} PccOutcome;

/* What a plan depends on beside its request, the daemon's configuration and its weights. */
typedef enum PccPlanDependence {
  /* Nothing: the same request has the same plan, bit for bit. */
  PCC_PLAN_DEPENDENCE_NOTHING = 0,
  /* It was answered without planning. */
  PCC_PLAN_DEPENDENCE_NOT_PLANNED = 1,
  /* On obstacles of the live scene. */
  PCC_PLAN_DEPENDENCE_LIVE_SCENE = 2,
  /* On the motion that it leaves, and when that could be left. */
  PCC_PLAN_DEPENDENCE_MOTION = 3,
  /* On the plan that it goes on from. */
  PCC_PLAN_DEPENDENCE_EARLIER_PLAN = 4,
  /* On how far planning had come when the time was over. */
  PCC_PLAN_DEPENDENCE_DEADLINE = 5,
} PccPlanDependence;

/* A field of a plan request that can be wrong. */
typedef enum PccPlanField {
  /* No field is wrong. */
  PCC_PLAN_FIELD_NONE = 0,
  /* `protocol_version`. */
  PCC_PLAN_FIELD_PROTOCOL_VERSION = 1,
  /* `candidate_count`. */
  PCC_PLAN_FIELD_CANDIDATE_COUNT = 2,
  /* `deadline_ns`. */
  PCC_PLAN_FIELD_DEADLINE = 3,
  /* `sampler`. */
  PCC_PLAN_FIELD_SAMPLER = 4,
  /* `selection`. */
  PCC_PLAN_FIELD_SELECTION = 5,
  /* `selected_index`. */
  PCC_PLAN_FIELD_SELECTED_INDEX = 6,
  /* `execute`. */
  PCC_PLAN_FIELD_EXECUTE = 7,
  /* `goals.kind`. */
  PCC_PLAN_FIELD_GOAL_KIND = 8,
  /* `ball_count`. */
  PCC_PLAN_FIELD_BALL_COUNT = 9,
  /* `start_configuration_rad`. */
  PCC_PLAN_FIELD_START_CONFIGURATION = 10,
  /* `start_velocity_rad_s`. */
  PCC_PLAN_FIELD_START_VELOCITY = 11,
  /* `start_acceleration_rad_s2`. */
  PCC_PLAN_FIELD_START_ACCELERATION = 12,
  /* `goals.tip_m`. */
  PCC_PLAN_FIELD_GOAL_TIP = 13,
  /* `goals.configuration_rad`. */
  PCC_PLAN_FIELD_GOAL_CONFIGURATION = 14,
  /* `goals.tip_tolerance_m`. */
  PCC_PLAN_FIELD_TIP_TOLERANCE = 15,
  /* `limits_scale`. */
  PCC_PLAN_FIELD_LIMITS_SCALE = 16,
  /* `begin_mono_ns`. */
  PCC_PLAN_FIELD_BEGIN = 17,
  /* `balls`. */
  PCC_PLAN_FIELD_BALLS = 18,
  /* `early_candidate_count`. */
  PCC_PLAN_FIELD_EARLY_CANDIDATE_COUNT = 19,
  /* `previous_plan_id`. */
  PCC_PLAN_FIELD_PREVIOUS_PLAN = 20,
  /* `previous_candidate`. */
  PCC_PLAN_FIELD_PREVIOUS_CANDIDATE = 21,
  /* `requested_mono_ns`. */
  PCC_PLAN_FIELD_REQUESTED = 22,
  /* `start`. */
  PCC_PLAN_FIELD_START = 23,
  /* `ignores_live_scene`. */
  PCC_PLAN_FIELD_IGNORES_LIVE_SCENE = 24,
  /* `goal_count`. */
  PCC_PLAN_FIELD_GOAL_COUNT = 25,
} PccPlanField;

/* Which process sends a heartbeat. */
typedef enum PccProcessKind {
  /* The planner daemon. */
  PCC_PROCESS_KIND_DAEMON = 1,
  /* The controller. */
  PCC_PROCESS_KIND_CONTROLLER = 2,
  /* The robot. */
  PCC_PROCESS_KIND_ROBOT = 3,
} PccProcessKind;

/* Why the controller refused a trajectory; the one before goes on. */
typedef enum PccRefusal {
  /* No refusal. */
  PCC_REFUSAL_NONE = 0,
  /* Another version of the protocol. */
  PCC_REFUSAL_WRONG_VERSION = 1,
  /* Malformed: counts, times, values that are not finite. */
  PCC_REFUSAL_MALFORMED = 2,
  /* The trajectory exceeds a limit of the robot. */
  PCC_REFUSAL_OUT_OF_LIMITS = 3,
  /* The trajectory does not start at the commanded state. */
  PCC_REFUSAL_STARTS_ELSEWHERE = 4,
  /* The trajectory begins in the past. */
  PCC_REFUSAL_BEGINS_IN_THE_PAST = 5,
  /* The trajectory begins too far in the future. */
  PCC_REFUSAL_BEGINS_TOO_LATE = 6,
  /* The trajectory does not end at rest. */
  PCC_REFUSAL_ENDS_IN_MOTION = 7,
  /* The controller is in fault. */
  PCC_REFUSAL_FAULTED = 8,
  /* The controller has no robot yet. */
  PCC_REFUSAL_NOT_READY = 9,
  /* The controller executes, stops, or has another trajectory waiting. */
  PCC_REFUSAL_BUSY = 10,
  /* The trajectory has the id and the begin of the last one taken. */
  PCC_REFUSAL_OLD_ID = 11,
  /* The trajectory names another controller than this one: one that was killed since, or has ended. */
  PCC_REFUSAL_OTHER_CONTROLLER = 12,
  /* The trajectory was published by another daemon than the one that sends heartbeats, so nothing supervises it. */
  PCC_REFUSAL_OTHER_DAEMON = 13,
  /* A stop or a reset was ordered, or the controller was started, after the trajectory was requested. */
  PCC_REFUSAL_REQUESTED_BEFORE = 14,
  /* The trajectory was taken, and a stop, a reset, a fault or the loss of robot or daemon came before its begin or its switch. */
  PCC_REFUSAL_SET_ASIDE = 15,
  /* The trajectory leaves another one than the one that is executed. */
  PCC_REFUSAL_LEAVES_ANOTHER = 16,
  /* The place where the trajectory leaves the one that is executed was passed before it came. */
  PCC_REFUSAL_SWITCH_MISSED = 17,
  /* The place where the trajectory leaves the one that is executed is at a knot of that, or not on it. */
  PCC_REFUSAL_SWITCH_AT_KNOT = 18,
  /* The trajectory does not begin in the state in which the one that it leaves is there. */
  PCC_REFUSAL_DISCONTINUOUS = 19,
  /* The trajectory is of another robot than this controller's. */
  PCC_REFUSAL_OTHER_ROBOT = 20,
} PccRefusal;

/* The source of the proposed paths. */
typedef enum PccSampler {
  /* Learned few-step paths, straight segments that compete with them, and RRT-Connect for what is missing. */
  PCC_SAMPLER_DEFAULT = 0,
  /* The fast learned model. */
  PCC_SAMPLER_FAST = 1,
  /* Straight segments in configuration space to the goal configurations. */
  PCC_SAMPLER_STRAIGHT = 2,
  /* Paths of RRT-Connect on certified edges. */
  PCC_SAMPLER_RRT_CONNECT = 3,
  /* The paper's diffusion model. */
  PCC_SAMPLER_DIFFUSION = 4,
  /* The paper's diffusion model with post correction. */
  PCC_SAMPLER_DIFFUSION_POST = 5,
  /* The paper's diffusion model with guided prediction. */
  PCC_SAMPLER_DIFFUSION_GUIDED = 6,
  /* Straight segments, corrected, smoothed and timed like learned paths. */
  PCC_SAMPLER_STRAIGHT_DRAWN = 7,
  /* Paths of RRT-Connect, corrected, smoothed and timed like learned paths. */
  PCC_SAMPLER_RRT_SMOOTH = 8,
} PccSampler;

/* Why a scene does not count; the one before of the same source stays until its lifetime ends. */
typedef enum PccSceneRefusal {
  /* The scene counts. */
  PCC_SCENE_REFUSAL_NONE = 0,
  /* Another version of the protocol. */
  PCC_SCENE_REFUSAL_WRONG_VERSION = 1,
  /* Malformed: name, counts, lifetime, values that are not finite. */
  PCC_SCENE_REFUSAL_MALFORMED = 2,
  /* The stamp is near the time of day: stamps are of `CLOCK_MONOTONIC`. */
  PCC_SCENE_REFUSAL_OTHER_CLOCK = 3,
  /* The stamp is later than now. */
  PCC_SCENE_REFUSAL_IN_THE_FUTURE = 4,
  /* The scene's lifetime, counted from its stamp, is over. */
  PCC_SCENE_REFUSAL_TOO_OLD = 5,
  /* The same publisher has sent a newer one before. */
  PCC_SCENE_REFUSAL_SUPERSEDED = 6,
  /* There are as many sources as the daemon keeps. */
  PCC_SCENE_REFUSAL_TOO_MANY_SOURCES = 7,
  /* Another live publisher, or one that published while this one was live, has the source's name. */
  PCC_SCENE_REFUSAL_NAME_TAKEN = 8,
  /* There is no source of that name to be signed off. */
  PCC_SCENE_REFUSAL_NO_SUCH_SOURCE = 9,
  /* The publisher has sent scenes under another name before: its port is one source's, and counts no more until it is gone. */
  PCC_SCENE_REFUSAL_SEVERAL_NAMES = 10,
} PccSceneRefusal;

/* Which candidate is selected. */
typedef enum PccSelection {
  /* The candidate of least duration. */
  PCC_SELECTION_SHORTEST_TIME = 0,
  /* The candidate whose tip travels least. */
  PCC_SELECTION_SHORTEST_TIP_PATH = 1,
  /* The candidate that stays farthest from obstacles. */
  PCC_SELECTION_LARGEST_CLEARANCE = 2,
  /* The smoothest candidate. */
  PCC_SELECTION_SMOOTHEST = 3,
  /* The candidate whose goal configuration is nearest to the start's. */
  PCC_SELECTION_NEAREST_GOAL_CONFIGURATION = 4,
  /* The candidate that the request names by its index. */
  PCC_SELECTION_BY_INDEX = 5,
} PccSelection;

/* The origin of a candidate. */
typedef enum PccSource {
  /* The learned sampler. */
  PCC_SOURCE_LEARNED = 1,
  /* A tree: RRT-Connect, or one seeded with the motions found. */
  PCC_SOURCE_CLASSICAL = 2,
  /* A straight segment in configuration space. */
  PCC_SOURCE_STRAIGHT_LINE = 3,
  /* The rest of the previous plan's motion. */
  PCC_SOURCE_KEPT = 4,
  /* The learned sampler, from wider noise, where none of the draws asked for was certified. */
  PCC_SOURCE_EXPLORED = 5,
  /* The motion that is followed, its end moved to a target that moves. */
  PCC_SOURCE_MOVED_END = 6,
} PccSource;

/* A stage of planning that the answer times: the index into `stages_ns`. Paths go through correction, time parameterization, certification and their figures one after the other, several paths at once: the time of all is divided among these stages by what each took on the workers. */
typedef enum PccStage {
  /* From reception until work began. */
  PCC_STAGE_WAIT = 0,
  /* Goal configurations (for diffusion: whether there is one) and features. */
  PCC_STAGE_CONDITION = 1,
  /* Drawing from the learned sampler, or growing trees. */
  PCC_STAGE_SAMPLE = 2,
  /* Collision correction and tip paths, the ends of paths by diffusion included. */
  PCC_STAGE_CORRECT = 3,
  /* Certification of paths and motions. */
  PCC_STAGE_CERTIFY = 4,
  /* Time parameterization. */
  PCC_STAGE_TIME = 5,
  /* Figures of merit, filling by trees, selection. */
  PCC_STAGE_SELECT = 6,
  /* Writing the answer in place. */
  PCC_STAGE_WRITE = 7,
} PccStage;

/* Where the motion of a plan request begins. */
typedef enum PccStartKind {
  /* In the state that the request states. */
  PCC_START_KIND_GIVEN = 0,
  /* Where the robot is: where it holds, or on its motion, which the new one joins as soon as it is planned. */
  PCC_START_KIND_ROBOT = 1,
  /* Where the robot is, and the goals are reached after those that are still ahead of its motion. */
  PCC_START_KIND_AFTER_GOALS = 2,
} PccStartKind;

/* What stopped a motion, or set it aside. */
typedef enum PccStopCause {
  /* Nothing did. */
  PCC_STOP_CAUSE_NONE = 0,
  /* A command to stop. */
  PCC_STOP_CAUSE_COMMAND = 1,
  /* A command to reset. */
  PCC_STOP_CAUSE_RESET = 2,
  /* The daemon's heartbeats stayed away. */
  PCC_STOP_CAUSE_DAEMON_LOST = 3,
  /* Another daemon took the place of the one that had published it. */
  PCC_STOP_CAUSE_OTHER_DAEMON = 4,
  /* A signal to the controller's process. */
  PCC_STOP_CAUSE_SIGNAL = 5,
  /* The controller's process ends. */
  PCC_STOP_CAUSE_SHUTDOWN = 6,
  /* The machine was suspended. */
  PCC_STOP_CAUSE_SUSPENSION = 7,
  /* A fault of the loop. */
  PCC_STOP_CAUSE_FAULT = 8,
  /* The robot took no set-points any more while it was at rest. */
  PCC_STOP_CAUSE_ROBOT_GONE = 9,
} PccStopCause;

/* Why the controller's loop does not hold the robot: what it waits for while it is starting, or in fault and let go. */
typedef enum PccWaiting {
  /* The loop holds the robot. */
  PCC_WAITING_NONE = 0,
  /* No state of the robot arrives. */
  PCC_WAITING_NO_ROBOT_STATE = 1,
  /* The robot's states hold numbers that cannot be, or codes that mean nothing. */
  PCC_WAITING_INVALID_ROBOT_STATE = 2,
  /* The robot's states repeat the stamp of the one before, or go back behind it. */
  PCC_WAITING_REPEATED_ROBOT_STATE = 3,
  /* The robot's states are older than the time after which a robot is lost. */
  PCC_WAITING_OLD_ROBOT_STATE = 4,
  /* The robot's states are stamped in the future: not by `CLOCK_MONOTONIC` of this machine. */
  PCC_WAITING_FUTURE_ROBOT_STATE = 5,
  /* The robot is in fault. */
  PCC_WAITING_ROBOT_FAULT = 6,
  /* The robot's reference is not at rest. */
  PCC_WAITING_ROBOT_MOVES = 7,
  /* The robot follows set-points that are not this controller's. */
  PCC_WAITING_ROBOT_FOLLOWS_ANOTHER = 8,
  /* The robot's accepted set-point is no configuration's. */
  PCC_WAITING_OFF_TENDON_MAP = 9,
  /* The robot does not follow the set-points sent to it yet. */
  PCC_WAITING_NOT_TAKEN_UP = 10,
  /* The robot's body is farther from its reference than half of `hold_tolerance_rad`: its motors still come, or cannot. */
  PCC_WAITING_OFF_REFERENCE = 11,
  /* The robot is another one than the controller's robot file says. */
  PCC_WAITING_OTHER_ROBOT = 12,
} PccWaiting;

/* A UTF-8 text that says for people why something is as a code beside it says; empty where there is no more to say. */
typedef struct PccReasonText {
  /* Bytes of `utf8` in use. */
  uint32_t length;
  /* The text. */
  uint8_t utf8[164];
} PccReasonText;
PCC_ASSERT(sizeof(PccReasonText) == 168);
PCC_ASSERT(offsetof(PccReasonText, length) == 0);
PCC_ASSERT(offsetof(PccReasonText, utf8) == 4);

/* One knot of a motion; neighbours are joined by quintic Hermite segments. */
typedef struct PccKnot {
  /* Time since the motion's begin, seconds. */
  double time_s;
  /* Configuration ζ, radians: (x, y) bending components of sections 1, 2, 3. */
  double configuration_rad[6];
  /* First derivative of the configuration by time, rad/s. */
  double velocity_rad_s[6];
  /* Second derivative of the configuration by time, rad/s². */
  double acceleration_rad_s2[6];
} PccKnot;
PCC_ASSERT(sizeof(PccKnot) == 152);
PCC_ASSERT(offsetof(PccKnot, time_s) == 0);
PCC_ASSERT(offsetof(PccKnot, configuration_rad) == 8);
PCC_ASSERT(offsetof(PccKnot, velocity_rad_s) == 56);
PCC_ASSERT(offsetof(PccKnot, acceleration_rad_s2) == 104);

/* An obstacle at rest. */
typedef struct PccBall {
  /* Centre in the base frame, metres. */
  double centre_m[3];
  /* Radius, metres, not negative. */
  double radius_m;
} PccBall;
PCC_ASSERT(sizeof(PccBall) == 32);
PCC_ASSERT(offsetof(PccBall, centre_m) == 0);
PCC_ASSERT(offsetof(PccBall, radius_m) == 24);

/* A goal of a plan request. */
typedef struct PccGoal {
  /* `GoalKind`, as wide as the numbers that follow. */
  uint64_t kind;
  /* The tip to reach in the base frame, metres, if the goal is a tip. */
  double tip_m[3];
  /* The configuration to reach, radians, if the goal is a configuration. */
  double configuration_rad[6];
  /* Distance from the goal tip that counts as reached, metres; 0: a hundredth of a section's length. */
  double tip_tolerance_m;
} PccGoal;
PCC_ASSERT(sizeof(PccGoal) == 88);
PCC_ASSERT(offsetof(PccGoal, kind) == 0);
PCC_ASSERT(offsetof(PccGoal, tip_m) == 8);
PCC_ASSERT(offsetof(PccGoal, configuration_rad) == 32);
PCC_ASSERT(offsetof(PccGoal, tip_tolerance_m) == 80);

/* A plan request (service `plan`). */
typedef struct PccPlanRequest {
  /* `PROTOCOL_VERSION` of the sender. */
  uint32_t protocol_version;
  /* Candidates wanted, 1..=64; the daemon's own limit may be lower. */
  uint32_t candidate_count;
  /* The sender's number for this request; returned in the answer. */
  uint64_t request_id;
  /* Seed of all random draws: same request, same seed, same previous plan, same answer. */
  uint64_t seed;
  /* Time the answer may take, nanoseconds from its reception; 0: the daemon's default. */
  uint64_t deadline_ns;
  /* `Sampler`. */
  uint32_t sampler;
  /* `Selection`. */
  uint32_t selection;
  /* The candidate to select, if the selection is by index. */
  uint32_t selected_index;
  /* `Execute`: what is published for execution. A candidate of an earlier plan is named by `previous_plan_id` and `previous_candidate`; nothing is planned then, goals, balls and early candidates are 0, and of the other fields only the version, the request's number, `robot_hash`, `requested_mono_ns` and `begin_mono_ns` are read. */
  uint32_t execute;
  /* Goals in use, 1..=8; 0 where an earlier plan is executed. */
  uint32_t goal_count;
  /* Balls in use, 0..=64; 0 where an earlier plan is executed. */
  uint32_t ball_count;
  /* As soon as so many candidates are certified they are answered (outcome early), before the whole answer; 0: no early answer. */
  uint32_t early_candidate_count;
  /* The candidate of the previous plan that is being followed, or is to be executed, if one is named below; `NONE_SELECTED`: the one that was selected. */
  uint32_t previous_candidate;
  /* The plan to go on from, or whose candidate is to be executed: `PlanReport::plan_id` of one of the last `RECENT_PLANS` whole answers with candidates, or of the goal's newest motion; 0: none. */
  uint64_t previous_plan_id;
  /* `StartKind`. */
  uint32_t start;
  /* 1: the live scene's obstacles are left out of planning (what is executed is certified against them all the same); 0: they belong to the request. */
  uint32_t ignores_live_scene;
  /* Configuration at the begin, radians; read only where the start is given, as are the next two. */
  double start_configuration_rad[6];
  /* Velocity at the begin, rad/s. */
  double start_velocity_rad_s[6];
  /* Acceleration at the begin, rad/s². */
  double start_acceleration_rad_s2[6];
  /* Share of the tendon limits to use, 1e-9 to 1. */
  double limits_scale;
  /* When the motion is to begin at rest, or to leave the one that the robot follows, at the earliest, nanoseconds of `CLOCK_MONOTONIC`; 0: as soon as possible. */
  int64_t begin_mono_ns;
  /* When the request's sender was asked for it, nanoseconds of `CLOCK_MONOTONIC`; only a request to execute needs one. The motion is not executed where a stop or a reset was ordered, or the controller was started, after it. */
  int64_t requested_mono_ns;
  /* `RobotDescription::robot_hash` of the robot file that the sender is set up for: a daemon that plans for another robot refuses the request (outcome wrong robot); 0: it does not say. */
  uint64_t robot_hash;
  /* The first `goal_count` are the goals, in their order: the motion passes them, and ends in the last one; the others are not read. */
  PccGoal goals[8];
  /* The first `ball_count` are obstacles; the others are not read. */
  PccBall balls[64];
} PccPlanRequest;
PCC_ASSERT(sizeof(PccPlanRequest) == 3008);
PCC_ASSERT(offsetof(PccPlanRequest, protocol_version) == 0);
PCC_ASSERT(offsetof(PccPlanRequest, candidate_count) == 4);
PCC_ASSERT(offsetof(PccPlanRequest, request_id) == 8);
PCC_ASSERT(offsetof(PccPlanRequest, seed) == 16);
PCC_ASSERT(offsetof(PccPlanRequest, deadline_ns) == 24);
PCC_ASSERT(offsetof(PccPlanRequest, sampler) == 32);
PCC_ASSERT(offsetof(PccPlanRequest, selection) == 36);
PCC_ASSERT(offsetof(PccPlanRequest, selected_index) == 40);
PCC_ASSERT(offsetof(PccPlanRequest, execute) == 44);
PCC_ASSERT(offsetof(PccPlanRequest, goal_count) == 48);
PCC_ASSERT(offsetof(PccPlanRequest, ball_count) == 52);
PCC_ASSERT(offsetof(PccPlanRequest, early_candidate_count) == 56);
PCC_ASSERT(offsetof(PccPlanRequest, previous_candidate) == 60);
PCC_ASSERT(offsetof(PccPlanRequest, previous_plan_id) == 64);
PCC_ASSERT(offsetof(PccPlanRequest, start) == 72);
PCC_ASSERT(offsetof(PccPlanRequest, ignores_live_scene) == 76);
PCC_ASSERT(offsetof(PccPlanRequest, start_configuration_rad) == 80);
PCC_ASSERT(offsetof(PccPlanRequest, start_velocity_rad_s) == 128);
PCC_ASSERT(offsetof(PccPlanRequest, start_acceleration_rad_s2) == 176);
PCC_ASSERT(offsetof(PccPlanRequest, limits_scale) == 224);
PCC_ASSERT(offsetof(PccPlanRequest, begin_mono_ns) == 232);
PCC_ASSERT(offsetof(PccPlanRequest, requested_mono_ns) == 240);
PCC_ASSERT(offsetof(PccPlanRequest, robot_hash) == 248);
PCC_ASSERT(offsetof(PccPlanRequest, goals) == 256);
PCC_ASSERT(offsetof(PccPlanRequest, balls) == 960);

/* One certified candidate of a plan. */
typedef struct PccCandidateSummary {
  /* Index in the answer's slice at which the candidate's knots begin. */
  uint32_t first_knot;
  /* Number of the candidate's knots. */
  uint32_t knot_count;
  /* `Source`. */
  uint32_t source;
  /* Index of the random draw that the candidate came from; the same for the same request and seed. */
  uint32_t draw;
  /* Duration of the motion, seconds. */
  double duration_s;
  /* Length of the tip's path, metres. */
  double tip_path_m;
  /* Least distance of the body's surface to an obstacle, metres; infinite without obstacles. */
  double clearance_m;
  /* Smoothness measure, less is smoother. */
  double smoothness;
  /* Distance of the final tip to the goal tip, metres. */
  double tip_error_m;
} PccCandidateSummary;
PCC_ASSERT(sizeof(PccCandidateSummary) == 56);
PCC_ASSERT(offsetof(PccCandidateSummary, first_knot) == 0);
PCC_ASSERT(offsetof(PccCandidateSummary, knot_count) == 4);
PCC_ASSERT(offsetof(PccCandidateSummary, source) == 8);
PCC_ASSERT(offsetof(PccCandidateSummary, draw) == 12);
PCC_ASSERT(offsetof(PccCandidateSummary, duration_s) == 16);
PCC_ASSERT(offsetof(PccCandidateSummary, tip_path_m) == 24);
PCC_ASSERT(offsetof(PccCandidateSummary, clearance_m) == 32);
PCC_ASSERT(offsetof(PccCandidateSummary, smoothness) == 40);
PCC_ASSERT(offsetof(PccCandidateSummary, tip_error_m) == 48);

/* The answer's user header: what happened, how long it took, and where each candidate's knots are. */
typedef struct PccPlanReport {
  /* `PROTOCOL_VERSION` of the daemon. */
  uint32_t protocol_version;
  /* `Outcome`. */
  uint32_t outcome;
  /* The request's number, as its sender gave it. */
  uint64_t request_id;
  /* The daemon's number of this plan. */
  uint64_t plan_id;
  /* `RobotDescription::robot_hash` of the robot that is planned for. */
  uint64_t robot_hash;
  /* `RobotDescription::weights_hash` of the daemon, whichever sampler was asked for. */
  uint64_t weights_hash;
  /* Hash of all candidates' knots: equal plans have equal hashes. */
  uint64_t plan_hash;
  /* Candidates in the answer, 0..=64. */
  uint32_t candidate_count;
  /* Index of the selected candidate, or `NONE_SELECTED`. */
  uint32_t selected;
  /* Id under which the selected candidate was published for execution; 0: it was not. */
  uint32_t trajectory_id;
  /* `PlanField` that was wrong, if the outcome is an invalid request. */
  uint32_t invalid_field;
  /* Draws of the learned sampler. */
  uint32_t learned_drawn;
  /* Draws of the learned sampler that became certified motions. */
  uint32_t learned_certified;
  /* Candidates that are not the learned sampler's. */
  uint32_t classical_certified;
  /* `MotionStart`: how the candidates begin. */
  uint32_t start;
  /* Time of each `Stage`, nanoseconds. */
  uint64_t stages_ns[8];
  /* Why the outcome is what it is. */
  PccReasonText reason;
  /* The first `candidate_count` are candidates; the others are not read. */
  PccCandidateSummary candidates[64];
} PccPlanReport;
PCC_ASSERT(sizeof(PccPlanReport) == 3896);
PCC_ASSERT(offsetof(PccPlanReport, protocol_version) == 0);
PCC_ASSERT(offsetof(PccPlanReport, outcome) == 4);
PCC_ASSERT(offsetof(PccPlanReport, request_id) == 8);
PCC_ASSERT(offsetof(PccPlanReport, plan_id) == 16);
PCC_ASSERT(offsetof(PccPlanReport, robot_hash) == 24);
PCC_ASSERT(offsetof(PccPlanReport, weights_hash) == 32);
PCC_ASSERT(offsetof(PccPlanReport, plan_hash) == 40);
PCC_ASSERT(offsetof(PccPlanReport, candidate_count) == 48);
PCC_ASSERT(offsetof(PccPlanReport, selected) == 52);
PCC_ASSERT(offsetof(PccPlanReport, trajectory_id) == 56);
PCC_ASSERT(offsetof(PccPlanReport, invalid_field) == 60);
PCC_ASSERT(offsetof(PccPlanReport, learned_drawn) == 64);
PCC_ASSERT(offsetof(PccPlanReport, learned_certified) == 68);
PCC_ASSERT(offsetof(PccPlanReport, classical_certified) == 72);
PCC_ASSERT(offsetof(PccPlanReport, start) == 76);
PCC_ASSERT(offsetof(PccPlanReport, stages_ns) == 80);
PCC_ASSERT(offsetof(PccPlanReport, reason) == 144);
PCC_ASSERT(offsetof(PccPlanReport, candidates) == 312);

/* A request, of a client or of the daemon itself for the goal that stays, and its whole answer but for the knots (service `plan_record`). */
typedef struct PccPlanRecord {
  /* Number of the record among those of this daemon, from 1, without gaps. */
  uint64_t sequence;
  /* When it was answered, nanoseconds of `CLOCK_MONOTONIC`. */
  int64_t stamp_mono_ns;
  /* `Heartbeat::instance` of the daemon. */
  uint64_t instance;
  /* `PlanDependence`: what the plan depends on beside the request, as wide as the numbers that follow. */
  uint64_t depends_on;
  /* Where the plan begins, radians: the request's start, or where the robot was. */
  double start_configuration_rad[6];
  /* The request, as its sender's memory has it when it is answered. */
  PccPlanRequest request;
  /* What it was answered. */
  PccPlanReport report;
} PccPlanRecord;
PCC_ASSERT(sizeof(PccPlanRecord) == 6984);
PCC_ASSERT(offsetof(PccPlanRecord, sequence) == 0);
PCC_ASSERT(offsetof(PccPlanRecord, stamp_mono_ns) == 8);
PCC_ASSERT(offsetof(PccPlanRecord, instance) == 16);
PCC_ASSERT(offsetof(PccPlanRecord, depends_on) == 24);
PCC_ASSERT(offsetof(PccPlanRecord, start_configuration_rad) == 32);
PCC_ASSERT(offsetof(PccPlanRecord, request) == 80);
PCC_ASSERT(offsetof(PccPlanRecord, report) == 3088);

/* What the controller is to execute (service `trajectory`, history 1). */
typedef struct PccTrajectoryMessage {
  /* `PROTOCOL_VERSION` of the sender. */
  uint32_t protocol_version;
  /* Names this trajectory in the controller's state; at least 1, and none that was used in the 497 days before. */
  uint32_t trajectory_id;
  /* The plan that the motion was selected from. */
  uint64_t plan_id;
  /* `ControllerState::instance` of the controller that is to execute it; every other one refuses it. */
  uint64_t controller_instance;
  /* `Heartbeat::instance` of the daemon that publishes and supervises it. A controller that receives another daemon's heartbeats refuses it: nothing would stop it for an obstacle. */
  uint64_t daemon_instance;
  /* `RobotDescription::robot_hash` of the robot that it is planned for; a controller of another one refuses it. */
  uint64_t robot_hash;
  /* When the sender of the request was asked for it, nanoseconds of `CLOCK_MONOTONIC`. What was requested before the last stop, the last reset or the controller's start is refused. */
  int64_t requested_mono_ns;
  /* When the motion begins, nanoseconds of `CLOCK_MONOTONIC`; where it leaves another one, when that is expected. */
  int64_t begin_mono_ns;
  /* `MotionStart`. */
  uint32_t start;
  /* The trajectory that it leaves, where it begins in motion; else 0. It is refused unless that one is executed. */
  uint32_t leaves_trajectory_id;
  /* Path time of that trajectory at which it is left, seconds; there this one's path time is 0, and both have the same position, velocity and acceleration by path time, to 1e-9. */
  double leaves_at_s;
  /* Knots in use, 2..=256. */
  uint32_t knot_count;
  /* The draw that the motion is of, as in the candidate's summary in the answer. */
  uint32_t draw;
  /* Tracking error that the certificate covers, radians (Euclidean norm of the configuration error). */
  double path_tolerance_rad;
  /* The first `knot_count` are the motion; the others are not read. */
  PccKnot knots[256];
} PccTrajectoryMessage;
PCC_ASSERT(sizeof(PccTrajectoryMessage) == 39000);
PCC_ASSERT(offsetof(PccTrajectoryMessage, protocol_version) == 0);
PCC_ASSERT(offsetof(PccTrajectoryMessage, trajectory_id) == 4);
PCC_ASSERT(offsetof(PccTrajectoryMessage, plan_id) == 8);
PCC_ASSERT(offsetof(PccTrajectoryMessage, controller_instance) == 16);
PCC_ASSERT(offsetof(PccTrajectoryMessage, daemon_instance) == 24);
PCC_ASSERT(offsetof(PccTrajectoryMessage, robot_hash) == 32);
PCC_ASSERT(offsetof(PccTrajectoryMessage, requested_mono_ns) == 40);
PCC_ASSERT(offsetof(PccTrajectoryMessage, begin_mono_ns) == 48);
PCC_ASSERT(offsetof(PccTrajectoryMessage, start) == 56);
PCC_ASSERT(offsetof(PccTrajectoryMessage, leaves_trajectory_id) == 60);
PCC_ASSERT(offsetof(PccTrajectoryMessage, leaves_at_s) == 64);
PCC_ASSERT(offsetof(PccTrajectoryMessage, knot_count) == 72);
PCC_ASSERT(offsetof(PccTrajectoryMessage, draw) == 76);
PCC_ASSERT(offsetof(PccTrajectoryMessage, path_tolerance_rad) == 80);
PCC_ASSERT(offsetof(PccTrajectoryMessage, knots) == 88);

/* Tendon set-point (service `setpoint`, one publisher: the controller's loop, every cycle). */
typedef struct PccSetpoint {
  /* Counts the publisher's set-points, from 1. */
  uint64_t sequence;
  /* Time at which the trajectory was evaluated, nanoseconds of `CLOCK_MONOTONIC`. */
  int64_t stamp_mono_ns;
  /* The executing trajectory; 0: none. */
  uint32_t trajectory_id;
  /* `LoopState` of the controller. */
  uint32_t state;
  /* Tendon length changes against the straight robot, metres. */
  double position_m[9];
  /* Velocities of the tendons, m/s. */
  double velocity_m_s[9];
  /* Accelerations of the tendons, m/s². */
  double acceleration_m_s2[9];
} PccSetpoint;
PCC_ASSERT(sizeof(PccSetpoint) == 240);
PCC_ASSERT(offsetof(PccSetpoint, sequence) == 0);
PCC_ASSERT(offsetof(PccSetpoint, stamp_mono_ns) == 8);
PCC_ASSERT(offsetof(PccSetpoint, trajectory_id) == 16);
PCC_ASSERT(offsetof(PccSetpoint, state) == 20);
PCC_ASSERT(offsetof(PccSetpoint, position_m) == 24);
PCC_ASSERT(offsetof(PccSetpoint, velocity_m_s) == 96);
PCC_ASSERT(offsetof(PccSetpoint, acceleration_m_s2) == 168);

/* The robot that the daemon plans for (service `robot_description`, each second; who comes late gets the last one). */
typedef struct PccRobotDescription {
  /* When it was sent, nanoseconds of `CLOCK_MONOTONIC`. */
  int64_t stamp_mono_ns;
  /* `Heartbeat::instance` of the sender. */
  uint64_t instance;
  /* `PROTOCOL_VERSION` of the sender. */
  uint32_t protocol_version;
  /* Tendons in use. */
  uint32_t tendon_count;
  /* Equal for equal robot files, and never 0: processes with different ones refuse each other. */
  uint64_t robot_hash;
  /* The first 8 bytes of the SHA-256 of the few-step model's weights file, the first one the highest; 0: the daemon has none. */
  uint64_t weights_hash;
  /* The robot's name, UTF-8, the rest zero; cut off where it is longer. */
  uint8_t name[64];
  /* Arc length of each section, metres. */
  double section_lengths_m[3];
  /* Radius of each section's body around its backbone, metres. */
  double tube_radii_m[3];
  /* Largest bending angle of a section, radians. */
  double bending_limit_rad;
  /* Radius of the motors' spools, metres. */
  double spool_radius_m;
  /* Row by row, a row a tendon: tendon length changes are this matrix times the configuration, m/rad. */
  double tendon_matrix_m_rad[54];
  /* Largest tendon velocity, m/s. */
  double velocity_limit_m_s;
  /* Largest tendon acceleration, m/s². */
  double acceleration_limit_m_s2;
  /* Largest tendon jerk, m/s³. */
  double jerk_limit_m_s3;
} PccRobotDescription;
PCC_ASSERT(sizeof(PccRobotDescription) == 624);
PCC_ASSERT(offsetof(PccRobotDescription, stamp_mono_ns) == 0);
PCC_ASSERT(offsetof(PccRobotDescription, instance) == 8);
PCC_ASSERT(offsetof(PccRobotDescription, protocol_version) == 16);
PCC_ASSERT(offsetof(PccRobotDescription, tendon_count) == 20);
PCC_ASSERT(offsetof(PccRobotDescription, robot_hash) == 24);
PCC_ASSERT(offsetof(PccRobotDescription, weights_hash) == 32);
PCC_ASSERT(offsetof(PccRobotDescription, name) == 40);
PCC_ASSERT(offsetof(PccRobotDescription, section_lengths_m) == 104);
PCC_ASSERT(offsetof(PccRobotDescription, tube_radii_m) == 128);
PCC_ASSERT(offsetof(PccRobotDescription, bending_limit_rad) == 152);
PCC_ASSERT(offsetof(PccRobotDescription, spool_radius_m) == 160);
PCC_ASSERT(offsetof(PccRobotDescription, tendon_matrix_m_rad) == 168);
PCC_ASSERT(offsetof(PccRobotDescription, velocity_limit_m_s) == 600);
PCC_ASSERT(offsetof(PccRobotDescription, acceleration_limit_m_s2) == 608);
PCC_ASSERT(offsetof(PccRobotDescription, jerk_limit_m_s3) == 616);

/* State of the motor end (service `robot_state`, one publisher: the robot, 1 kHz). */
typedef struct PccRobotState {
  /* Counts the publisher's states, from 1. */
  uint64_t sequence;
  /* Time of the measurement, nanoseconds of `CLOCK_MONOTONIC`. */
  int64_t stamp_mono_ns;
  /* `RobotDescription::robot_hash` of the robot that this is; the controller of another one does not take hold of it. */
  uint64_t robot_hash;
  /* Sequence of the last accepted set-point; 0: none yet. */
  uint64_t accepted_sequence;
  /* `MotorState`. */
  uint32_t state;
  /* `MotorFault`: with another one than none and injected the robot is in fault, whatever its state. */
  uint32_t fault;
  /* The robot's own reference, metres: the last accepted set-point, or where its ramp to rest has led since. */
  double accepted_setpoint_m[9];
  /* Velocity of the robot's own reference, m/s. */
  double accepted_velocity_m_s[9];
  /* Measured tendon length changes, metres. */
  double measured_tendon_m[9];
  /* Configuration that the measured tendons mean, radians. */
  double measured_configuration_rad[6];
  /* Times that the robot ramped to rest by itself: set-points stayed away or broke a rule, its driver was shut down, or its motors moved when it began. */
  uint32_t ramps_to_rest;
  /* Set-points that the robot refused. */
  uint32_t rejected_setpoints;
} PccRobotState;
PCC_ASSERT(sizeof(PccRobotState) == 312);
PCC_ASSERT(offsetof(PccRobotState, sequence) == 0);
PCC_ASSERT(offsetof(PccRobotState, stamp_mono_ns) == 8);
PCC_ASSERT(offsetof(PccRobotState, robot_hash) == 16);
PCC_ASSERT(offsetof(PccRobotState, accepted_sequence) == 24);
PCC_ASSERT(offsetof(PccRobotState, state) == 32);
PCC_ASSERT(offsetof(PccRobotState, fault) == 36);
PCC_ASSERT(offsetof(PccRobotState, accepted_setpoint_m) == 40);
PCC_ASSERT(offsetof(PccRobotState, accepted_velocity_m_s) == 112);
PCC_ASSERT(offsetof(PccRobotState, measured_tendon_m) == 184);
PCC_ASSERT(offsetof(PccRobotState, measured_configuration_rad) == 256);
PCC_ASSERT(offsetof(PccRobotState, ramps_to_rest) == 304);
PCC_ASSERT(offsetof(PccRobotState, rejected_setpoints) == 308);

/* State of the controller (service `controller_state`, one publisher: its relay thread, about 50 Hz). */
typedef struct PccControllerState {
  /* Time of the cycle that the message describes, nanoseconds of `CLOCK_MONOTONIC`. */
  int64_t stamp_mono_ns;
  /* Identifies the process among all that had this role since the machine was booted: its start time, nanoseconds of `CLOCK_MONOTONIC`. Trajectories name their controller by it. */
  uint64_t instance;
  /* `RobotDescription::robot_hash` of the controller's robot; a daemon of another one publishes nothing for it. */
  uint64_t robot_hash;
  /* Cycles since the loop began. */
  uint64_t cycle;
  /* The loop's period, nanoseconds. */
  uint64_t period_ns;
  /* `LoopState`. */
  uint32_t state;
  /* `LoopFault`, latched until reset. */
  uint32_t fault;
  /* The trajectory executing, or the last one executed; 0: none yet. */
  uint32_t trajectory_id;
  /* The last trajectory refused; 0: none yet. */
  uint32_t refused_trajectory_id;
  /* `Refusal`: why `refused_trajectory_id` was refused. */
  uint32_t refusal;
  /* The trajectory that will be joined at its switch; 0: none. */
  uint32_t pending_trajectory_id;
  /* 1: a pause holds the robot on its path; 0: none does. */
  uint32_t paused;
  /* Cycles that began more than one and a half periods after the one before. */
  uint32_t late_cycles;
  /* Most late cycles that came one after the other. */
  uint32_t longest_late_run;
  /* Linux thread id of the loop, so that its system calls can be counted from outside. */
  uint32_t loop_thread_id;
  /* Commanded configuration, radians. */
  double commanded_configuration_rad[6];
  /* Velocity of the commanded configuration, rad/s. */
  double commanded_velocity_rad_s[6];
  /* Commanded tendon length changes, metres. */
  double commanded_tendon_m[9];
  /* Configuration that the measured tendons mean, radians. */
  double measured_configuration_rad[6];
  /* Norm of the low-passed difference between commanded and measured configuration, radians. */
  double tracking_error_rad;
  /* Part of the measured tendon lengths that no configuration explains, metres (norm). */
  double slack_residual_m;
  /* How far the set-point was from the last trajectory's start when the loop took it, metres (norm over the tendons); kept as a constant offset, so that nothing jumps. */
  double splice_error_m;
  /* Time on the executing trajectory, seconds. */
  double trajectory_time_s;
  /* Rate at which the time on the trajectory runs, 0..=1. */
  double rate;
  /* Share of their own rate at which trajectories are followed, 0..=1, as last ordered; 1 when the process starts. */
  double speed;
  /* What was requested before this does not begin: the newest of the process's start (not later than `instance`), the newest stop and the newest reset, nanoseconds of `CLOCK_MONOTONIC`. It may be later than `stamp_mono_ns`. */
  int64_t wanted_from_mono_ns;
  /* A goal that was given before this is over (service `goal`): as `wanted_from_mono_ns`, but without the stops that the daemon itself has ordered, nanoseconds of `CLOCK_MONOTONIC`; not later than `wanted_from_mono_ns`. */
  int64_t goals_from_mono_ns;
  /* `Heartbeat::instance` of the daemon whose trajectories are taken; 0: none was heard yet, any is. */
  uint64_t daemon_instance;
  /* Set-points sent. */
  uint64_t setpoints_sent;
  /* Allocations of the loop thread that its own arena served. */
  uint64_t loop_arena_allocations;
  /* Allocations of the loop thread that reached the system allocator. */
  uint64_t loop_system_allocations;
  /* `Waiting`: why the loop does not hold the robot. */
  uint32_t waiting;
  /* Robot states that were not taken: invalid, repeated, too old or from the future. */
  uint32_t refused_robot_states;
  /* Part of the robot's accepted set-point that no configuration explains, metres (norm); over 1e-6 the robot is not taken hold of. */
  double accepted_residual_m;
  /* Wake-ups by lateness (`lateness`). */
  uint32_t lateness_histogram[64];
  /* What happened where a fault is latched, and what the loop waits for where it does not hold the robot. */
  PccReasonText reason;
} PccControllerState;
PCC_ASSERT(sizeof(PccControllerState) == 832);
PCC_ASSERT(offsetof(PccControllerState, stamp_mono_ns) == 0);
PCC_ASSERT(offsetof(PccControllerState, instance) == 8);
PCC_ASSERT(offsetof(PccControllerState, robot_hash) == 16);
PCC_ASSERT(offsetof(PccControllerState, cycle) == 24);
PCC_ASSERT(offsetof(PccControllerState, period_ns) == 32);
PCC_ASSERT(offsetof(PccControllerState, state) == 40);
PCC_ASSERT(offsetof(PccControllerState, fault) == 44);
PCC_ASSERT(offsetof(PccControllerState, trajectory_id) == 48);
PCC_ASSERT(offsetof(PccControllerState, refused_trajectory_id) == 52);
PCC_ASSERT(offsetof(PccControllerState, refusal) == 56);
PCC_ASSERT(offsetof(PccControllerState, pending_trajectory_id) == 60);
PCC_ASSERT(offsetof(PccControllerState, paused) == 64);
PCC_ASSERT(offsetof(PccControllerState, late_cycles) == 68);
PCC_ASSERT(offsetof(PccControllerState, longest_late_run) == 72);
PCC_ASSERT(offsetof(PccControllerState, loop_thread_id) == 76);
PCC_ASSERT(offsetof(PccControllerState, commanded_configuration_rad) == 80);
PCC_ASSERT(offsetof(PccControllerState, commanded_velocity_rad_s) == 128);
PCC_ASSERT(offsetof(PccControllerState, commanded_tendon_m) == 176);
PCC_ASSERT(offsetof(PccControllerState, measured_configuration_rad) == 248);
PCC_ASSERT(offsetof(PccControllerState, tracking_error_rad) == 296);
PCC_ASSERT(offsetof(PccControllerState, slack_residual_m) == 304);
PCC_ASSERT(offsetof(PccControllerState, splice_error_m) == 312);
PCC_ASSERT(offsetof(PccControllerState, trajectory_time_s) == 320);
PCC_ASSERT(offsetof(PccControllerState, rate) == 328);
PCC_ASSERT(offsetof(PccControllerState, speed) == 336);
PCC_ASSERT(offsetof(PccControllerState, wanted_from_mono_ns) == 344);
PCC_ASSERT(offsetof(PccControllerState, goals_from_mono_ns) == 352);
PCC_ASSERT(offsetof(PccControllerState, daemon_instance) == 360);
PCC_ASSERT(offsetof(PccControllerState, setpoints_sent) == 368);
PCC_ASSERT(offsetof(PccControllerState, loop_arena_allocations) == 376);
PCC_ASSERT(offsetof(PccControllerState, loop_system_allocations) == 384);
PCC_ASSERT(offsetof(PccControllerState, waiting) == 392);
PCC_ASSERT(offsetof(PccControllerState, refused_robot_states) == 396);
PCC_ASSERT(offsetof(PccControllerState, accepted_residual_m) == 400);
PCC_ASSERT(offsetof(PccControllerState, lateness_histogram) == 408);
PCC_ASSERT(offsetof(PccControllerState, reason) == 664);

/* One cycle of the loop (service `cycle`: slices of them, every cycle exactly once). */
typedef struct PccCycle {
  /* Counts the loop's cycles. */
  uint64_t sequence;
  /* Time at which the trajectory was evaluated, nanoseconds of `CLOCK_MONOTONIC`. */
  int64_t stamp_mono_ns;
  /* Set-point: tendon length changes, metres. */
  double setpoint_m[9];
  /* Set-point: velocities of the tendons, m/s. */
  double setpoint_velocity_m_s[9];
  /* Set-point: accelerations of the tendons, m/s². */
  double setpoint_acceleration_m_s2[9];
  /* Measured tendon length changes, metres. */
  double measured_tendon_m[9];
  /* Commanded configuration, radians. */
  double commanded_configuration_rad[6];
  /* Measured configuration, radians. */
  double measured_configuration_rad[6];
  /* `LoopState`. */
  uint32_t state;
  /* The executing trajectory; 0: none. */
  uint32_t trajectory_id;
} PccCycle;
PCC_ASSERT(sizeof(PccCycle) == 408);
PCC_ASSERT(offsetof(PccCycle, sequence) == 0);
PCC_ASSERT(offsetof(PccCycle, stamp_mono_ns) == 8);
PCC_ASSERT(offsetof(PccCycle, setpoint_m) == 16);
PCC_ASSERT(offsetof(PccCycle, setpoint_velocity_m_s) == 88);
PCC_ASSERT(offsetof(PccCycle, setpoint_acceleration_m_s2) == 160);
PCC_ASSERT(offsetof(PccCycle, measured_tendon_m) == 232);
PCC_ASSERT(offsetof(PccCycle, commanded_configuration_rad) == 304);
PCC_ASSERT(offsetof(PccCycle, measured_configuration_rad) == 352);
PCC_ASSERT(offsetof(PccCycle, state) == 400);
PCC_ASSERT(offsetof(PccCycle, trajectory_id) == 404);

/* How a trajectory ended that the controller has received (service `motion_result`, one publisher: the controller's relay thread; history 8). Each has exactly one, in the order in which they ended. */
typedef struct PccMotionResult {
  /* When it ended, nanoseconds of `CLOCK_MONOTONIC`. */
  int64_t stamp_mono_ns;
  /* `ControllerState::instance` of the controller. */
  uint64_t instance;
  /* Counts the results of this controller, from 1: where a number is missing a result was missed. */
  uint64_t sequence;
  /* `TrajectoryMessage::plan_id`. */
  uint64_t plan_id;
  /* Path time up to which the trajectory was followed, seconds; 0: it was not begun. */
  double path_time_s;
  /* Duration of the motion, seconds; 0 where the trajectory is malformed. */
  double duration_s;
  /* The trajectory. */
  uint32_t trajectory_id;
  /* `MotionOutcome`. */
  uint32_t outcome;
  /* The trajectory that left it at its switch; 0: none. */
  uint32_t joined_by;
  /* `StopCause`: what stopped it or set it aside. */
  uint32_t cause;
  /* `CommandSender` of the command, where the cause is one. */
  uint32_t sender;
  /* The process id of that sender; 0: not told. */
  uint32_t sender_pid;
  /* `LoopFault`, where the cause is one. */
  uint32_t fault;
  /* `Refusal`, where it was refused. */
  uint32_t refusal;
  /* Why it ended as it did; empty where it was reached. */
  PccReasonText reason;
} PccMotionResult;
PCC_ASSERT(sizeof(PccMotionResult) == 248);
PCC_ASSERT(offsetof(PccMotionResult, stamp_mono_ns) == 0);
PCC_ASSERT(offsetof(PccMotionResult, instance) == 8);
PCC_ASSERT(offsetof(PccMotionResult, sequence) == 16);
PCC_ASSERT(offsetof(PccMotionResult, plan_id) == 24);
PCC_ASSERT(offsetof(PccMotionResult, path_time_s) == 32);
PCC_ASSERT(offsetof(PccMotionResult, duration_s) == 40);
PCC_ASSERT(offsetof(PccMotionResult, trajectory_id) == 48);
PCC_ASSERT(offsetof(PccMotionResult, outcome) == 52);
PCC_ASSERT(offsetof(PccMotionResult, joined_by) == 56);
PCC_ASSERT(offsetof(PccMotionResult, cause) == 60);
PCC_ASSERT(offsetof(PccMotionResult, sender) == 64);
PCC_ASSERT(offsetof(PccMotionResult, sender_pid) == 68);
PCC_ASSERT(offsetof(PccMotionResult, fault) == 72);
PCC_ASSERT(offsetof(PccMotionResult, refusal) == 76);
PCC_ASSERT(offsetof(PccMotionResult, reason) == 80);

/* An obstacle that keeps its velocity. */
typedef struct PccMovingBall {
  /* Centre in the base frame at the scene's stamp, metres. */
  double centre_m[3];
  /* Radius, metres, not negative. */
  double radius_m;
  /* Velocity of the centre, m/s. */
  double velocity_m_s[3];
} PccMovingBall;
PCC_ASSERT(sizeof(PccMovingBall) == 56);
PCC_ASSERT(offsetof(PccMovingBall, centre_m) == 0);
PCC_ASSERT(offsetof(PccMovingBall, radius_m) == 24);
PCC_ASSERT(offsetof(PccMovingBall, velocity_m_s) == 32);

/* All obstacles that one source knows of (service `scene`, history 1). The newest scene of a source replaces the one before; the obstacles of all sources count together. Until a publisher that is there was heard, nothing is executed: make its port with the first scene, and go on calling `update_connections` or `send`, which hand the last scene to a daemon that starts later. */
typedef struct PccSceneMessage {
  /* Time for which the centres hold, nanoseconds of `CLOCK_MONOTONIC`; not in the future. */
  int64_t stamp_mono_ns;
  /* For how long from the stamp on the scene counts, nanoseconds, 1 ms to an hour. Once it is over and no newer one is there, nothing is executed and what moves is stopped. */
  int64_t lifetime_ns;
  /* Name of the source, 1 to 32 characters of printable ASCII, the rest zero. A publisher has one: once it has sent under two names nothing is executed until it is gone; two sources want two publishers. One that starts again takes its name up again; of two that are there the second is refused. */
  uint8_t source[32];
  /* Counts the publisher's scenes; the daemon's verdict returns it. */
  uint32_t sequence;
  /* `PROTOCOL_VERSION` of the sender. */
  uint32_t protocol_version;
  /* Balls in use, 0..=1024. */
  uint32_t ball_count;
  /* 1: the source takes its leave, its obstacles are gone and no scene of it is expected any more (what another publisher has told under this name counts until its lifetime ends); 0: it does not. */
  uint32_t takes_leave;
  /* The first `ball_count` are obstacles; the others are not read. */
  PccMovingBall balls[1024];
} PccSceneMessage;
PCC_ASSERT(sizeof(PccSceneMessage) == 57408);
PCC_ASSERT(offsetof(PccSceneMessage, stamp_mono_ns) == 0);
PCC_ASSERT(offsetof(PccSceneMessage, lifetime_ns) == 8);
PCC_ASSERT(offsetof(PccSceneMessage, source) == 16);
PCC_ASSERT(offsetof(PccSceneMessage, sequence) == 48);
PCC_ASSERT(offsetof(PccSceneMessage, protocol_version) == 52);
PCC_ASSERT(offsetof(PccSceneMessage, ball_count) == 56);
PCC_ASSERT(offsetof(PccSceneMessage, takes_leave) == 60);
PCC_ASSERT(offsetof(PccSceneMessage, balls) == 64);

/* The verdict on a scene (service `scene_status`, publisher: the daemon). Scenes that a newer one of the same publisher replaced before they were examined get no verdict. */
typedef struct PccSceneStatus {
  /* When the scene was judged, nanoseconds of `CLOCK_MONOTONIC`. */
  int64_t stamp_mono_ns;
  /* `stamp_mono_ns` of the scene. */
  int64_t scene_stamp_mono_ns;
  /* `source` of the scene. */
  uint8_t source[32];
  /* `sequence` of the scene. */
  uint32_t sequence;
  /* `PROTOCOL_VERSION` of the daemon. */
  uint32_t protocol_version;
  /* `SceneRefusal`: why the scene does not count; none: it does. */
  uint32_t refusal;
  /* Balls of the scene that count. */
  uint32_t ball_count;
  /* What is wrong with the scene, in words. */
  PccReasonText reason;
} PccSceneStatus;
PCC_ASSERT(sizeof(PccSceneStatus) == 232);
PCC_ASSERT(offsetof(PccSceneStatus, stamp_mono_ns) == 0);
PCC_ASSERT(offsetof(PccSceneStatus, scene_stamp_mono_ns) == 8);
PCC_ASSERT(offsetof(PccSceneStatus, source) == 16);
PCC_ASSERT(offsetof(PccSceneStatus, sequence) == 48);
PCC_ASSERT(offsetof(PccSceneStatus, protocol_version) == 52);
PCC_ASSERT(offsetof(PccSceneStatus, refusal) == 56);
PCC_ASSERT(offsetof(PccSceneStatus, ball_count) == 60);
PCC_ASSERT(offsetof(PccSceneStatus, reason) == 64);

/* A goal that the daemon keeps the robot on its way to (service `goal`; the newest one counts, whoever sent it). Where it moves it is sent again with another stamp; a stop or a reset after it was given ends it, however often it is sent again. */
typedef struct PccStandingGoal {
  /* When the goal was first given, nanoseconds of `CLOCK_MONOTONIC`: it is known by this, and no motion to it begins after a stop or a reset that was ordered later. */
  int64_t given_mono_ns;
  /* When it was where it is told to be, nanoseconds of `CLOCK_MONOTONIC`; not before `given_mono_ns` and not in the future. */
  int64_t stamp_mono_ns;
  /* The goal. */
  PccGoal goal;
  /* Velocity of a tip goal, base frame, m/s; believed for half a second from the stamp on. Not read where the goal is a configuration. */
  double tip_velocity_m_s[3];
  /* Share of the tendon limits to use, 1e-9 to 1. */
  double limits_scale;
  /* `RobotDescription::robot_hash` of the robot file that the sender is set up for: a daemon that plans for another robot refuses the goal; 0: it does not say. */
  uint64_t robot_hash;
  /* `PROTOCOL_VERSION` of the sender. */
  uint32_t protocol_version;
  /* 1: the goal is given up, and the robot brakes along its path; 0: it is not. */
  uint32_t is_withdrawn;
} PccStandingGoal;
PCC_ASSERT(sizeof(PccStandingGoal) == 152);
PCC_ASSERT(offsetof(PccStandingGoal, given_mono_ns) == 0);
PCC_ASSERT(offsetof(PccStandingGoal, stamp_mono_ns) == 8);
PCC_ASSERT(offsetof(PccStandingGoal, goal) == 16);
PCC_ASSERT(offsetof(PccStandingGoal, tip_velocity_m_s) == 104);
PCC_ASSERT(offsetof(PccStandingGoal, limits_scale) == 128);
PCC_ASSERT(offsetof(PccStandingGoal, robot_hash) == 136);
PCC_ASSERT(offsetof(PccStandingGoal, protocol_version) == 144);
PCC_ASSERT(offsetof(PccStandingGoal, is_withdrawn) == 148);

/* What becomes of the goal that stays (service `goal_status`, publisher: the daemon): at each change, and every 100 ms while there is a goal. */
typedef struct PccGoalStatus {
  /* When this was so, nanoseconds of `CLOCK_MONOTONIC`. */
  int64_t stamp_mono_ns;
  /* `StandingGoal::given_mono_ns`; 0: there was none yet. */
  int64_t given_mono_ns;
  /* `StandingGoal::stamp_mono_ns` of the last one that was heard, or of the one that is refused. */
  int64_t goal_stamp_mono_ns;
  /* Plans made for it. */
  uint64_t plan_count;
  /* Motions of these that were published for execution. */
  uint64_t motion_count;
  /* The motion to it that was published last; 0: none. */
  uint32_t trajectory_id;
  /* `GoalState`. */
  uint32_t state;
  /* `Outcome` of the last plan made for it. */
  uint32_t outcome;
  /* `PROTOCOL_VERSION` of the daemon. */
  uint32_t protocol_version;
  /* Why it is as it is; empty where there is nothing to explain. */
  PccReasonText reason;
} PccGoalStatus;
PCC_ASSERT(sizeof(PccGoalStatus) == 224);
PCC_ASSERT(offsetof(PccGoalStatus, stamp_mono_ns) == 0);
PCC_ASSERT(offsetof(PccGoalStatus, given_mono_ns) == 8);
PCC_ASSERT(offsetof(PccGoalStatus, goal_stamp_mono_ns) == 16);
PCC_ASSERT(offsetof(PccGoalStatus, plan_count) == 24);
PCC_ASSERT(offsetof(PccGoalStatus, motion_count) == 32);
PCC_ASSERT(offsetof(PccGoalStatus, trajectory_id) == 40);
PCC_ASSERT(offsetof(PccGoalStatus, state) == 44);
PCC_ASSERT(offsetof(PccGoalStatus, outcome) == 48);
PCC_ASSERT(offsetof(PccGoalStatus, protocol_version) == 52);
PCC_ASSERT(offsetof(PccGoalStatus, reason) == 56);

/* A process is alive and its work goes on (service `heartbeat`, at least 50 Hz). */
typedef struct PccHeartbeat {
  /* When the heartbeat was sent, nanoseconds of `CLOCK_MONOTONIC`. */
  int64_t stamp_mono_ns;
  /* Identifies the process among all that had this role since the machine was booted: its start time, nanoseconds of `CLOCK_MONOTONIC`. Trajectories name their daemon by it. */
  uint64_t instance;
  /* Counts the sender's heartbeats, from 1. */
  uint64_t sequence;
  /* `ProcessKind` of the sender. */
  uint32_t kind;
  /* The sender's process id. */
  uint32_t pid;
} PccHeartbeat;
PCC_ASSERT(sizeof(PccHeartbeat) == 32);
PCC_ASSERT(offsetof(PccHeartbeat, stamp_mono_ns) == 0);
PCC_ASSERT(offsetof(PccHeartbeat, instance) == 8);
PCC_ASSERT(offsetof(PccHeartbeat, sequence) == 16);
PCC_ASSERT(offsetof(PccHeartbeat, kind) == 24);
PCC_ASSERT(offsetof(PccHeartbeat, pid) == 28);

/* An order (service `command`, server: the controller's guard thread). */
typedef struct PccCommand {
  /* `PROTOCOL_VERSION` of the sender. */
  uint32_t protocol_version;
  /* `CommandKind`. */
  uint32_t kind;
  /* The rate to run at, 0..=1, if the kind is set speed. */
  double speed;
  /* The sender's number for this command; returned in the reply. */
  uint64_t command_id;
  /* `CommandSender`. */
  uint32_t sender;
  /* The sender's process id; 0: not told. */
  uint32_t sender_pid;
  /* Why it is ordered, as the results of the motions tell it that it stops. */
  PccReasonText reason;
} PccCommand;
PCC_ASSERT(sizeof(PccCommand) == 200);
PCC_ASSERT(offsetof(PccCommand, protocol_version) == 0);
PCC_ASSERT(offsetof(PccCommand, kind) == 4);
PCC_ASSERT(offsetof(PccCommand, speed) == 8);
PCC_ASSERT(offsetof(PccCommand, command_id) == 16);
PCC_ASSERT(offsetof(PccCommand, sender) == 24);
PCC_ASSERT(offsetof(PccCommand, sender_pid) == 28);
PCC_ASSERT(offsetof(PccCommand, reason) == 32);

/* The reply to an order. */
typedef struct PccCommandReply {
  /* The sender's number of the command that this answers. */
  uint64_t command_id;
  /* `PROTOCOL_VERSION` of the controller. */
  uint32_t protocol_version;
  /* 1: the command takes effect; 0: it does not. */
  uint32_t accepted;
  /* `CommandRefusal`: why the command has no effect; none: it has. */
  uint32_t refusal;
  /* `LoopState` when the command was answered. */
  uint32_t state;
  /* What is wrong, or what the robot does, in words. */
  PccReasonText reason;
} PccCommandReply;
PCC_ASSERT(sizeof(PccCommandReply) == 192);
PCC_ASSERT(offsetof(PccCommandReply, command_id) == 0);
PCC_ASSERT(offsetof(PccCommandReply, protocol_version) == 8);
PCC_ASSERT(offsetof(PccCommandReply, accepted) == 12);
PCC_ASSERT(offsetof(PccCommandReply, refusal) == 16);
PCC_ASSERT(offsetof(PccCommandReply, state) == 20);
PCC_ASSERT(offsetof(PccCommandReply, reason) == 24);

#endif
