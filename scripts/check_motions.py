#!/usr/bin/env python3
"""Judges every certified motion of `pcc evaluate` by dense sampling: geometry and time law of its own, numpy alone.

    scripts/check_motions.py DIR [DIR ..] --dataset DATA [--records RECORDS] [--tips TIPS] [--robot config/robots/unit.toml]

DIR has paths.npz; starts, targets and balls are those of the cases of the data set's split `test`. Knots are joined by quintic Hermite polynomials; each piece is looked at in equal steps of time, the body at equal
steps of each arc. A motion is contradicted where a sampled point is in a ball (a sampled clearance is never less than the true
one), its start or its tip is elsewhere, a section bends farther than the limit and than at the start, or a tendon exceeds a limit. The first, middle and last motion of each folder are
judged once more in copies that are damaged in one way each, in each of which that must be found. RECORDS are those that `pcc compare` keeps of
the same planner and cases: certified motions that last as long as theirs are counted. To TIPS goes a JSON list with an
entry for each case of all folders: the medians over its certified motions of tip length ÷ distance and of tip smoothness (m²), or null. Prints a line a folder and one JSON object at the end; exit
status 1 where a motion is contradicted or a damaged copy is not.
"""

import argparse
import itertools
import json
import math
import sys
import tomllib
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

STEPS_OF_A_PIECE = 16
POINTS_OF_A_SECTION = 24
POINTS_OF_A_TIP_PATH = 64
TIP_TOLERANCE = 0.01
START_TOLERANCE_RAD = 1e-6
BENDING_SLACK_RAD = 1e-6
LIMIT_SLACK = 1e-6
ROUNDING = 1e-9
# By how much a copy bends too far, rad, and how many times as slow it is, so that it keeps all limits.
BENT, SLOWER = 1e-3, 1e3
# By how much a ball of what radius is grazed in a copy, m.
GRAZED, GRAZING_RADIUS = 2e-3, 0.2
# Durations of the same motion differ by no more, s.
SAME_DURATION = 1e-9
# The code of the split `test` in a data set's `split_indices`.
TEST_SPLIT = 2


class Robot:
    """Section lengths, tube radius, bending limit, and what the tendons do, from the robot file."""

    def __init__(self, file):
        content = tomllib.loads(Path(file).read_text())
        self.lengths = np.array(content["section_lengths_m"])
        self.tube = content["tube_radius_m"]
        self.limit = content["bending_limit_rad"]
        limits = content["tendon_limits"]
        self.tendon_limits = [limits[name] for name in ("velocity_m_s", "acceleration_m_s2", "jerk_m_s3")]
        rows = []
        for tendon in content["tendons"]:
            angle = math.radians(tendon["angle_deg"])
            pair = [tendon["radius_m"] * math.sin(angle), -tendon["radius_m"] * math.cos(angle)]
            rows.append(pair * tendon["section"] + [0.0, 0.0] * (3 - tendon["section"]))
        self.tendons = np.array(rows)


def hermite(knots, times, step):
    """Position, velocity, acceleration and jerk at fractions of each piece: [pieces, fractions, 4, 6].

    The six coefficients of a piece solve the six conditions at its two ends, in its own time from 0 to 1, as a way from its first position: in half
    a millisecond of whole positions rounding would be a millionth of a limit of jerk.
    """
    spans = np.diff(times)[:, None]
    origin = np.zeros_like(knots[:-1])
    origin[:, 0] = knots[:-1, 0]
    begin, end = knots[:-1] - origin, knots[1:] - origin
    scaled = [spans**order for order in range(3)]
    right = np.concatenate([np.stack([side[:, order] * scaled[order] for order in range(3)], 1) for side in (begin, end)], 1)
    powers = np.arange(6)

    def row(u, order):
        factor = np.array([math.perm(int(p), order) if p >= order else 0 for p in powers], float)
        return factor * np.where(powers >= order, u ** np.maximum(powers - order, 0), 0.0)

    left = np.array([row(0.0, 0), row(0.0, 1), row(0.0, 2), row(1.0, 0), row(1.0, 1), row(1.0, 2)])
    coefficients = np.linalg.solve(left, right)
    looks = np.array([[row(u, order) for order in range(4)] for u in step])
    values = np.einsum("uok,pkd->puod", looks, coefficients)
    values = values / (spans[:, None, None, :] ** np.arange(4)[None, None, :, None])
    values[:, :, 0] += origin[:, None, 0]
    return values


