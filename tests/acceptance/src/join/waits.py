"""Waits for what does not come, and says for each wait how often another thread counted meanwhile, and when Ctrl-C ended it, s: waits.py X Y Z."""

import os
import signal
import sys
import threading
import time

import pcc

WAIT_S, INTERRUPT_S, LIMIT_S = 1.0, 0.3, 20.0

# A shell has what it starts in the background ignore Ctrl-C.
signal.signal(signal.SIGINT, signal.default_int_handler)

tip = [float(axis) for axis in sys.argv[1:4]]
client, results, controller, scene = pcc.Client(), pcc.Results(), pcc.Controller(), pcc.Scene("waits")
scene.publish([], lifetime=60.0)
waits = {
    "plan": lambda timeout: client.plan(tip, start=[0.0] * 6, timeout=timeout),
    "execute": lambda timeout: client.execute(1, timeout=timeout),
    "result": lambda timeout: results.wait(1, timeout),
    "order": lambda timeout: controller.command("stop", timeout=timeout),
    "scene": lambda timeout: scene.confirm(timeout),
}


def counted(wait):
    """How often another thread counted, once a millisecond at most, while this one waited in vain."""
    count, ends = 0, threading.Event()

    def run():
        nonlocal count
        while not ends.wait(0.001):
            count += 1

    thread = threading.Thread(target=run)
    thread.start()
    try:
        assert wait(WAIT_S) is None
    except pcc.PccError:
        pass
    ends.set()
    thread.join()
    return count


def interrupted(wait):
    """How long a wait lasted that Ctrl-C ended."""
    begun = time.monotonic()
    threading.Timer(INTERRUPT_S, os.kill, (os.getpid(), signal.SIGINT)).start()
    try:
        wait(LIMIT_S)
    except KeyboardInterrupt:
        return time.monotonic() - begun
    return float("inf")


for name, wait in waits.items():
    print(f"{name} {counted(wait)} {interrupted(wait):.3f}", flush=True)
