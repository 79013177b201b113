/* Follows the planner's motions in the controller's place, with motors that are at once where they are to be: follow CONTROLLER_FILE. */
#include <pcc/client.h>
#include <stdio.h>

int main(int count, char **argument) {
  if (count != 2) return fprintf(stderr, "usage: follow CONTROLLER_FILE\n"), 2;
  PccFollower *follower = pcc_follower_connect(NULL, NULL, argument[1], NULL);
  if (!follower || pcc_follower_shut_down_at_signals(follower) < 0) return fprintf(stderr, "%s\n", pcc_last_error()), 1;
  PccFollowedCycle cycle;
  int32_t told;
  while ((told = pcc_follower_next(follower, &cycle)) == 1)
    if (pcc_follower_report(follower, cycle.targets.position_m, PCC_MOTOR_FAULT_NONE) < 0) break;
  if (told != 0) return fprintf(stderr, "%s\n", pcc_last_error()), 1;
  pcc_follower_free(follower);
  return 0;
}
