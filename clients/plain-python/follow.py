"""A controller in the place of ours, without a robot: follows each trajectory from rest to its end, until it is ended: follow.py."""

import os
import time

import numpy as np

from wire import Wire, every, first, take_role

# From position, velocity and acceleration at both ends of a piece of unit duration to the coefficients of its polynomial.
QUINTIC = np.linalg.inv([[1, 0, 0, 0, 0, 0], [0, 1, 0, 0, 0, 0], [0, 0, 2, 0, 0, 0], [1] * 6, [0, 1, 2, 3, 4, 5], [0, 0, 2, 6, 12, 20]])

wire = Wire()
lock = take_role(wire, "controller")
descriptions, trajectories, beats = (wire.service(n).subscriber_builder().create() for n in ("robot_description", "trajectory", "heartbeat"))
hearts, states, results = (wire.service(n).publisher_builder().create() for n in ("heartbeat", "controller_state", "motion_result"))
orders = wire.service("command").server_builder().create()
robot = first(descriptions)
begun = time.monotonic_ns()
state = wire.new(
    "ControllerState", instance=begun, robot_hash=robot.robot_hash, state=wire.code("LoopState", "Holding"), rate=1.0,
    speed=1.0, wanted_from_mono_ns=begun, goals_from_mono_ns=begun, period_ns=5_000_000, daemon_instance=robot.instance,
)  # fmt: skip
heart = wire.new("Heartbeat", instance=begun, kind=wire.code("ProcessKind", "Controller"), pid=os.getpid())
result, motion, heard_ns = wire.new("MotionResult", instance=begun), None, begun


def hermite(knots, time_s):
    """Position and velocity of a motion at a time: quintic Hermite between its knots [s, rad, rad/s, rad/s²]."""
    index = next((i for i in range(1, len(knots) - 1) if knots[i].time_s > time_s), len(knots) - 1)
    a, b = knots[index - 1], knots[index]
    span = b.time_s - a.time_s
    powers = ((time_s - a.time_s) / span) ** np.arange(6)
    ends = [(knot.configuration_rad, knot.velocity_rad_s, knot.acceleration_rad_s2) for knot in (a, b)]
    polynomial = QUINTIC @ (np.reshape(ends, (6, 6)) * span ** np.array([[0], [1], [2], [0], [1], [2]]))
    return powers @ polynomial, np.arange(1, 6) * powers[:5] @ polynomial[1:] / span


def tell(of, outcome, path_time_s=0.0, **why):
    """Tells how a trajectory ended; the robot rests where the set-point is."""
    told = wire.new("MotionResult", instance=begun, sequence=result.sequence + 1, stamp_mono_ns=time.monotonic_ns(), **why)
    result.sequence, told.trajectory_id, told.plan_id = told.sequence, of.trajectory_id, of.plan_id
    told.outcome, told.path_time_s, told.duration_s = wire.code("MotionOutcome", outcome), path_time_s, of.knots[of.knot_count - 1].time_s
    results.send_copy(told)


while True:
    now, stops = time.monotonic_ns(), False
    heard_ns = max([heard_ns, *(beat.stamp_mono_ns for beat in every(beats) if beat.instance == robot.instance)])
    while (order := orders.receive()) is not None:
        stops |= (is_stop := order.payload().contents.kind == wire.code("CommandKind", "Stop"))
        refusal = "None" if is_stop and motion is not None else "NothingToDo"
        reply = {"state": state.state, "accepted": int(refusal == "None"), "refusal": wire.code("CommandRefusal", refusal)}
        order.send_copy(wire.new("CommandReply", command_id=order.payload().contents.command_id, **reply))
    state.wanted_from_mono_ns = state.goals_from_mono_ns = now if stops else state.wanted_from_mono_ns
    for new in every(trajectories):
        wrong = {"OtherController": new.controller_instance != begun, "OtherDaemon": new.daemon_instance != robot.instance, "Busy": bool(motion),
            "OtherRobot": new.robot_hash != robot.robot_hash, "RequestedBefore": new.requested_mono_ns <= state.wanted_from_mono_ns,
            "StartsElsewhere": new.start or not np.allclose(new.knots[0].configuration_rad, state.commanded_configuration_rad, 0, 1e-6)}  # fmt: skip
        if refusals := [name for name, is_wrong in wrong.items() if is_wrong]:
            state.refused_trajectory_id, state.refusal = new.trajectory_id, wire.code("Refusal", refusals[0])
            tell(new, "Refused", refusal=state.refusal)
        else:
            motion, state.trajectory_id, state.trajectory_time_s = new, new.trajectory_id, 0.0
    if motion and (stops or now - heard_ns > 200_000_000):
        tell(motion, "Stopped", state.trajectory_time_s, cause=wire.code("StopCause", "Command" if stops else "DaemonLost"))
        motion, state.state = None, wire.code("LoopState", "Holding")
    if motion and now >= motion.begin_mono_ns:
        knots, state.state = motion.knots[: motion.knot_count], wire.code("LoopState", "Executing")
        state.trajectory_time_s = min((now - motion.begin_mono_ns) * 1e-9, knots[-1].time_s)
        state.commanded_configuration_rad[:], velocity = hermite(knots, state.trajectory_time_s)
        if state.trajectory_time_s == knots[-1].time_s:
            tell(motion, "Reached", state.trajectory_time_s)
            motion, state.state = None, wire.code("LoopState", "Holding")
    state.commanded_velocity_rad_s[:] = velocity if motion and state.trajectory_time_s > 0.0 else [0.0] * 6
    state.stamp_mono_ns, heart.stamp_mono_ns, state.cycle, heart.sequence = now, now, state.cycle + 1, heart.sequence + 1
    states.send_copy(state)
    hearts.send_copy(heart)
    time.sleep(0.005)
