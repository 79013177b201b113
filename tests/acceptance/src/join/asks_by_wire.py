"""Plans as a client that is set up for a robot, and says how that is answered and what the bytes of the knots that it received hash to, by
FNV-1a: asks_by_wire.py ROBOT_HASH, 16 hexadecimal digits."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[4] / "clients/plain-python"))

import iceoryx2 as iox2
from wire import Wire, reason

wire = Wire()
plan, answered, asked = (wire.service(name) for name in ("plan", "plan_answered", "plan_asked"))
listener, notifier = answered.listener_builder().create(), asked.notifier_builder().create()
client = plan.client_builder().create()
request = wire.new(
    "PlanRequest", request_id=1, candidate_count=10, goal_count=1, limits_scale=1.0, start=wire.code("StartKind", "Given"),
    robot_hash=int(sys.argv[1], 16),
)  # fmt: skip
request.goals[0].kind = wire.code("GoalKind", "Tip")
request.goals[0].tip_m[:] = [1.0, 0.5, 2.3]
pending = client.send_copy(request)
notifier.notify()
while (answer := pending.receive()) is None:
    if not pending.is_connected:
        sys.exit("the daemon has ended")
    listener.timed_wait(iox2.Duration.from_millis(20))
report = answer.user_header().contents
print(f"{wire.text('Outcome', report.outcome)}: {reason(report.reason)}")
knots = answer.payload()
ranges = [(it.first_knot, it.knot_count) for it in report.candidates[: report.candidate_count]]
received = b"".join(bytes(knots[first + index]) for first, count in ranges for index in range(count))
fnv1a = 0xCBF29CE484222325
for byte in received:
    fnv1a = (fnv1a ^ byte) * 0x100000001B3 % 2**64
print(f"{report.candidate_count} candidates {fnv1a:016x}")
