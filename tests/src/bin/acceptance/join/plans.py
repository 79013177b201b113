"""Asks for plans as standard input says, and answers each line: plans.py X Y Z, metres in the base frame."""

import gc
import statistics
import sys
import time

import numpy as np
import pcc

tip = [float(axis) for axis in sys.argv[1:4]]
client = pcc.Client()


def plan(of=client):
    answer = of.plan(tip, start=[0.0] * 6)
    assert len(answer) > 0, answer.reason
    return answer


def plans(count):
    """Median round trip, ms."""
    times = []
    for _ in range(int(count)):
        begun = time.perf_counter()
        plan()
        times.append(time.perf_counter() - begun)
    return 1e3 * statistics.median(times)


def paced(count, rate):
    """Plans so many at a rate, and reads every candidate's knots in the daemon's memory: plans, views, and seconds that it took."""
    begun, planned, views, farthest = time.perf_counter(), 0, 0, 0.0
    for index in range(int(count)):
        time.sleep(max(0.0, begun + index / float(rate) - time.perf_counter()))
        answer = plan()
        knots = [candidate.knots for candidate in answer]
        farthest = max(farthest, *(float(view[:, 1:7].max()) for view in knots))
        planned, views = planned + 1, views + len(knots)
    assert 0.0 < farthest < 7.0, farthest
    return f"{planned} {views} {time.perf_counter() - begun:.3f}"


def views():
    other = pcc.Client()
    view = plan(other)[0].knots
    before = np.array(view)
    del other
    gc.collect()
    for _ in range(100):
        plan()
    return "the same numbers after 100 more plans" if np.array_equal(view, before) else "other numbers"


for line in sys.stdin:
    name, *arguments = line.split()
    print({"plans": plans, "paced": paced, "views": views}[name](*arguments), flush=True)
