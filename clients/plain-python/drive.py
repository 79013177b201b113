"""A robot whose motors follow at once: takes the set-points and says what it does, until it is ended: drive.py."""

import os
import time

import numpy as np

from wire import Wire, first, newest, take_role

PERIOD_S = 0.001
LOST_NS = 20_000_000

wire = Wire()
lock = take_role(wire, "robot")
descriptions = wire.service("robot_description").subscriber_builder().create()
setpoints = wire.service("setpoint").subscriber_builder().create()
states = wire.service("robot_state").publisher_builder().create()
hearts = wire.service("heartbeat").publisher_builder().create()
robot = first(descriptions)
from_tendons = np.linalg.pinv(np.reshape(robot.tendon_matrix_m_rad, (9, 6))[: robot.tendon_count])
heart = wire.new("Heartbeat", instance=time.monotonic_ns(), kind=wire.code("ProcessKind", "Robot"), pid=os.getpid())
state = wire.new("RobotState", robot_hash=robot.robot_hash, state=wire.code("MotorState", "Idle"))
wanted = None
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
    state.measured_configuration_rad[:] = from_tendons @ state.measured_tendon_m[: robot.tendon_count]
    states.send_copy(state)
    if state.sequence % 10 == 0:
        heart.sequence, heart.stamp_mono_ns = heart.sequence + 1, now
        hearts.send_copy(heart)
    time.sleep(PERIOD_S)
