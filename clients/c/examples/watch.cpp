// Shows what the controller does for some seconds: watch SECONDS.
#include <iostream>
#include <pcc/client.hpp>
#include <thread>

int main(int count, char **argument) {
  if (count != 2) return std::cerr << "usage: watch SECONDS\n", 2;
  pcc::ControllerView controller;
  for (int round = 0; round < 10 * std::stoi(argument[1]); round++) {
    if (auto state = controller.state())
      std::cout << pcc::text("LoopState", state->state) << ", trajectory " << state->trajectory_id << std::endl;
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
}
