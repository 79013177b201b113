// A robot whose motors are at once where they are to be: drive ROBOT_FILE.
#include <pcc/client.hpp>

int main(int, char **argument) {
  pcc::Driver driver(argument[1]);
  while (true) {
    PccMotorTargets targets = driver.next();
    driver.report(targets.position_m);
  }
}
