#!/usr/bin/env python3
"""Times paths independently: by the package toppra and by linear programs, order by order.

    scripts/reference_timing.py PATHS.json

The file has `velocity` and `acceleration` (tendon limits), `tendons` (one row of 6 a tendon), `spacing` (rad) and `paths`,
each with `waypoints` (rows of 6, rad), and the grid `s` (rad) and speeds `speed` (rad/s) of the allocation under test.
The path is built here once more: natural cubic splines through the waypoints by chord length, longer chords divided.

Every line `WHAT PATH [INTERVALS]` on standard input is answered by one number:
    lp 3            the least duration, s, that linear programs find on the given grid (HiGHS)
    toppra 3        toppra's duration, s, on the given grid
    active 3        part of the time in which the given speeds use a limit fully
    duration 3 252  toppra's duration, s, on equal intervals
    seconds 3 252   wall time that toppra takes for it, s, the path's spline and projection not counted
    whole 3 252     the same with spline and projection, from the spline's nodes to the duration
    nodes 3         wall time, s, of making these nodes of the waypoints, in a loop of this script that is not toppra's
All three are medians of 20 in a row, after one that is not counted.
Needs scripts/requirements-timing.txt.
"""

import importlib.metadata
import json
import logging
import sys
import time

import numpy as np
import scipy
import toppra
import toppra.algorithm
import toppra.constraint
from scipy.optimize import linprog
from scipy.sparse import coo_matrix

MERGE = 1e-4
FULL_USE = 1 - 1e-6
# Linear programs after the first, and the part of the largest x below which time is not linearised: at rest it has no slope.
PROGRAMS = 6
REPETITIONS = 20
SLOWEST = 1e-6


def nodes(waypoints, spacing):
    """The spline's nodes: waypoints apart from each other, chords longer than `spacing` divided."""
    merge = MERGE * np.linalg.norm(waypoints - waypoints[0], axis=1).max()
    kept = []
    for point in waypoints:
        if not kept or np.linalg.norm(point - kept[-1]) > merge:
            kept.append(point)
    while len(kept) > 1 and np.linalg.norm(waypoints[-1] - kept[-1]) <= merge:
        kept.pop()
    kept.append(waypoints[-1])
    s, points = [0.0], [kept[0]]
    for start, end in zip(kept, kept[1:]):
        length = np.linalg.norm(end - start)
        parts = int(np.clip(np.ceil(length / spacing), 1, 1000))
        begin = s[-1]
        for part in range(1, parts + 1):
            s.append(begin + length * part / parts)
            points.append(start + (end - start) * part / parts)
    return np.array(s), np.array(points)


