/* The client of the planner, its controller and the robot. Link with libpcc_client.
   Written from clients/c/src by its test `header`; edit there. */

#ifndef PCC_CLIENT_H
#define PCC_CLIENT_H

#include <stddef.h>
#include <stdint.h>
#include "messages.h"

/*
 What kind of error the last failed call of a thread met.
 */
typedef enum {
  /*
   None has failed.
   */
  PCC_ERROR_KIND_NONE = 0,
  /*
   A pointer is null, a text is no UTF-8, a number or a code is not allowed, there is no such candidate, or a file (of a robot, of settings)
   or a configuration is refused.
   */
  PCC_ERROR_KIND_ARGUMENT = 1,
  /*
   The request is not valid: the text names the field and what is allowed.
   */
  PCC_ERROR_KIND_INVALID_REQUEST = 2,
  /*
   A service or a port is not available.
   */
  PCC_ERROR_KIND_IPC = 3,
  /*
   Nobody serves under this prefix and root.
   */
  PCC_ERROR_KIND_NO_SERVER = 4,
  /*
   The server ended before it answered.
   */
  PCC_ERROR_KIND_SERVER_LOST = 5,
  /*
   The server did not answer in time.
   */
  PCC_ERROR_KIND_TIMED_OUT = 6,
  /*
   This client has as many unanswered requests as the daemon allows.
   */
  PCC_ERROR_KIND_TOO_MANY_REQUESTS = 7,
  /*
   The daemon does not let a scene count.
   */
  PCC_ERROR_KIND_SCENE_REFUSED = 8,
  /*
   What came is no message of this protocol's version.
   */
  PCC_ERROR_KIND_BAD_MESSAGE = 9,
  /*
   iceoryx2 could not send or receive.
   */
  PCC_ERROR_KIND_TRANSPORT = 10,
} PccErrorKind;

/*
 An answer, in the daemon's own memory until it is freed.
 */
typedef struct PccAnswer PccAnswer;

/*
 A connection to the planner daemon that outlives the daemon's restarts.
 */
typedef struct PccClient PccClient;

/*
 The controller's state, and orders to it.
 */
typedef struct PccControllerView PccControllerView;

/*
 The driver of a robot's motors; it has the robot's place.
 */
typedef struct PccDriver PccDriver;

/*
 The follower of trajectories; it has the controller's place.
 */
typedef struct PccFollower PccFollower;

/*
 Gives the daemon a goal, moves it, and hears what becomes of it.
 */
typedef struct PccGoalSender PccGoalSender;

/*
 The results of motions: those since it was connected, and the last eight before.
 */
typedef struct PccResults PccResults;

/*
 The robot's state.
 */
typedef struct PccRobotView PccRobotView;

/*
 Publishes what one source knows of the obstacles.
 */
typedef struct PccScene PccScene;

/*
 What motors are to do in a cycle: lengths of the tendons relative to the straight robot, those beyond the robot's tendons 0.
 */
typedef struct {
  /*
   Time for which this is, nanoseconds of CLOCK_MONOTONIC.
   */
  int64_t stamp_ns;
  /*
   Metres.
   */
  double position_m[9];
  /*
   Metres a second.
   */
  double velocity_m_s[9];
  /*
   Metres a second squared.
   */
  double acceleration_m_s2[9];
} PccMotorTargets;

/*
 One cycle of a follower: what the motors are to do, and the configuration that is commanded.
 */
typedef struct {
  /*
   What the motors are to do.
   */
  PccMotorTargets targets;
  /*
   The configuration of the set-point, radians.
   */
  double configuration_rad[6];
  /*
   Radians a second.
   */
  double velocity_rad_s[6];
  /*
   Radians a second squared.
   */
  double acceleration_rad_s2[6];
  /*
   A `PccLoopState`.
   */
  uint32_t state;
  /*
   The trajectory being followed, 0 for none.
   */
  uint32_t trajectory_id;
} PccFollowedCycle;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/*
 Why the last failed call of this thread has failed, in words; valid until the thread's next call fails.
 */
const char *pcc_last_error(void);

/*
 What kind of error the last failed call of this thread met.
 */
PccErrorKind pcc_last_error_kind(void);

/*
 Joins the services of plans; the daemon need not run yet. A null pointer stands for `PCC_PREFIX` or `PCC_ROOT` of the environment, or
 the default. Null where it fails.
 */
PccClient *pcc_client_connect(const char *prefix,
                              const char *root);

/*
 Ends a connection; nothing where the pointer is null. Its answers stay valid.
 */
void pcc_client_free(PccClient *client);

/*
 States the robot file that this program is set up for: a daemon that plans for another robot refuses what the client asks for from now on
 (outcome wrong robot). 0, or -1 where the file is none.
 */
int32_t pcc_client_state_robot(PccClient *client,
                               const char *robot_file);

/*
 A request for ten candidates from where the robot is, asked for now, with the daemon's defaults; its goals are to be written. It is not
 executed unless `execute` says so.
 */
PccPlanRequest pcc_plan_request(void);

