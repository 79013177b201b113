/* Publishes a ball that moves, for some seconds, then takes its leave: scene X Y Z RADIUS VX VY VZ SECONDS, metres and m/s. */
#include <pcc/client.h>
#include <stdio.h>
#include <stdlib.h>
#include <threads.h>

int main(int count, char **argument) {
  if (count != 9) return fprintf(stderr, "usage: scene X Y Z RADIUS VX VY VZ SECONDS, metres and m/s\n"), 2;
  double number[8];
  for (int i = 0; i < 8; i++) number[i] = atof(argument[i + 1]);
  PccMovingBall ball = {{number[0], number[1], number[2]}, number[3], {number[4], number[5], number[6]}};
  PccScene *scene = pcc_scene_connect(NULL, NULL, "c-example");
  if (!scene) return fprintf(stderr, "%s\n", pcc_last_error()), 1;
  for (double elapsed_s = 0.0; elapsed_s < number[7]; elapsed_s += 0.03, thrd_sleep(&(struct timespec){.tv_nsec = 30000000}, NULL)) {
    if (pcc_scene_publish(scene, &ball, 1, 0.2) < 0) return fprintf(stderr, "%s\n", pcc_last_error()), 1;
    for (int axis = 0; axis < 3; axis++) ball.centre_m[axis] += 0.03 * ball.velocity_m_s[axis];
  }
  int left = pcc_scene_leave(scene) | pcc_scene_confirm(scene, 2.0);
  printf("%s\n", left ? pcc_last_error() : "every scene counted");
  pcc_scene_free(scene);
  return -left;
}
