/* Plans as a client that is set up for a robot file, and says how that is answered and what the bytes of the knots that it received hash
   to, by FNV-1a: asks ROBOT_FILE. */
#include <inttypes.h>
#include <pcc/client.h>
#include <stdio.h>

static uint64_t fnv1a(uint64_t hash, const void *bytes, size_t count) {
  for (const uint8_t *byte = bytes; count > 0; --count) hash = (hash ^ *byte++) * UINT64_C(0x100000001b3);
  return hash;
}

int main(int count, char **argument) {
  if (count != 2) return 2;
  PccClient *client = pcc_client_connect(NULL, NULL);
  if (!client || pcc_client_state_robot(client, argument[1]) != 0) return fprintf(stderr, "%s\n", pcc_last_error()), 1;
  PccPlanRequest request = pcc_plan_request();
  request.start = PCC_START_KIND_GIVEN;
  request.goal_count = 1;
  request.goals[0] = (PccGoal){.kind = PCC_GOAL_KIND_TIP, .tip_m = {1.0, 0.5, 2.3}};
  PccAnswer *answer = pcc_plan(client, &request, 5.0);
  if (!answer) return fprintf(stderr, "%s\n", pcc_last_error()), 1;
  const PccPlanReport *report = pcc_answer_report(answer);
  printf("%s: %.*s\n", pcc_text("Outcome", report->outcome), (int)report->reason.length, report->reason.utf8);
  uint64_t hash = UINT64_C(0xcbf29ce484222325);
  for (uint32_t i = 0; i < report->candidate_count; ++i) {
    size_t knots = 0;
    const PccKnot *first = pcc_answer_knots(answer, i, &knots);
    hash = fnv1a(hash, first, knots * sizeof *first);
  }
  printf("%" PRIu32 " candidates %016" PRIx64 "\n", report->candidate_count, hash);
}