class Path:
    def __init__(self, path, tendons, limits, spacing):
        self.waypoints, self.spacing, self.tendons = np.array(path["waypoints"]), spacing, tendons
        self.nodes = nodes(self.waypoints, spacing)
        end = self.nodes[0][-1]
        self.grid, self.speed = np.array(path["s"]), np.array(path["speed"])
        if abs(self.grid[-1] - end) > 1e-9 * end:
            sys.exit(f"reference_timing: the path's length is {end}, its grid ends at {self.grid[-1]}")
        # toppra wants the very number.
        self.grid[-1] = end
        self.velocity, self.acceleration = limits
        self.project()

    def project(self):
        """The spline of tendon lengths through the nodes, and its constraints: what toppra needs before it solves."""
        s, points = self.nodes
        tendons = self.tendons
        self.curve = toppra.SplineInterpolator(s, points @ tendons.T, bc_type="natural")
        self.constraints = [
            toppra.constraint.JointVelocityConstraint(symmetric(self.velocity, len(tendons))),
            toppra.constraint.JointAccelerationConstraint(
                symmetric(self.acceleration, len(tendons)),
                discretization_scheme=toppra.constraint.DiscretizationType.Interpolation,
            ),
        ]

    def whole(self, grid):
        self.project()
        return self.toppra(grid)

    def toppra(self, grid):
        solver = toppra.algorithm.TOPPRA(self.constraints, self.curve, gridpoints=grid, solver_wrapper="seidel")
        return duration(grid, solver.compute_parameterization(0, 0)[1])

    def constraints_of_squares(self):
        """The limits of x = ṡ² on the given grid: matrix @ x ≤ 1 is acceleration at both ends of each interval, the bounds velocity."""
        slope, bend = self.curve(self.grid, 1), self.curve(self.grid, 2)
        half = 0.5 / np.diff(self.grid)
        i, tendon = np.meshgrid(np.arange(len(half)), np.arange(slope.shape[1]), indexing="ij")
        rows = np.arange(i.size).reshape(i.shape)
        start = [bend[i, tendon] - slope[i, tendon] * half[i], slope[i, tendon] * half[i]]
        end = [-slope[i + 1, tendon] * half[i], bend[i + 1, tendon] + slope[i + 1, tendon] * half[i]]
        entries = [(rows, i, start[0]), (rows, i + 1, start[1]), (rows + i.size, i, end[0]), (rows + i.size, i + 1, end[1])]
        row, column, value = (np.concatenate([entry[k].ravel() for entry in entries]) for k in range(3))
        one_sided = coo_matrix((value / self.acceleration, (row, column)))
        cap = (self.velocity / np.abs(slope).max(axis=1)) ** 2
        cap[[0, -1]] = 0
        return scipy.sparse.vstack([one_sided, -one_sided]).tocsr(), np.column_stack([np.zeros_like(cap), cap])

    def linear_programs(self):
        """The least time on the given grid by linear programs over x = ṡ², converged from above.

        The first maximises ∫ x ds. Time is convex in x, but not linear: where speed here costs speed there, the next programs
        minimise its linearisation at what is best so far, and a line search goes towards what they find.
        """
        matrix, bounds = self.constraints_of_squares()
        step = np.diff(self.grid)

        def largest(weight):
            return linprog(-weight / weight.mean(), A_ub=matrix, b_ub=np.ones(matrix.shape[0]), bounds=bounds, method="highs").x

        def taken(x):
            return duration(self.grid, np.sqrt(np.maximum(x, 0)))

        x = largest(0.5 * at_both_ends(step))
        for _ in range(PROGRAMS):
            speed = np.sqrt(np.maximum(x, SLOWEST * x.max()))
            towards = largest(at_both_ends(step / (speed[:-1] + speed[1:]) ** 2) / speed)
            x = min((x + part * (towards - x) for part in np.linspace(0, 1, 101)), key=taken)
        return taken(x)

    def active(self):
        slope, bend, square = self.curve(self.grid, 1), self.curve(self.grid, 2), self.speed**2
        pull = 0.5 * np.diff(square) / np.diff(self.grid)

        def use(points):
            speed = np.abs(slope[points]).max(axis=1) * self.speed[points] / self.velocity
            force = slope[points] * pull[:, None] + bend[points] * square[points, None]
            return np.maximum(speed, np.abs(force).max(axis=1) / self.acceleration)

        most = np.maximum(use(slice(None, -1)), use(slice(1, None)))
        times = 2 * np.diff(self.grid) / (self.speed[:-1] + self.speed[1:])
        return times[most > FULL_USE].sum() / times.sum()


def symmetric(limit, count):
    return np.array([[-limit, limit]] * count)


def at_both_ends(of_intervals):
    """At each grid point the sum of what the intervals beside it have."""
    return np.append(of_intervals, 0) + np.insert(of_intervals, 0, 0)


def duration(grid, speed):
    return (2 * np.diff(grid) / (speed[:-1] + speed[1:])).sum()


def seconds(work):
    work()
    times = []
    for _ in range(REPETITIONS):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return float(np.median(times))


def answer(paths, order):
    what, index, *rest = order.split()
    path = paths[int(index)]
    if what == "lp":
        return path.linear_programs()
    if what == "toppra":
        return path.toppra(path.grid)
    if what == "active":
        return path.active()
    if what == "nodes":
        return seconds(lambda: nodes(path.waypoints, path.spacing))
    grid = np.linspace(0, path.grid[-1], int(rest[0]) + 1)
    if what == "duration":
        return path.toppra(grid)
    if what == "seconds":
        return seconds(lambda: path.toppra(grid))
    if what == "whole":
        return seconds(lambda: path.whole(grid))
    sys.exit(f"reference_timing: {what}: lp, toppra, active, nodes, duration, seconds and whole are known")


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    logging.getLogger("toppra").setLevel(logging.ERROR)
    with open(sys.argv[1], encoding="utf-8") as file:
        data = json.load(file)
    tendons, limits = np.array(data["tendons"]), (data["velocity"], data["acceleration"])
    paths = [Path(path, tendons, limits, data["spacing"]) for path in data["paths"]]
    print(f"toppra {importlib.metadata.version('toppra')}, scipy {scipy.__version__}", flush=True)
    for order in sys.stdin:
        print(answer(paths, order), flush=True)


if __name__ == "__main__":
    main()
