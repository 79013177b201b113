"""A robot whose motors follow at once: takes the set-points and says what it does, until it is ended: drive.py."""

import fcntl
import os
import time

from wire import Wire, newest

PERIOD_S = 0.001
LOST_NS = 20_000_000

wire = Wire()
lock = open(f"{wire.root}/{wire.prefix}.robot.lock", "a+")
fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
lock.truncate(0)
lock.write(f"{os.getpid()}\n")
lock.flush()
setpoints = wire.service("setpoint").subscriber_builder().create()
states = wire.service("robot_state").publisher_builder().create()
hearts = wire.service("heartbeat").publisher_builder().create()
heart = wire.new("Heartbeat", instance=time.monotonic_ns(), kind=wire.code("ProcessKind", "Robot"), pid=os.getpid())
state = wire.new("RobotState", state=wire.code("MotorState", "Idle"))
wanted, tendons = None, wire.new("Setpoint").position_m
while True:
    wanted = newest(setpoints) or wanted
    now = time.monotonic_ns()
    if wanted and now - wanted.stamp_mono_ns < LOST_NS:
        state.state, state.accepted_sequence = wire.code("MotorState", "Following"), wanted.sequence
        state.accepted_setpoint_m, state.accepted_velocity_m_s = wanted.position_m, wanted.velocity_m_s
    elif wanted:
        # No motor ramps here: it rests at once where it is.
        state.state, wanted = wire.code("MotorState", "AtRestAfterLoss"), None
        state.accepted_velocity_m_s[:] = [0.0] * 9
        state.ramps_to_rest += 1
    state.sequence, state.stamp_mono_ns = state.sequence + 1, now
    state.measured_tendon_m = state.accepted_setpoint_m
    state.measured_configuration_rad = wire.configuration(state.measured_tendon_m)
    states.send_copy(state)
    if state.sequence % 10 == 0:
        heart.sequence, heart.stamp_mono_ns = heart.sequence + 1, now
        hearts.send_copy(heart)
    time.sleep(PERIOD_S)
