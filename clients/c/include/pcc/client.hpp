// The client of the planner, its controller and the robot for C++20: values that free themselves, and exceptions, over client.h.
// Each value is used by the thread that made it, one thread at a time. Times that a call may take are seconds.
#ifndef PCC_CLIENT_HPP
#define PCC_CLIENT_HPP

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

#include "client.h"

namespace pcc {

/// A call that has failed: why in words, and of which kind.
struct Error : std::runtime_error {
  PccErrorKind kind = pcc_last_error_kind();
  Error() : std::runtime_error(pcc_last_error()) {}
};

namespace detail {
template <auto free>
struct Free {
  void operator()(auto *value) const noexcept { free(value); }
};
template <class T, auto free>
using Owned = std::unique_ptr<T, Free<free>>;

template <class T>
T *not_null(T *value) {
  if (!value) throw Error();
  return value;
}
inline bool is_one(int32_t told) {
  if (told < 0) throw Error();
  return told == 1;
}
}  // namespace detail

/// Where the services live; null: what the environment says, or the default.
struct Place {
  const char *prefix = nullptr;
  const char *root = nullptr;
};

/// The text for people of a code, as in text("Outcome", report.outcome).
inline std::string_view text(const char *set, uint32_t code) { return detail::not_null(pcc_text(set, code)); }

/// The text beside a code: a copy, so that it outlives an answer.
inline std::string text(const PccReasonText &reason) {
  return {reinterpret_cast<const char *>(reason.utf8), std::min<size_t>(reason.length, sizeof reason.utf8)};
}

/// A tip to reach, metres in the base frame, within the default tolerance.
inline PccGoal tip(double x, double y, double z) {
  PccGoal goal{};
  goal.kind = PCC_GOAL_KIND_TIP;
  goal.tip_m[0] = x, goal.tip_m[1] = y, goal.tip_m[2] = z;
  return goal;
}

/// A request for ten candidates from where the robot is to a goal.
inline PccPlanRequest request(const PccGoal &goal, PccExecute execute = PCC_EXECUTE_NOTHING) {
  PccPlanRequest request = pcc_plan_request();
  request.execute = execute;
  request.goal_count = 1;
  request.goals[0] = goal;
  return request;
}

/// An answer, in the daemon's own memory until it is destroyed: no report and no span outlives it.
class Answer {
 public:
  explicit Answer(PccAnswer *answer) : answer_(detail::not_null(answer)) {}
  const PccPlanReport &report() const & { return *pcc_answer_report(answer_.get()); }
  std::span<const PccCandidateSummary> candidates() const & { return {report().candidates, report().candidate_count}; }
  std::span<const PccKnot> knots(uint32_t candidate) const & {
    size_t count = 0;
    const PccKnot *first = detail::not_null(pcc_answer_knots(answer_.get(), candidate, &count));
    return {first, count};
  }
  const PccPlanReport &report() && = delete;
  std::span<const PccCandidateSummary> candidates() && = delete;
  std::span<const PccKnot> knots(uint32_t candidate) && = delete;

 private:
  detail::Owned<PccAnswer, pcc_answer_free> answer_;
};

/// A connection to the planner daemon that outlives the daemon's restarts.
class Client {
 public:
  explicit Client(Place place = {}) : client_(detail::not_null(pcc_client_connect(place.prefix, place.root))) {}
  /// States the robot file that this program is set up for: a daemon that plans for another robot refuses what is asked from now on.
  void state_robot(const char *robot_file) { detail::is_one(pcc_client_state_robot(client_.get(), robot_file)); }
  Answer plan(const PccPlanRequest &request, double timeout_s) { return Answer(pcc_plan(client_.get(), &request, timeout_s)); }
  Answer execute(uint64_t plan_id, uint32_t candidate, double timeout_s) {
    return Answer(pcc_execute(client_.get(), plan_id, candidate, timeout_s));
  }

 private:
  detail::Owned<PccClient, pcc_client_free> client_;
};

/// The results of motions: those since it was made, and the last eight before.
class Results {
 public:
  explicit Results(Place place = {}) : results_(detail::not_null(pcc_results_connect(place.prefix, place.root))) {}
  std::optional<PccMotionResult> wait(uint32_t trajectory_id, double timeout_s) {
    PccMotionResult result;
    bool ended = detail::is_one(pcc_results_wait(results_.get(), trajectory_id, timeout_s, &result));
    return ended ? std::optional(result) : std::nullopt;
  }

 private:
  detail::Owned<PccResults, pcc_results_free> results_;
};

/// The controller's state, and orders to it.
class ControllerView {
 public:
  explicit ControllerView(Place place = {}) : view_(detail::not_null(pcc_controller_connect(place.prefix, place.root))) {}
  std::optional<PccControllerState> state() {
    PccControllerState state;
    return detail::is_one(pcc_controller_state(view_.get(), &state)) ? std::optional(state) : std::nullopt;
  }
  /// The reply, also of an order that is refused.
  PccCommandReply command(PccCommandKind kind, double timeout_s, const char *reason = nullptr, double speed = 1.0) {
    PccCommandReply reply;
    detail::is_one(pcc_controller_command(view_.get(), kind, speed, reason, timeout_s, &reply));
    return reply;
  }

 private:
  detail::Owned<PccControllerView, pcc_controller_free> view_;
};

/// The robot's state.
class RobotView {
 public:
  explicit RobotView(Place place = {}) : view_(detail::not_null(pcc_robot_connect(place.prefix, place.root))) {}
  std::optional<PccRobotState> state() {
    PccRobotState state;
    return detail::is_one(pcc_robot_state(view_.get(), &state)) ? std::optional(state) : std::nullopt;
  }

