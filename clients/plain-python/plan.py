"""Has a motion to a tip planned and executed, and waits for its result: plan.py X Y Z, metres in the base frame."""

import sys
import time

import iceoryx2 as iox2

from wire import Wire, every, reason

if len(sys.argv) != 4:
    print(__doc__, file=sys.stderr)
    sys.exit(2)
wire = Wire()
plan, answered, asked = (wire.service(name) for name in ("plan", "plan_answered", "plan_asked"))
results = wire.service("motion_result").subscriber_builder().create()
listener, notifier = answered.listener_builder().create(), asked.notifier_builder().create()
client = plan.client_builder().create()

request = wire.new(
    "PlanRequest", request_id=1, candidate_count=10, goal_count=1, limits_scale=1.0,
    start=wire.code("StartKind", "Robot"), execute=wire.code("Execute", "Selected"), requested_mono_ns=time.monotonic_ns(),
)  # fmt: skip
request.goals[0].kind = wire.code("GoalKind", "Tip")
request.goals[0].tip_m[:] = [float(argument) for argument in sys.argv[1:]]
pending = client.send_copy(request)
if pending.number_of_server_connections == 0:
    sys.exit("no daemon serves")
notifier.notify()
while (answer := pending.receive()) is None:
    if not pending.is_connected:
        sys.exit("the daemon has ended")
    listener.timed_wait(iox2.Duration.from_millis(20))

report, knots = answer.user_header().contents, answer.payload()
print(f"{wire.text('Outcome', report.outcome)}: {reason(report.reason)}; hash {report.plan_hash:016x}")
for candidate in report.candidates[: report.candidate_count]:
    end = knots[candidate.first_knot + candidate.knot_count - 1]
    print(f"  {end.time_s:.3f} s to {[round(angle, 4) for angle in end.configuration_rad]} rad")
identity = report.trajectory_id
answer.delete()
until = time.monotonic() + 60.0
while identity and time.monotonic() < until:
    for result in every(results):
        if result.trajectory_id == identity:
            print(f"trajectory {identity}: {wire.text('MotionOutcome', result.outcome)} {reason(result.reason)}")
            sys.exit(0)
    time.sleep(0.005)
sys.exit("no result came within a minute" if identity else "nothing is executed")
