// Has a motion to a tip planned and executed, and waits for its result: plan X Y Z, metres in the base frame.
#include <iostream>
#include <pcc/client.hpp>

int main(int count, char **argument) {
  if (count != 4) return std::cerr << "usage: plan X Y Z, metres in the base frame\n", 2;
  pcc::Client client;
  pcc::Results results;
  PccGoal goal = pcc::tip(std::stod(argument[1]), std::stod(argument[2]), std::stod(argument[3]));
  pcc::Answer answer = client.plan(pcc::request(goal, PCC_EXECUTE_SELECTED), 5.0);
  const PccPlanReport &report = answer.report();
  std::cout << pcc::text("Outcome", report.outcome) << ": " << pcc::text(report.reason) << "; hash " << std::hex << report.plan_hash << '\n';
  auto result = report.trajectory_id ? results.wait(report.trajectory_id, 60.0) : std::nullopt;
  if (result) std::cout << std::dec << "trajectory " << result->trajectory_id << ": " << pcc::text("MotionOutcome", result->outcome) << '\n';
  return result ? 0 : 1;
}