def rotations(axes):
    """Rotations by vectors [.., 3] along their axis (Rodrigues)."""
    angle = np.linalg.norm(axes, axis=-1)[..., None, None]
    unit = axes / np.maximum(np.linalg.norm(axes, axis=-1, keepdims=True), 1e-300)
    cross = np.zeros(axes.shape[:-1] + (3, 3))
    cross[..., 0, 1], cross[..., 0, 2], cross[..., 1, 2] = -unit[..., 2], unit[..., 1], -unit[..., 0]
    cross[..., 1, 0], cross[..., 2, 0], cross[..., 2, 1] = unit[..., 2], -unit[..., 1], unit[..., 0]
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)


def backbone(robot, shapes, points_of_a_section=POINTS_OF_A_SECTION):
    """Points of the backbone of each configuration [n, 6]: [n, 3 * points_of_a_section, 3]."""
    parts = np.arange(1, points_of_a_section + 1) / points_of_a_section
    base, turn, points = np.zeros((len(shapes), 3)), np.broadcast_to(np.eye(3), (len(shapes), 3, 3)), []
    for section in range(3):
        bend = shapes[:, 2 * section : 2 * section + 2]
        angle = np.linalg.norm(bend, axis=1)[:, None]
        axis = bend / np.maximum(angle, 1e-300)
        theta = angle * parts
        safe = np.maximum(theta, 1e-12)
        reach = robot.lengths[section] * parts
        along = reach * np.where(theta > 1e-7, np.sin(safe) / safe, 1.0)
        beside = reach * np.where(theta > 1e-7, 2 * np.sin(safe / 2) ** 2 / safe, theta / 2)
        local = np.stack([axis[:, 1:] * beside, -axis[:, :1] * beside, along], axis=-1)
        points.append(base[:, None] + np.einsum("nij,nkj->nki", turn, local))
        base = points[-1][:, -1]
        turn = turn @ rotations(np.concatenate([bend, np.zeros((len(bend), 1))], axis=1))
    return np.concatenate(points, axis=1)


def bending(shapes):
    """How far the most bent section of configurations [.., 6] bends, rad."""
    return np.linalg.norm(shapes.reshape(-1, 2), axis=1).max()


def faults(robot, times, knots, start, target, centres, radii):
    """What contradicts a certified motion: a list of texts."""
    step = np.arange(STEPS_OF_A_PIECE + 1) / STEPS_OF_A_PIECE
    values = hermite(knots, times, step)
    shapes = values[:, :, 0].reshape(-1, 6)
    points = backbone(robot, shapes)
    found = []
    if np.abs(knots[0, 0] - start).max() > START_TOLERANCE_RAD:
        found.append("begins elsewhere")
    miss = np.linalg.norm(points[-1, -1] - target)
    if not miss <= TIP_TOLERANCE:
        found.append(f"tip {miss:.4f} from the target")
    bent, allowed = bending(shapes), max(robot.limit, bending(start))
    if not bent <= allowed + BENDING_SLACK_RAD:
        found.append(f"bends by {bent:.6f} rad, not {allowed:.6f}")
    rest = np.abs(knots[[0, -1], 1:]).max()
    if rest > ROUNDING:
        found.append("is not at rest at its ends")
    for order, limit in enumerate(robot.tendon_limits, start=1):
        most = np.abs(values[:, :, order] @ robot.tendons.T).max() / limit
        if not most <= 1 + LIMIT_SLACK:
            found.append(f"derivative {order} of a tendon is {most:.6f} of its limit")
    flat = points.reshape(-1, 3)
    for centre, radius in zip(centres, radii):
        clearance = np.sqrt(((flat - centre) ** 2).sum(1).min()) - radius - robot.tube
        if not clearance >= -ROUNDING:
            found.append(f"{-clearance:.6f} inside a ball")
    return found


