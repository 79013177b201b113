// Plans as a client that is set up for a robot file, and says how that is answered: other_robot ROBOT_FILE.
#include <iostream>
#include <pcc/client.hpp>

int main(int count, char **argument) {
  if (count != 2) return 2;
  pcc::Client client;
  client.state_robot(argument[1]);
  PccPlanRequest request = pcc::request(pcc::tip(1.0, 0.5, 2.3));
  request.start = PCC_START_KIND_GIVEN;
  pcc::Answer answer = client.plan(request, 5.0);
  std::cout << pcc::text("Outcome", answer.report().outcome) << ": " << pcc::text(answer.report().reason) << '\n';
}
