// Plans as a client that is set up for a robot file, and says how that is answered and what the bytes of the knots that it received hash
// to, by FNV-1a: asks ROBOT_FILE.
#include <cstddef>
#include <iomanip>
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
  std::uint64_t hash = 0xcbf29ce484222325;
  for (std::uint32_t i = 0; i < answer.candidates().size(); ++i)
    for (std::byte byte : std::as_bytes(answer.knots(i))) hash = (hash ^ std::to_integer<std::uint64_t>(byte)) * 0x100000001b3;
  std::cout << answer.candidates().size() << " candidates " << std::hex << std::setfill('0') << std::setw(16) << hash << '\n';
}
