"""Shows what the controller does for some seconds: watch.py SECONDS."""

import sys
import time

import pcc

controller, end = pcc.Controller(), time.monotonic() + float(sys.argv[1])
while time.monotonic() < end:
    if state := controller.state():
        print(f"{state['state']}, trajectory {state['trajectory_id']} at {state['trajectory_time_s']:.3f} s", flush=True)
    time.sleep(0.1)