def damaged(robot, motion, start, target, centres, radii):
    """Copies of a motion and its case that are wrong in one way each, by a word of what is to be found: the arguments of `faults`."""
    times, knots = motion
    orders = np.arange(3)[:, None]
    elsewhere, bent = knots.copy(), knots / SLOWER**orders
    elsewhere[0, 0, 0] += 1e-3
    bent[len(bent) // 2, 0, :2] = [max(robot.limit, bending(start)) + BENT, 0.0]
    tip = backbone(robot, knots[len(knots) // 2, 0][None])[0, -1:]
    case = start, target, centres, radii

    def with_ball(centre, radius):
        return times, knots, start, target, np.vstack([centres.reshape(-1, 3), centre]), np.append(radii, radius)

    return {
        "begins elsewhere": (times, elsewhere, *case),
        "of its limit": (times / 1.5, knots * 1.5**orders, *case),
        "bends by": (times * SLOWER, bent, *case),
        "from the target": (times, knots, start, target + [0.0, 0.0, 2.1 * TIP_TOLERANCE], centres, radii),
        "inside a ball": with_ball(tip, 1.0e-3),
        "inside a ball, grazed": with_ball(grazed(robot, times, knots), GRAZING_RADIUS),
    }


def grazed(robot, times, knots):
    """The centre of a ball that the middle of the robot grazes on one side, halfway between two knots and between two looks at the piece."""
    between = (STEPS_OF_A_PIECE // 2 + 0.5) / STEPS_OF_A_PIECE
    piece = len(knots) // 2
    shape = hermite(knots[piece - 1 : piece + 1], times[piece - 1 : piece + 1], [between])[0, 0, 0]
    points = backbone(robot, shape[None])[0]
    middle = 3 * POINTS_OF_A_SECTION // 2
    along = points[middle + 1] - points[middle - 1]
    across = np.cross(along, [0.0, 1.0, 0.0])
    return points[middle] + across / np.linalg.norm(across) * (robot.tube + GRAZING_RADIUS - GRAZED)


def unnoticed_of(robot, motion, *case):
    """How many damaged copies of a motion there are, and in which of them what is wrong is not found."""
    copies = damaged(robot, motion, *case)
    found = {word: faults(robot, *copy) for word, copy in copies.items()}
    is_found = {word: any(word.split(",")[0] in text for text in texts) for word, texts in found.items()}
    return len(copies), [f"damaged, {word}: {found[word] or 'unnoticed'}" for word in copies if not is_found[word]]


def motions_of(times, knots, chosen):
    """Times and knots of the chosen candidates of a case, without their padding."""
    counts = np.isfinite(times).sum(axis=1)
    return [(times[at, : counts[at]], knots[at, : counts[at]]) for at in np.flatnonzero(chosen)]


def tip_figures(robot, times, knots):
    """Length ÷ distance of the tip's path, and its smoothness ∫‖p‴‖² over the normalised arc length, m², by third differences of points at equal
    lengths on the sampled polyline."""
    step = np.arange(STEPS_OF_A_PIECE + 1) / STEPS_OF_A_PIECE
    tips = backbone(robot, hermite(knots, times, step)[:, :, 0].reshape(-1, 6), 1)[:, -1]
    passed = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(tips, axis=0), axis=1))])
    wanted = np.linspace(0.0, passed[-1], POINTS_OF_A_TIP_PATH)
    points = np.stack([np.interp(wanted, passed, tips[:, axis]) for axis in range(3)], 1)
    smoothness = (np.diff(points, 3, axis=0) ** 2).sum() * (POINTS_OF_A_TIP_PATH - 1.0) ** 5
    return passed[-1] / np.linalg.norm(tips[-1] - tips[0]), smoothness


def tips_of_case(job):
    """The medians of `tip_figures` over the certified motions of a case; none where there is none."""
    robot, _, times, knots, _, certified, *_ = job
    motions = motions_of(times, knots, certified)
    return np.median([tip_figures(robot, *motion) for motion in motions], axis=0).tolist() if motions else None


def judge_case(job):
    robot, case, times, knots, delivered, certified, start, target, centres, radii = job
    contradicted, chosen = [], delivered | certified
    motions = motions_of(times, knots, chosen)
    for candidate, motion in zip(np.flatnonzero(chosen), motions):
        found = faults(robot, *motion, start, target, centres, radii)
        if found:
            contradicted.append(f"case {case}, candidate {candidate}: {'; '.join(found)}")
    return len(motions), int(certified.sum()), contradicted


