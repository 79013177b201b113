// Follows the planner's motions in the controller's place, with motors that are at once where they are to be: follow CONTROLLER_FILE.
#include <pcc/client.hpp>

int main(int, char **argument) {
  pcc::Follower follower(argument[1]);
  while (std::optional<PccFollowedCycle> cycle = follower.next()) follower.report(cycle->targets.position_m);
}
