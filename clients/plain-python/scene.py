"""Publishes a ball that moves, for some seconds, then takes its leave: scene.py X Y Z RADIUS VX VY VZ SECONDS, metres and m/s."""

import sys
import time

from wire import Wire, every, reason

SOURCE = b"plain-python"
LIFETIME_NS = 200_000_000

if len(sys.argv) != 9:
    print(__doc__, file=sys.stderr)
    sys.exit(2)
wire = Wire()
x, y, z, radius, *velocity, seconds = (float(argument) for argument in sys.argv[1:])
verdicts = wire.service("scene_status").subscriber_builder().create()
scenes = wire.service("scene").publisher_builder().create()


def scene(sequence, **fields):
    return wire.new("SceneMessage", source=SOURCE, sequence=sequence, lifetime_ns=LIFETIME_NS, **fields)


begun = now = time.monotonic_ns()
sequence, judged = 0, []
while now < begun + seconds * 1e9:
    sequence, elapsed_s = sequence + 1, (now - begun) * 1e-9
    message = scene(sequence, stamp_mono_ns=now, ball_count=1)
    ball = message.balls[0]
    ball.centre_m[:] = [at + speed * elapsed_s for at, speed in zip((x, y, z), velocity)]
    ball.velocity_m_s[:], ball.radius_m = velocity, radius
    scenes.send_copy(message)
    time.sleep(0.03)
    for verdict in every(verdicts):
        if bytes(verdict.source).rstrip(b"\0") == SOURCE:
            judged.append(verdict.refusal)
            print(f"scene {verdict.sequence}: {wire.text('SceneRefusal', verdict.refusal)} {reason(verdict.reason)}")
    now = time.monotonic_ns()
# Without it nothing is executed any more; an error above must not say that the obstacles are gone.
scenes.send_copy(scene(sequence + 1, stamp_mono_ns=time.monotonic_ns(), takes_leave=1))
time.sleep(0.1)
counted = judged and all(refusal == wire.code("SceneRefusal", "None") for refusal in judged)
print("every scene counted" if counted else "a scene does not count, or no daemon judges scenes")