def some_motions(jobs):
    """The first, middle and last of the jobs' motions with their cases: the arguments of `unnoticed_of` after the robot."""
    motions = []
    for _, _, times, knots, delivered, certified, *case in jobs:
        motions += [(motion, *case) for motion in motions_of(times, knots, delivered | certified)]
    places = {0, len(motions) // 2, len(motions) - 1} if motions else ()
    return [motions[place] for place in places]


def same_as_recorded(folder, records):
    """How many motions some records of `pcc compare` have, and how many certified ones last as long, case by case."""
    with np.load(folder / "paths.npz") as file:
        times, certified = file["knot_time"], file["certified"].astype(bool)
    recorded = same = 0
    for line in records.read_text().splitlines()[1:]:
        record = json.loads(line)
        theirs = np.array([motion["duration_s"] for motion in record["motions"]])
        ours = np.nanmax(times[record["case"]][certified[record["case"]]], axis=1, initial=-np.inf)
        recorded += len(theirs)
        if len(ours) == len(theirs):
            same += int((np.abs(np.sort(ours) - np.sort(theirs)) <= SAME_DURATION).sum())
    return recorded, same


def cases(dataset):
    """Start, target, and balls of each case of the split `test`, in file order."""
    with np.load(dataset / "dataset.npz") as file:
        arrays = {name: file[name] for name in file.files}
    if "obstacle_radii" not in arrays:
        radius = json.loads((dataset / "dataset_meta.json").read_text())["sphere_radius"]
        arrays["obstacle_radii"] = np.full(len(arrays["obstacle_centres"]), radius)
    offsets, seen = arrays["obstacle_offsets"], set()
    for row in np.flatnonzero(arrays["split_indices"] == TEST_SPLIT):
        key = int(arrays["target_indices"][row]), int(arrays["start_indices"][row])
        if key in seen:
            continue
        seen.add(key)
        balls = slice(offsets[row], offsets[row + 1])
        scene = arrays["obstacle_centres"][balls], arrays["obstacle_radii"][balls]
        ends = arrays["paths"][row, 0], arrays["target_tips"][row]
        yield tuple(array.astype(float) for array in (*ends, *scene))


def jobs(robot, folder, dataset):
    with np.load(folder / "paths.npz") as file:
        times, knots, delivered, certified = (file[name] for name in ("knot_time", "knots", "delivered", "certified"))
    known = list(itertools.islice(cases(dataset), len(times)))
    if len(known) < len(times):
        raise SystemExit(f"{folder} has {len(times)} cases, and {dataset} {len(known)} in split test")
    for case, of_dataset in enumerate(known):
        yield robot, case, times[case], knots[case], delivered[case], certified[case], *of_dataset


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--dataset", required=True, type=Path)
    parser.add_argument("--records", type=Path, metavar="RECORDS")
    parser.add_argument("--tips", type=Path, metavar="TIPS")
    parser.add_argument("--robot", default="config/robots/unit.toml")
    arguments = parser.parse_args()
    robot = Robot(arguments.robot)
    whole = {"judged": 0, "certified": 0, "contradicted": 0, "damaged": 0, "unnoticed": 0, "recorded": 0, "same": 0}
    tips = []
    with ProcessPoolExecutor() as workers:
        for folder in arguments.folders:
            results = list(workers.map(judge_case, jobs(robot, folder, arguments.dataset), chunksize=4))
            counts, certified, contradicted = zip(*results)
            of_damaged = [unnoticed_of(robot, *motion) for motion in some_motions(jobs(robot, folder, arguments.dataset))]
            damages, unnoticed = sum(count for count, _ in of_damaged), [text for _, texts in of_damaged for text in texts]
            texts = [text for of_case in contradicted for text in of_case] + unnoticed
            print(f"{folder}: {sum(counts)} motions, {len(texts)} faults", *texts, sep="\n  ", flush=True)
            whole["judged"] += sum(counts)
            whole["certified"] += sum(certified)
            whole["contradicted"] += len(texts) - len(unnoticed)
            whole["damaged"] += damages
            whole["unnoticed"] += len(unnoticed)
            if arguments.tips:
                tips += workers.map(tips_of_case, jobs(robot, folder, arguments.dataset), chunksize=4)
            if arguments.records:
                recorded, same = same_as_recorded(folder, arguments.records)
                whole["recorded"] += recorded
                whole["same"] += same
    if arguments.tips:
        arguments.tips.write_text(json.dumps(tips))
    print(json.dumps(whole))
    sys.exit(whole["contradicted"] + whole["unnoticed"] > 0)


if __name__ == "__main__":
    main()
