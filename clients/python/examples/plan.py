"""Has a motion to a tip planned and executed, and waits for its result: plan.py X Y Z, metres in the base frame."""

import sys

import pcc

if len(sys.argv) != 4:
    print(__doc__, file=sys.stderr)
    sys.exit(2)
client, results = pcc.Client(), pcc.Results()
answer = client.plan([float(axis) for axis in sys.argv[1:]], execute=True)
print(f"{answer.outcome}: {answer.reason}; hash {answer.plan_hash:016x}")
for candidate in answer:
    print(f"  {candidate.duration_s:.3f} s to {candidate.knots[-1, 1:7].round(4)} rad")
if answer.trajectory_id:
    outcome, reason = results.wait(answer.trajectory_id)
    print(f"trajectory {answer.trajectory_id}: {outcome} {reason}")
