// Publishes a ball that moves, for some seconds, then takes its leave: scene X Y Z RADIUS VX VY VZ SECONDS, metres and m/s.
#include <iostream>
#include <pcc/client.hpp>
#include <thread>

int main(int count, char **argument) {
  if (count != 9) return std::cerr << "usage: scene X Y Z RADIUS VX VY VZ SECONDS, metres and m/s\n", 2;
  double number[8];
  for (int i = 0; i < 8; i++) number[i] = std::stod(argument[i + 1]);
  PccMovingBall ball{{number[0], number[1], number[2]}, number[3], {number[4], number[5], number[6]}};
  pcc::Scene scene("cpp-example");
  for (double elapsed_s = 0; elapsed_s < number[7]; elapsed_s += 0.03) {
    scene.publish(std::span(&ball, 1), 0.2);
    std::this_thread::sleep_for(std::chrono::milliseconds(30));
    for (int axis = 0; axis < 3; axis++) ball.centre_m[axis] += 0.03 * ball.velocity_m_s[axis];
  }
  scene.leave(), scene.confirm(2.0);
  std::cout << "every scene counted\n";
}