/*
 Sends a request and waits for its answer, `timeout_s` seconds in all. Null where there is none; an answer with another outcome than ok
 is an answer.
 */
PccAnswer *pcc_plan(PccClient *client,
                    const PccPlanRequest *request,
                    double timeout_s);

/*
 Has a candidate of an earlier plan executed exactly as it was answered, and waits for the answer, `timeout_s` seconds in all;
 [`NONE_SELECTED`] stands for the one that was selected. Null where there is no answer.
 */
PccAnswer *pcc_execute(PccClient *client,
                       uint64_t plan_id,
                       uint32_t candidate,
                       double timeout_s);

/*
 What happened; valid until the answer is freed. Null where the pointer is.
 */
const PccPlanReport *pcc_answer_report(const PccAnswer *answer);

/*
 The knots of a candidate where the daemon wrote them; valid until the answer is freed. Their number is written to `count`. Null where
 there is no such candidate.
 */
const PccKnot *pcc_answer_knots(const PccAnswer *answer,
                                uint32_t candidate,
                                size_t *count);

/*
 Gives the answer's memory back to the daemon; nothing where the pointer is null.
 */
void pcc_answer_free(PccAnswer *answer);

/*
 Joins the service of results; the controller need not run yet. Null where it fails.
 */
PccResults *pcc_results_connect(const char *prefix, const char *root);

/*
 Ends it; nothing where the pointer is null.
 */
void pcc_results_free(PccResults *results);

/*
 Waits until a trajectory has ended, `timeout_s` seconds at most: 1 and the result, 0 where it has not, -1 where it fails.
 */
int32_t pcc_results_wait(PccResults *results,
                         uint32_t trajectory_id,
                         double timeout_s,
                         PccMotionResult *result);

/*
 Joins the controller's services; it need not run yet. Null where it fails.
 */
PccControllerView *pcc_controller_connect(const char *prefix, const char *root);

/*
 Ends it; nothing where the pointer is null.
 */
void pcc_controller_free(PccControllerView *controller);

/*
 The newest state, however old: 1 and the state, 0 where the controller has published none, -1 where it fails.
 */
int32_t pcc_controller_state(PccControllerView *controller,
                             PccControllerState *state);

/*
 Gives an order (a `PccCommandKind`) with the speed to run at, which only setting the speed needs, and a reason that is told to others (may
 be null), and waits for the reply, `timeout_s` seconds in all: 1 where it takes effect, 0 where the controller refuses it, -1 where it
 fails. The reply is written to `reply`, unless that is null.
 */
int32_t pcc_controller_command(PccControllerView *controller,
                               uint32_t kind,
                               double speed,
                               const char *reason,
                               double timeout_s,
                               PccCommandReply *reply);

/*
 Joins the robot's service; it need not run yet. Null where it fails.
 */
PccRobotView *pcc_robot_connect(const char *prefix, const char *root);

/*
 Ends it; nothing where the pointer is null.
 */
void pcc_robot_free(PccRobotView *robot);

/*
 The newest state, however old: 1 and the state, 0 where the robot has published none, -1 where it fails.
 */
int32_t pcc_robot_state(PccRobotView *robot,
                        PccRobotState *state);

/*
 Joins the services as a source of this name, 1 to 32 characters of printable ASCII. Null where it fails.
 */
PccScene *pcc_scene_connect(const char *prefix,
                            const char *root,
                            const char *source);

/*
 Ends it, which is no leave: once the lifetime of its last scene is over the daemon executes nothing more. Nothing where the pointer is
 null.
 */
void pcc_scene_free(PccScene *scene);

/*
 Publishes all obstacles that this source knows of now, at most 1024; they count for `lifetime_s` seconds. 0, or -1 where it fails, also
 where the daemon has refused an earlier one and that was not told yet.
 */
int32_t pcc_scene_publish(PccScene *scene,
                          const PccMovingBall *balls,
                          size_t count,
                          double lifetime_s);

/*
 Waits until the daemon has judged the last scene, `timeout_s` seconds at most: 0, or -1 where it has refused it or there is no verdict.
 */
int32_t pcc_scene_confirm(PccScene *scene,
                          double timeout_s);

/*
 Signs the source off: its obstacles are gone, and no scene of it is expected any more. 0, or -1 where it fails.
 */
int32_t pcc_scene_leave(PccScene *scene);

/*
 Joins the services of goals; the daemon need not run yet. Null where it fails.
 */
PccGoalSender *pcc_goal_connect(const char *prefix, const char *root);

/*
 Ends it; the goal stays. Nothing where the pointer is null.
 */
void pcc_goal_free(PccGoalSender *sender);

/*
 States the robot file that this program is set up for: a daemon that plans for another robot refuses every goal that is given from now
 on. 0, or -1 where the file is none.
 */
int32_t pcc_goal_state_robot(PccGoalSender *sender,
                             const char *robot_file);

/*
 Gives another goal, to be reached with a share of the tendon limits (1e-9 to 1); it takes the place of every earlier one. 0, or -1 where
 it fails.
 */
int32_t pcc_goal_give(PccGoalSender *sender,
                      const PccGoal *goal,
                      double limits_scale);

