#!/usr/bin/env python3
"""OMPL's planners on the cases of an evaluation, as an outside referee of the classical planners.

    scripts/ompl_referee.py DIR --out FILE.npz [--planner rrt-connect|rrt-star|bit-star] [--seconds 10] [--seed 0] [--robot config/robots/unit.toml]

DIR has paths.npz of `pcc evaluate`: its cases, and as many attempts a case as it has candidates, each towards the configuration that
the evaluation's path of this number ends in (none where it has none). RRT-Connect is followed by OMPL's path simplifier; RRT* and BIT* shorten the tip's path until their time is over.
Collisions are looked at by the geometry of check_motions.py.
Writes `paths [C,S,64,6]` (f64, rad; where no path was found the start alone) for `pcc evaluate --planner proposed --proposals FILE.npz`,
and `seconds [C,S]`. The last line is a JSON object.
"""

import argparse
import json
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from ompl import base, geometric, util

from check_motions import Robot, backbone

WAYPOINTS = 64
# Longest way between two states that are looked at, as a share of the space's extent.
RESOLUTION = 0.002
# Room beside the tubes that is tried in turn, as by this project's RRT-Connect, each for an equal part of the time, section lengths.
MARGINS = (0.04, 0.01, 0.0)
# Pieces in which the tip's path along an edge is measured.
PIECES = 4
CONNECT = "rrt-connect"
PLANNERS = {CONNECT: geometric.RRTConnect, "rrt-star": geometric.RRTstar, "bit-star": geometric.BITstar}


def clear_of(robot, centres, radii, margin):
    """Whether a state bends no section too far and comes no nearer to a ball than this margin."""

    def is_clear(state):
        shape = shape_of(state)
        if np.linalg.norm(shape.reshape(3, 2), axis=1).max() > robot.limit:
            return False
        points = backbone(robot, shape[None])[0]
        apart = np.linalg.norm(points[:, None] - centres[None], axis=2) - radii[None]
        return bool((apart > robot.tube + margin).all())

    return is_clear


def shape_of(state):
    return np.array([state[i] for i in range(6)])


class TipPathLength(base.OptimizationObjective):
    """The length of the tip's path."""

    def __init__(self, information, robot):
        super().__init__(information)
        self.robot = robot

    def stateCost(self, _):
        return base.Cost(0.0)

    def motionCost(self, begin, end):
        begin, end = shape_of(begin), shape_of(end)
        shapes = begin + np.linspace(0.0, 1.0, PIECES + 1)[:, None] * (end - begin)
        tips = backbone(self.robot, shapes, 1)[:, -1]
        return base.Cost(float(np.linalg.norm(np.diff(tips, axis=0), axis=1).sum()))


def state_of(space, shape):
    state = space.allocState()
    for i, value in enumerate(shape):
        state[i] = float(value)
    return state


def attempt(planner, robot, start, goal, centres, radii, seconds):
    """A planner's path [64, 6] with as much room as there is one with, or None."""
    for margin in MARGINS:
        is_clear = clear_of(robot, centres, radii, margin * robot.lengths[0])
        path = path_of(planner, robot, start, goal, is_clear, seconds / len(MARGINS))
        if path is not None:
            return path
    return None


def resampled(states):
    """Waypoints at equal lengths along states [n, 6]."""
    passed = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(states, axis=0), axis=1))])
    wanted = np.linspace(0.0, passed[-1], WAYPOINTS)
    return np.stack([np.interp(wanted, passed, states[:, axis]) for axis in range(6)], 1)


def path_of(planner, robot, start, goal, is_clear, seconds):
    """A planner's path [64, 6] with clear states, or None."""
    space = base.RealVectorStateSpace(6)
    bounds = base.RealVectorBounds(6)
    bounds.setLow(-robot.limit)
    bounds.setHigh(robot.limit)
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(is_clear)
    information = setup.getSpaceInformation()
    information.setStateValidityCheckingResolution(RESOLUTION)
    setup.setStartAndGoalStates(state_of(space, start), state_of(space, goal))
    if planner != CONNECT:
        setup.setOptimizationObjective(TipPathLength(information, robot))
    setup.setPlanner(PLANNERS[planner](information))
    setup.solve(seconds)
    if not setup.haveExactSolutionPath():
        return None
    if planner == CONNECT:
        setup.simplifySolution(seconds)
    path = setup.getSolutionPath()
    path.interpolate(WAYPOINTS)
    states = np.array([shape_of(state) for state in path.getStates()])
    # `interpolate` leaves a path of more states than that as it is.
    return states if len(states) == WAYPOINTS else resampled(states)


def answer(job):
    planner, robot, case, start, goals, centres, radii, seconds, seed = job
    util.noOutputHandler()
    util.RNG.setSeed(seed + case + 1)
    paths = np.broadcast_to(start, (len(goals), WAYPOINTS, 6)).copy()
    took, found = np.zeros(len(goals)), 0
    for number, goal in enumerate(goals):
        begun = time.perf_counter()
        path = attempt(planner, robot, start, goal, centres, radii, seconds) if np.isfinite(goal).all() else None
        took[number] = time.perf_counter() - begun
        if path is not None:
            paths[number] = path
            found += 1
    return paths, took, found


def jobs(planner, robot, file, seconds, seed):
    with np.load(file) as archive:
        arrays = {name: archive[name] for name in ("starts", "paths", "obstacle_centres", "obstacle_radii", "obstacle_offsets")}
    offsets = arrays["obstacle_offsets"]
    for case, start in enumerate(arrays["starts"].astype(float)):
        balls = slice(offsets[case], offsets[case + 1])
        centres = arrays["obstacle_centres"][balls].astype(float).reshape(-1, 3)
        radii = arrays["obstacle_radii"][balls].astype(float)
        yield planner, robot, case, start, arrays["paths"][case, :, -1].astype(float), centres, radii, seconds, seed


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--planner", choices=PLANNERS, default=CONNECT)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--robot", default="config/robots/unit.toml")
    arguments = parser.parse_args()
    file = arguments.folder / "paths.npz"
    asked = list(jobs(arguments.planner, Robot(arguments.robot), file, arguments.seconds, arguments.seed))
    paths, took, found = [], [], 0
    with ProcessPoolExecutor() as workers:
        for done, (path, seconds, count) in enumerate(workers.map(answer, asked), start=1):
            paths.append(path)
            took.append(seconds)
            found += count
            print(f"{done} of {len(asked)} cases, {found} paths", flush=True)
    np.savez(arguments.out, paths=np.array(paths), seconds=np.array(took))
    attempts = sum(np.isfinite(job[4]).all(axis=1).sum() for job in asked)
    print(json.dumps({"attempts": int(attempts), "found": found, "seconds_an_attempt": float(np.sum(took) / max(attempts, 1))}))


if __name__ == "__main__":
    main()
