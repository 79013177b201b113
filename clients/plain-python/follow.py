"""A controller in the place of ours, without a robot: follows each trajectory from rest to its end, until it is ended: follow.py."""

import os
import time

from wire import Wire, hermite, newest, take_role

wire = Wire()
lock = take_role(wire, "controller")
descriptions = wire.service("robot_description").subscriber_builder().create()
while (robot := newest(descriptions)) is None:
    time.sleep(0.05)
trajectories = wire.service("trajectory").subscriber_builder().create()
hearts, states, results = (wire.service(n).publisher_builder().create() for n in ("heartbeat", "controller_state", "motion_result"))
orders = wire.service("command").server_builder().create()
begun = time.monotonic_ns()
state = wire.new(
    "ControllerState", instance=begun, robot_hash=robot.robot_hash, state=wire.code("LoopState", "Holding"), rate=1.0,
    speed=1.0, wanted_from_mono_ns=begun, goals_from_mono_ns=begun, period_ns=5_000_000,
)  # fmt: skip
heart = wire.new("Heartbeat", instance=begun, kind=wire.code("ProcessKind", "Controller"), pid=os.getpid())
result = wire.new("MotionResult", instance=begun)
motion = None


def end(outcome, path_time_s):
    """Tells how the motion ended, and holds where the set-point is."""
    result.sequence, result.stamp_mono_ns, result.path_time_s = result.sequence + 1, time.monotonic_ns(), path_time_s
    result.trajectory_id, result.plan_id, result.outcome = motion.trajectory_id, motion.plan_id, wire.code("MotionOutcome", outcome)
    result.duration_s, state.state = motion.knots[motion.knot_count - 1].time_s, wire.code("LoopState", "Holding")
    results.send_copy(result)


while True:
    now = time.monotonic_ns()
    while (order := orders.receive()) is not None:
        stops = order.payload().contents.kind == wire.code("CommandKind", "Stop")
        if stops:
            state.wanted_from_mono_ns = now
        accepted = int(stops and motion is not None)
        order.send_copy(wire.new("CommandReply", command_id=order.payload().contents.command_id, accepted=accepted))
        if stops and motion:
            end("Stopped", state.trajectory_time_s)
            motion = None
    new = newest(trajectories)
    if new and motion is None and new.controller_instance == begun and new.requested_mono_ns > state.wanted_from_mono_ns:
        motion, state.trajectory_id = new, new.trajectory_id
    if motion and now >= motion.begin_mono_ns:
        knots, at_s = motion.knots[: motion.knot_count], (now - motion.begin_mono_ns) * 1e-9
        state.state, state.trajectory_time_s = wire.code("LoopState", "Executing"), min(at_s, knots[-1].time_s)
        position, velocity = hermite(knots, state.trajectory_time_s)
        state.commanded_configuration_rad[:], state.commanded_velocity_rad_s[:] = position, velocity
        if at_s >= knots[-1].time_s:
            end("Reached", knots[-1].time_s)
            motion = None
    state.stamp_mono_ns = heart.stamp_mono_ns = now
    state.cycle, heart.sequence = state.cycle + 1, heart.sequence + 1
    states.send_copy(state)
    hearts.send_copy(heart)
    time.sleep(0.005)