/*
 Says where the goal that was given last is now, and with which velocity it moves where it is a tip (three numbers, base frame, m/s). 0,
 or -1 where it fails.
 */
int32_t pcc_goal_move(PccGoalSender *sender,
                      const PccGoal *goal,
                      const double (*tip_velocity_m_s)[3]);

/*
 Gives the goal up: the robot brakes along its path. 0, or -1 where it fails.
 */
int32_t pcc_goal_withdraw(PccGoalSender *sender);

/*
 The newest status of the goal that was given last: 1 and the status, 0 until the daemon has heard it and once
 that daemon has ended before the goal, -1 where it fails.
 */
int32_t pcc_goal_status(PccGoalSender *sender,
                        PccGoalStatus *status);

/*
 Takes the robot's place for the robot of a robot file, whose motors stand at `position_m` (9 lengths of the tendons relative to the straight
 robot, metres; null: all 0). A cycle is 1 ms. Null where it fails, also where another driver is there.
 */
PccDriver *pcc_driver_connect(const char *prefix,
                              const char *root,
                              const char *robot_file,
                              const double *position_m);

/*
 Leaves the robot's place, which is to be done at rest alone; nothing where the pointer is null.
 */
void pcc_driver_free(PccDriver *driver);

/*
 Waits for the next cycle and says what the motors are to do in it: 1; 0 where it was shut down and the motors rest; -1 where it fails.
 */
int32_t pcc_driver_next(PccDriver *driver,
                        PccMotorTargets *targets);

/*
 Publishes what the motors did in this cycle: 9 measured lengths of the tendons relative to the straight robot, metres, and a
 `PccMotorFault`; one that cannot be sent is left out. 0, or -1 where an argument is not allowed.
 */
int32_t pcc_driver_report(PccDriver *driver,
                          const double *measured_m,
                          uint32_t fault);

/*
 Has Ctrl-C and SIGTERM do what `pcc_driver_shut_down` does, in place of ending the process in motion. 0, or -1 where it fails.
 */
int32_t pcc_driver_shut_down_at_signals(PccDriver *driver);

/*
 Ramps the motors to rest; go on with cycles until `pcc_driver_next` says 0. 0, or -1 where it fails.
 */
int32_t pcc_driver_shut_down(const PccDriver *driver);

/*
 Takes the controller's place by a configuration file like `config/controller.toml`, with motors that stand at `position_m` (9 lengths of
 the tendons relative to the straight robot, metres; null: all 0). Null where it fails, also where another controller is there.
 */
PccFollower *pcc_follower_connect(const char *prefix,
                                  const char *root,
                                  const char *config_file,
                                  const double *position_m);

/*
 Leaves the controller's place, which is to be done at rest alone; nothing where the pointer is null.
 */
void pcc_follower_free(PccFollower *follower);

/*
 Waits for the next cycle and says what the motors are to do in it: 1; 0 where it was shut down and the robot is at rest; -1 where it fails.
 */
int32_t pcc_follower_next(PccFollower *follower,
                          PccFollowedCycle *cycle);

/*
 Says what the motors did in this cycle: 9 measured lengths of the tendons relative to the straight robot, metres, and a `PccMotorFault`.
 0, or -1 where it fails.
 */
int32_t pcc_follower_report(PccFollower *follower,
                            const double *measured_m,
                            uint32_t fault);

/*
 Has Ctrl-C and SIGTERM do what `pcc_follower_shut_down` does, in place of ending the process in motion. 0, or -1 where it fails.
 */
int32_t pcc_follower_shut_down_at_signals(PccFollower *follower);

/*
 Stops the robot along its path; go on with cycles until `pcc_follower_next` says 0. 0, or -1 where it fails.
 */
int32_t pcc_follower_shut_down(const PccFollower *follower);

/*
 The text for people of a code, as in `pcc_text("Outcome", report->outcome)`; valid for ever. Null where there is no such set or code.
 */
const char *pcc_text(const char *set,
                     uint32_t code);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* PCC_CLIENT_H */

PCC_ASSERT(sizeof(PccMotorTargets) == 224);
PCC_ASSERT(offsetof(PccMotorTargets, stamp_ns) == 0);
PCC_ASSERT(offsetof(PccMotorTargets, position_m) == 8);
PCC_ASSERT(offsetof(PccMotorTargets, velocity_m_s) == 80);
PCC_ASSERT(offsetof(PccMotorTargets, acceleration_m_s2) == 152);
PCC_ASSERT(sizeof(PccFollowedCycle) == 376);
PCC_ASSERT(offsetof(PccFollowedCycle, targets) == 0);
PCC_ASSERT(offsetof(PccFollowedCycle, configuration_rad) == 224);
PCC_ASSERT(offsetof(PccFollowedCycle, velocity_rad_s) == 272);
PCC_ASSERT(offsetof(PccFollowedCycle, acceleration_rad_s2) == 320);
PCC_ASSERT(offsetof(PccFollowedCycle, state) == 368);
PCC_ASSERT(offsetof(PccFollowedCycle, trajectory_id) == 372);
