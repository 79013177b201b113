/* A robot whose motors are at once where they are to be: drive ROBOT_FILE. */
#include <pcc/client.h>
#include <stdio.h>

int main(int count, char **argument) {
  PccDriver *driver = pcc_driver_connect(NULL, NULL, count > 1 ? argument[1] : NULL, NULL);
  if (!driver) return fprintf(stderr, "%s\n", pcc_last_error()), 1;
  PccMotorTargets targets;
  while (pcc_driver_next(driver, &targets) == 0 && pcc_driver_report(driver, targets.position_m, PCC_MOTOR_FAULT_NONE) == 0)
    continue;
  return fprintf(stderr, "%s\n", pcc_last_error()), 1;
}