 private:
  detail::Owned<PccRobotView, pcc_robot_free> view_;
};

/// Drives the motors of the robot of a robot file, in cycles of 1 ms; it has the robot's place. Destroy it at rest alone.
class Driver {
 public:
  /// Motors that stand at these lengths of their tendons relative to the straight robot, metres (null: 0).
  explicit Driver(const char *robot_file, const std::array<double, 9> *position_m = nullptr, Place place = {})
      : driver_(detail::not_null(
            pcc_driver_connect(place.prefix, place.root, robot_file, position_m ? position_m->data() : nullptr))) {}
  /// Waits for the next cycle; none once it was shut down and the motors rest.
  std::optional<PccMotorTargets> next() {
    PccMotorTargets targets;
    return detail::is_one(pcc_driver_next(driver_.get(), &targets)) ? std::optional(targets) : std::nullopt;
  }
  /// Publishes what the motors did in it.
  void report(std::span<const double, 9> measured_m, PccMotorFault fault = PCC_MOTOR_FAULT_NONE) {
    detail::is_one(pcc_driver_report(driver_.get(), measured_m.data(), fault));
  }
  /// Has Ctrl-C and SIGTERM do what `shut_down` does, in place of ending the process in motion.
  void shut_down_at_signals() { detail::is_one(pcc_driver_shut_down_at_signals(driver_.get())); }
  /// Ramps the motors to rest; go on with cycles until there are no targets.
  void shut_down() { detail::is_one(pcc_driver_shut_down(driver_.get())); }

 private:
  detail::Owned<PccDriver, pcc_driver_free> driver_;
};

/// Follows the planner's trajectories in the controller's place, by a configuration file like config/controller.toml. Destroy it at rest alone.
class Follower {
 public:
  /// Motors that stand at these lengths of their tendons relative to the straight robot, metres (null: 0).
  explicit Follower(const char *config_file, const std::array<double, 9> *position_m = nullptr, Place place = {})
      : follower_(detail::not_null(
            pcc_follower_connect(place.prefix, place.root, config_file, position_m ? position_m->data() : nullptr))) {}
  /// Waits for the next cycle; none once it was shut down and the robot is at rest.
  std::optional<PccFollowedCycle> next() {
    PccFollowedCycle cycle;
    return detail::is_one(pcc_follower_next(follower_.get(), &cycle)) ? std::optional(cycle) : std::nullopt;
  }
  /// Says what the motors did in it.
  void report(std::span<const double, 9> measured_m, PccMotorFault fault = PCC_MOTOR_FAULT_NONE) {
    detail::is_one(pcc_follower_report(follower_.get(), measured_m.data(), fault));
  }
  /// Has Ctrl-C and SIGTERM do what `shut_down` does, in place of ending the process in motion.
  void shut_down_at_signals() { detail::is_one(pcc_follower_shut_down_at_signals(follower_.get())); }
  /// Stops the robot along its path; go on with cycles until there is none.
  void shut_down() { detail::is_one(pcc_follower_shut_down(follower_.get())); }

 private:
  detail::Owned<PccFollower, pcc_follower_free> follower_;
};

/// Publishes what one source knows of the obstacles. Destroying it is no leave.
class Scene {
 public:
  explicit Scene(const char *source, Place place = {})
      : scene_(detail::not_null(pcc_scene_connect(place.prefix, place.root, source))) {}
  void publish(std::span<const PccMovingBall> balls, double lifetime_s) {
    detail::is_one(pcc_scene_publish(scene_.get(), balls.data(), balls.size(), lifetime_s));
  }
  void confirm(double timeout_s) { detail::is_one(pcc_scene_confirm(scene_.get(), timeout_s)); }
  void leave() { detail::is_one(pcc_scene_leave(scene_.get())); }

 private:
  detail::Owned<PccScene, pcc_scene_free> scene_;
};

/// Gives the daemon a goal that stays, moves it, and hears what becomes of it. Destroying it does not end the goal.
class GoalSender {
 public:
  explicit GoalSender(Place place = {}) : sender_(detail::not_null(pcc_goal_connect(place.prefix, place.root))) {}
  /// States the robot file that this program is set up for: a daemon that plans for another robot refuses every goal given from now on.
  void state_robot(const char *robot_file) { detail::is_one(pcc_goal_state_robot(sender_.get(), robot_file)); }
  void give(const PccGoal &goal, double limits_scale = 1.0) {
    detail::is_one(pcc_goal_give(sender_.get(), &goal, limits_scale));
  }
  void move(const PccGoal &goal, const std::array<double, 3> &tip_velocity_m_s) {
    const double velocity_m_s[3] = {tip_velocity_m_s[0], tip_velocity_m_s[1], tip_velocity_m_s[2]};
    detail::is_one(pcc_goal_move(sender_.get(), &goal, &velocity_m_s));
  }
  void withdraw() { detail::is_one(pcc_goal_withdraw(sender_.get())); }
  std::optional<PccGoalStatus> status() {
    PccGoalStatus status;
    return detail::is_one(pcc_goal_status(sender_.get(), &status)) ? std::optional(status) : std::nullopt;
  }

 private:
  detail::Owned<PccGoalSender, pcc_goal_free> sender_;
};

}  // namespace pcc

#endif
