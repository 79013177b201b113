/* Shows what the controller does for some seconds: watch SECONDS. */
#include <pcc/client.h>
#include <stdio.h>
#include <stdlib.h>
#include <threads.h>

int main(int count, char **argument) {
  if (count != 2) return fprintf(stderr, "usage: watch SECONDS\n"), 2;
  PccControllerView *controller = pcc_controller_connect(NULL, NULL);
  if (!controller) return fprintf(stderr, "%s\n", pcc_last_error()), 1;
  PccControllerState state;
  for (int round = 0; round < 10 * atoi(argument[1]); round++, thrd_sleep(&(struct timespec){.tv_nsec = 100000000}, NULL))
    if (pcc_controller_state(controller, &state) == 1)
      printf("%s, trajectory %u at %.3f s\n", pcc_text("LoopState", state.state), state.trajectory_id, state.trajectory_time_s);
}
