"""Follows the planner's motions in the controller's place, with motors that are at once where they are to be: follow.py CONTROLLER_FILE."""

import signal
import sys

import pcc

if len(sys.argv) != 2:
    print(__doc__, file=sys.stderr)
    sys.exit(2)
follower = pcc.Follower(sys.argv[1])
for number in (signal.SIGINT, signal.SIGTERM):
    signal.signal(number, lambda *_: follower.shut_down())
for cycle in follower:
    follower.report(cycle.targets.position_m)
