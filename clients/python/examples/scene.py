"""Publishes a ball that moves, for some seconds, then takes its leave: scene.py X Y Z RADIUS VX VY VZ SECONDS, metres and m/s."""

import sys
import time

import pcc

if len(sys.argv) != 9:
    print(__doc__, file=sys.stderr)
    sys.exit(2)
x, y, z, radius, vx, vy, vz, seconds = (float(argument) for argument in sys.argv[1:])
begin = time.monotonic()
with pcc.Scene("python-example") as scene:
    while (elapsed := time.monotonic() - begin) < seconds:
        scene.publish([(x + vx * elapsed, y + vy * elapsed, z + vz * elapsed, radius, vx, vy, vz)], lifetime=0.2)
        time.sleep(0.03)
    scene.confirm()
print("every scene counted")
