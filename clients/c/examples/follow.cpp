// Follows the planner's motions in the controller's place, with motors that are at once where they are to be: follow CONTROLLER_FILE.
#include <iostream>
#include <pcc/client.hpp>

int main(int count, char **argument) {
  if (count != 2) return std::cerr << "usage: follow CONTROLLER_FILE\n", 2;
  pcc::Follower follower(argument[1]);
  follower.shut_down_at_signals();
  while (std::optional<PccFollowedCycle> cycle = follower.next()) follower.report(cycle->targets.position_m);
}
