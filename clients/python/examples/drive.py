"""A robot whose motors are at once where they are to be: drive.py ROBOT_FILE."""

import signal
import sys

import pcc

if len(sys.argv) != 2:
    print(__doc__, file=sys.stderr)
    sys.exit(2)
driver = pcc.Driver(sys.argv[1])
for number in (signal.SIGINT, signal.SIGTERM):
    signal.signal(number, lambda *_: driver.shut_down())
for targets in driver:
    driver.report(targets.position_m)
