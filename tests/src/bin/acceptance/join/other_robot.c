/* Plans as a client that is set up for a robot file, and says how that is answered: other_robot ROBOT_FILE. */
#include <pcc/client.h>
#include <stdio.h>

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
}
