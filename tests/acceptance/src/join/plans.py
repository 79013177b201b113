"""Asks for plans as standard input says, and answers each line: plans.py X Y Z, metres in the base frame."""

import gc
import statistics
import sys
import time

import numpy as np
import pcc

tip = [float(axis) for axis in sys.argv[1:4]]
client = pcc.Client()


def plan(of=client, to=tip, deadline=None):
    answer = of.plan(to, start=[0.0] * 6, deadline=deadline)
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
        # A machine that is busy for a moment cuts no plan short.
        answer = plan(deadline=1.0)
        knots = [candidate.knots for candidate in answer]
        farthest = max(farthest, *(float(view[:, 1:7].max()) for view in knots))
        planned, views = planned + 1, views + len(knots)
    assert 0.0 < farthest < 7.0, farthest
    return f"{planned} {views} {time.perf_counter() - begun:.3f}"


def view():
    """Keeps the knots of an answer that is gone with its client, and a copy of them."""
    global kept, copied
    other = pcc.Client()
    kept = plan(other)[0].knots
    copied = np.array(kept)
    del other
    gc.collect()
    return f"a copy: {kept.flags.owndata}, writeable: {kept.flags.writeable}"


def others(count):
    """Plans so many to another tip."""
    other_tip = [tip[0], -tip[1], tip[2]]
    knots = [np.array(plan(to=other_tip)[0].knots) for _ in range(int(count))]
    return f"{sum(not np.array_equal(copied, other) for other in knots)} plans with other knots"


def same():
    return "the same numbers" if np.array_equal(kept, copied) else "other numbers"


commands = {"plans": plans, "paced": paced, "view": view, "others": others, "same": same}
for line in sys.stdin:
    name, *arguments = line.split()
    print(commands[name](*arguments), flush=True)
