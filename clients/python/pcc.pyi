"""The client of the planner, its controller and the robot. Lengths metres, angles radians, times seconds; base frame.

What is connected is used by the thread that made it; other threads run while a call waits, and Ctrl-C ends the wait. Calls raise ValueError for what is not allowed, with what is, and PccError else.
"""

from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

class PccError(Exception): ...

class Candidate:
    """One certified motion of an answer."""

    @property
    def duration_s(self) -> float: ...
    @property
    def tip_path_m(self) -> float: ...
    @property
    def clearance_m(self) -> float: ...
    @property
    def tip_error_m(self) -> float: ...
    @property
    def source(self) -> str: ...
    @property
    def knots(self) -> NDArray[np.float64]:
        """A row for each knot: time, configuration (6), velocity (6), acceleration (6). Read-only, in the daemon's own memory."""

class Answer:
    """An answer; its memory goes back to the daemon with the last reference to it, to a candidate, or to an array of knots."""

    @property
    def outcome(self) -> str: ...
    @property
    def is_ok(self) -> bool: ...
    @property
    def reason(self) -> str: ...
    @property
    def plan_id(self) -> int: ...
    @property
    def plan_hash(self) -> int: ...
    @property
    def trajectory_id(self) -> int | None: ...
    @property
    def selected(self) -> int | None: ...
    @property
    def stages_ns(self) -> list[int]: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: int) -> Candidate: ...
    def __iter__(self) -> Iterator[Candidate]: ...

class Client:
    """A connection to the planner daemon that outlives the daemon's restarts. With a robot file a daemon that plans for another robot refuses
    what it asks for (outcome "wrong robot")."""

    def __init__(self, prefix: str | None = None, root: str | None = None, robot_file: str | None = None) -> None: ...
    def plan(
        self,
        goal: Sequence[float],
        *,
        via: Sequence[Sequence[float]] = (),
        start: Sequence[float] | None = None,
        balls: Sequence[Sequence[float]] = (),
        candidates: int = 10,
        seed: int = 0,
        execute: bool = False,
        limits_scale: float = 1.0,
        deadline: float | None = None,
        timeout: float = 5.0,
    ) -> Answer:
        """Plans to a goal (3 numbers: a tip; 6: a configuration) from where the robot is, or from `start`."""

    def execute(self, plan_id: int, candidate: int | None = None, timeout: float = 5.0) -> Answer:
        """Has a candidate of an earlier plan executed exactly as it was answered."""

class Results:
    """How motions ended: those since it was made, and the last eight before."""

    def __init__(self, prefix: str | None = None, root: str | None = None) -> None: ...
    def wait(self, trajectory_id: int, timeout: float = 60.0) -> tuple[str, str] | None:
        """The outcome and its reason; None where the trajectory has not ended in time."""

class ControllerState(TypedDict):
    state: str
    fault: str
    waiting: str
    stamp_mono_ns: int
    trajectory_id: int
    trajectory_time_s: float
    speed: float
    rate: float
    tracking_error_rad: float
    commanded_configuration_rad: list[float]
    measured_configuration_rad: list[float]

class Controller:
    """The controller's state, and orders to it."""

    def __init__(self, prefix: str | None = None, root: str | None = None) -> None: ...
    def state(self) -> ControllerState | None: ...
    def command(self, order: str, speed: float | None = None, *, reason: str = "", timeout: float = 2.0) -> tuple[bool, str]:
        """Orders "stop", "reset", "pause", "resume", or "speed" with the speed to run at: whether it takes effect, and why."""

class Scene:
    """Publishes what one source knows of the obstacles; as a context it takes its leave at the end, but not where an error ends it: the robot then stops."""

    def __init__(self, source: str, prefix: str | None = None, root: str | None = None) -> None: ...
    def publish(self, balls: Sequence[Sequence[float]], lifetime: float) -> None:
        """All balls that the source knows of: x, y, z, radius, vx, vy, vz."""

    def confirm(self, timeout: float = 2.0) -> None: ...
    def leave(self) -> None: ...
    def __enter__(self) -> Scene: ...
    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None) -> None: ...

class Goal:
    """Gives the daemon a goal that stays, moves it, and hears what becomes of it."""

    def __init__(self, prefix: str | None = None, root: str | None = None, robot_file: str | None = None) -> None: ...
    def give(self, goal: Sequence[float], limits_scale: float = 1.0) -> None: ...
    def move_to(self, goal: Sequence[float], velocity: Sequence[float] = (0.0, 0.0, 0.0)) -> None: ...
    def withdraw(self) -> None: ...
    def status(self) -> tuple[str, str] | None: ...

class Targets:
    """What motors are to do in a cycle: 9 lengths of the tendons relative to the straight robot, their rates and accelerations."""

    @property
    def stamp_ns(self) -> int: ...
    @property
    def position_m(self) -> list[float]: ...
    @property
    def velocity_m_s(self) -> list[float]: ...
    @property
    def acceleration_m_s2(self) -> list[float]: ...

class Driver:
    """Drives the motors of a robot, in cycles of 1 ms; it has the robot's place. Iterated, it gives what they are to do in each cycle, until
    it was shut down and they rest. It is to be left at rest alone: have a signal's handler call `shut_down`, as Ctrl-C otherwise raises in motion."""

    def __init__(
        self, robot_file: str, position_m: Sequence[float] = (0.0,) * 9, prefix: str | None = None, root: str | None = None
    ) -> None: ...
    def __iter__(self) -> Driver: ...
    def __next__(self) -> Targets: ...
    def report(self, measured_m: Sequence[float], *, fault: bool = False) -> None:
        """What the motors did in this cycle: 9 measured lengths."""

    def shut_down(self) -> None:
        """Ramps the motors to rest; the iterator then ends."""

class Cycle:
    """One cycle of a follower: targets for the motors, and the configuration of the set-point, rad, rad/s, rad/s²."""

    targets: Targets
    configuration_rad: list[float]
    velocity_rad_s: list[float]
    acceleration_rad_s2: list[float]
    state: str
    trajectory_id: int

class Follower:
    """Follows the planner's trajectories in the controller's place, by a file like config/controller.toml. Iterated, it gives each cycle, until it
    was shut down and the robot is at rest; give it up at rest alone."""

    def __init__(
        self, config_file: str, position_m: Sequence[float] = (0.0,) * 9, prefix: str | None = None, root: str | None = None
    ) -> None: ...
    def __iter__(self) -> Follower: ...
    def __next__(self) -> Cycle: ...
    def report(self, measured_m: Sequence[float], *, fault: bool = False) -> None:
        """What the motors did in this cycle: 9 measured lengths."""
    def shut_down(self) -> None:
        """Stops the robot along its path; the iterator then ends."""
