// A robot whose motors are at once where they are to be: drive ROBOT_FILE.
#include <iostream>
#include <pcc/client.hpp>

int main(int count, char **argument) {
  if (count != 2) return std::cerr << "usage: drive ROBOT_FILE\n", 2;
  pcc::Driver driver(argument[1]);
  driver.shut_down_at_signals();
  while (std::optional<PccMotorTargets> targets = driver.next()) driver.report(targets->position_m);
}
