"""Shows what the controller does, and how each motion ends: watch.py [SECONDS]."""

import sys
import time

from wire import Wire, every, newest, reason

wire = Wire()
states = wire.service("controller_state").subscriber_builder().create()
results = wire.service("motion_result").subscriber_builder().create()
end = time.monotonic() + float(sys.argv[1] if len(sys.argv) > 1 else "inf")
while time.monotonic() < end:
    if state := newest(states):
        configuration = [round(angle, 3) for angle in state.measured_configuration_rad]
        print(f"{wire.text('LoopState', state.state)}, trajectory {state.trajectory_id}, measured {configuration} rad")
    for result in every(results):
        print(f"trajectory {result.trajectory_id}: {wire.text('MotionOutcome', result.outcome)} {reason(result.reason)}")
    time.sleep(0.1)
