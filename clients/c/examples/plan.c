/* Has a motion to a tip planned and executed, and waits for its result: plan X Y Z, metres in the base frame. */
#include <pcc/client.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

int main(int count, char **argument) {
  if (count != 4) return fprintf(stderr, "usage: plan X Y Z, metres in the base frame\n"), 2;
  PccClient *client = pcc_client_connect(NULL, NULL);
  PccResults *results = pcc_results_connect(NULL, NULL);
  PccPlanRequest request = pcc_plan_request();
  request.execute = PCC_EXECUTE_SELECTED;
  request.goal_count = 1;
  request.goals[0] = (PccGoal){.kind = PCC_GOAL_KIND_TIP, .tip_m = {atof(argument[1]), atof(argument[2]), atof(argument[3])}};
  PccAnswer *answer = pcc_plan(client, &request, 5.0);
  if (!answer) return fprintf(stderr, "%s\n", pcc_last_error()), 1;
  const PccPlanReport *report = pcc_answer_report(answer);
  printf("%s: %.*s; hash %016" PRIx64 "\n", pcc_text("Outcome", report->outcome), (int)report->reason.length, report->reason.utf8, report->plan_hash);
  PccMotionResult result;
  if (!report->trajectory_id || pcc_results_wait(results, report->trajectory_id, 60.0, &result) != 1) return fprintf(stderr, "no result\n"), 1;
  printf("trajectory %u: %s\n", result.trajectory_id, pcc_text("MotionOutcome", result.outcome));
}
