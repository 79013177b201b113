/* A robot whose motors are at once where they are to be: drive ROBOT_FILE. */
#include <pcc/client.h>
#include <stdio.h>

int main(int count, char **argument) {
  if (count != 2) return fprintf(stderr, "usage: drive ROBOT_FILE\n"), 2;
  PccDriver *driver = pcc_driver_connect(NULL, NULL, argument[1], NULL);
  if (!driver || pcc_driver_shut_down_at_signals(driver) < 0) return fprintf(stderr, "%s\n", pcc_last_error()), 1;
  PccMotorTargets targets;
  int32_t told;
  while ((told = pcc_driver_next(driver, &targets)) == 1)
    if (pcc_driver_report(driver, targets.position_m, PCC_MOTOR_FAULT_NONE) < 0) break;
  if (told != 0) return fprintf(stderr, "%s\n", pcc_last_error()), 1;
  pcc_driver_free(driver);
  return 0;
}
