"""Shows what the controller does for some seconds: watch.py SECONDS."""

import sys
import time

import pcc

if len(sys.argv) != 2:
    print(__doc__, file=sys.stderr)
    sys.exit(2)
controller, end = pcc.Controller(), time.monotonic() + float(sys.argv[1])
while time.monotonic() < end:
    if state := controller.state():
        print(f"{state['state']}, trajectory {state['trajectory_id']} at {state['trajectory_time_s']:.3f} s", flush=True)
    time.sleep(0.1)
