#!/usr/bin/env python3
"""Train the alternatives to `fast` that choose the end shape themselves, as the paper's model does, and draw their paths.

They get the start, the target tip and the balls, and sample the end shape with the path's residual to the straight segment:
78 numbers. The experiment behind docs/decisions/0010-which-generator.md; the planner does not load these models.

  flow      flow matching, to be sampled with 1, 2, 4 or 8 evaluations
  shortcut  flow matching that is told the step's length and consistent with its own half steps (Frans et al., "One Step
            Diffusion via Shortcut Models", 2024)
  set       one evaluation, trained on sets: each solution of a scene pulls the nearest of several samples, each sample is
            pulled to the nearest solution (IMLE and Chamfer)
  distilled one evaluation, trained on the samples of a flow from the same noise; begins as that flow (--begin-from)

Subcommands: `train` (from the shards of train_fast.py, canonical frame) and `propose`, which draws paths for the cases of a
`paths.npz` of `pcc evaluate`, to be judged by `pcc evaluate --planner proposed --proposals FILE`.
"""

import argparse
import math
import time
from pathlib import Path

import numpy as np
import torch
from torch import nn

from train_fast import FastModel, Rows, Run, add_training_arguments, ball_groups, fit, flow_loss, prepare, time_features

BODY_POINTS = 9
TERMS = 12
WAYPOINTS = 64
START_FEATURES = 6 + 3 * BODY_POINTS + 3 + 2
BALL_FEATURES = 4 + BODY_POINTS + 1
STATE = 6 + 6 * TERMS
SIZES = (START_FEATURES, BALL_FEATURES, STATE)
FINEST_STEP = 1 / 8
SAMPLES_A_SCENE = 8
SOLUTIONS_A_SCENE = 4
TEACHER_EVALUATIONS = 4


def section(pairs):
    """Rotation [N, 3, 3] and end [N, 3] of sections of length 1 bent by pairs [N, 2] (docs/robot.md)."""
    a, b = pairs[:, 0], pairs[:, 1]
    square = a * a + b * b + 1e-12
    angle = square.sqrt()
    first, second = angle.sin() / angle, 2.0 * (0.5 * angle).sin().square() / square
    zero = torch.zeros_like(a)
    hat = torch.stack([zero, zero, b, zero, zero, -a, -b, a, zero], dim=1).view(-1, 3, 3)
    turn = torch.eye(3, dtype=a.dtype) + first[:, None, None] * hat + second[:, None, None] * (hat @ hat)
    return turn, torch.stack([second * b, -second * a, first], dim=1)


def body_points(shapes):
    """Points [N, 9, 3] of the backbone at thirds of each section, the tip last."""
    turn, origin = torch.eye(3, dtype=shapes.dtype).expand(len(shapes), 3, 3), torch.zeros(len(shapes), 3, dtype=shapes.dtype)
    points = []
    for index in range(3):
        pairs = shapes[:, 2 * index : 2 * index + 2]
        for third in (1, 2, 3):
            part_turn, part = section(pairs * third / 3)
            points.append(origin + (turn @ part[:, :, None]).squeeze(2) * third / 3)
        turn, origin = turn @ part_turn, points[-1]
    return torch.stack(points, dim=1)


def describe(starts, targets, balls, counts):
    """Features [N, 38] of starts [N, 6] and target tips [N, 3], and [M, 14] of balls [M, 4], counts [N] of them a row."""
    points = body_points(starts)
    way = targets - points[:, -1]
    ends = torch.cat([starts, points.flatten(1), targets, way.norm(dim=1, keepdim=True), counts[:, None] / 8.0], dim=1)
    row = torch.repeat_interleave(torch.arange(len(counts)), counts)
    centre, radius = balls[:, :3], balls[:, 3:4]
    clearances = (points[row] - centre[:, None]).norm(dim=2) - radius
    from_tip = centre - points[row, -1]
    along = ((from_tip * way[row]).sum(1) / way[row].square().sum(1).clamp(min=1e-9)).clamp(0.0, 1.0)
    beside = (from_tip - along[:, None] * way[row]).norm(dim=1, keepdim=True) - radius
    return ends, torch.cat([balls, clearances.clamp(max=1.5), beside.clamp(max=1.5)], dim=1)


class StartRows(Rows):
    """The rows of `train_fast.py` seen from the start alone: what is sampled is the end shape and the coefficients."""

    def __init__(self, folder, device):
        super().__init__(folder, device)
        if self.frame != "canonical":
            raise SystemExit(f"{folder} is in the {self.frame} frame, canonical is needed")
        starts, shapes, targets = self.ends[:, :6], self.ends[:, 6:12], self.ends[:, 15:18]
        self.coefficients = torch.cat([shapes, self.coefficients], dim=1)
        self.ends, self.balls = describe(starts, targets, self.balls[:, :4], self.counts)

    def scenes(self):
        """Rows [S, 4] of the training rows forwards that share start, target and balls, repeated where there are fewer."""
        train = self.train.numpy()
        train = train[train % 4 < 2]  # backwards every path leads to a target of its own
        mirror = (train % 2).astype(np.float32)[:, None]  # a path's mirror image follows it
        starts = np.concatenate([self.ends[train, :6].numpy(), mirror], axis=1)
        _, start = np.unique(starts.view(np.dtype((np.void, starts.itemsize * 7))).ravel(), return_inverse=True)
        _, scene = np.unique(self.group[train].numpy() * len(starts) + start, return_inverse=True)
        order = np.argsort(scene, kind="stable")
        first = np.flatnonzero(np.diff(scene[order], prepend=-1))
        count = np.diff(np.append(first, len(order)))
        slots = first[:, None] + np.arange(SOLUTIONS_A_SCENE)[None] % count[:, None]
        return torch.from_numpy(train[order[slots]])


class StartModel(FastModel):
    """The network of `fast` with other inputs and outputs; `step` tells it the length of a step (0: the flow itself)."""

    def __init__(self, width, blocks):
        super().__init__(width, blocks, sizes=SIZES)
        self.step = nn.Linear(32, width, bias=False)
        nn.init.zeros_(self.step.weight)

    def told(self, context, length):
        """The context of steps of lengths [B]."""
        return context + self.step(time_features(length) - time_features(torch.zeros_like(length)))

    def draw(self, noise, context, evaluations, is_shortcut):
        """States [B, 78] from noise [B, 78]; coefficients in rad."""
        length = 1.0 / evaluations if is_shortcut and evaluations * FINEST_STEP < 1.0 else 0.0
        return self.sample(noise, self.told(context, torch.full((len(noise),), length)), evaluations)


def batch_of(model, rows, batch):
    """Context [B, W] and normalised states [B, 78] of some rows."""
    ends, balls, groups, states = rows.gather(batch)
    return model.condition(ends, model.pool(balls, groups)), states / model.coefficient_std


@torch.no_grad()
def half_steps(model, x, t, length, context):
    """What the model estimates in x [B, 78] at t [B] by two steps of half the length [B], as one estimate of the whole step."""
    half = 0.5 * length
    context = model.told(context, torch.where(half > FINEST_STEP, half, 0.0))
    velocity, at = 0.0, x
    for share in (0.0, 0.5):
        now = t + share * length
        part = (model.estimate(at, now, context).float() - at) / (1.0 - now)[:, None]
        velocity, at = velocity + 0.5 * part, at + half[:, None] * part
    return x + (1.0 - t)[:, None] * velocity


def shortcut_loss(run, rows, batch, weight, arguments):
    """Flow matching, and on a quarter of as many rows consistency with the average model's half steps."""
    flow = flow_loss(run, rows, batch, weight, arguments)
    batch = batch[: len(batch) // 4]
    length = 0.5 ** torch.randint(0, 3, (len(batch),), generator=run.generator)
    t = (torch.rand(len(batch), generator=run.generator) / length).floor() * length
    with torch.autocast("cpu", dtype=torch.bfloat16, enabled=arguments.bf16):
        context, data = batch_of(run.model, rows, batch)
        x = torch.lerp(torch.randn(data.shape, generator=run.generator), data, t[:, None])
        with torch.no_grad():
            aim = half_steps(run.average, x, t, length, batch_of(run.average, rows, batch)[0])
        estimate = run.model.estimate(x, t, run.model.told(context, length))
    return flow + ((estimate.float() - aim).square() * weight).mean()


def set_loss(scenes):
    """The loss over sets of samples; it draws its own scenes instead of rows."""

    def loss(run, rows, batch, weight, arguments):
        count = len(batch) // SAMPLES_A_SCENE
        chosen = scenes[torch.randint(len(scenes), (count,), generator=run.generator)]
        chosen = chosen[torch.argsort(rows.counts[chosen[:, 0]], stable=True)]
        solutions = rows.coefficients[chosen] / run.model.coefficient_std
        with torch.autocast("cpu", dtype=torch.bfloat16, enabled=arguments.bf16):
            context, _ = batch_of(run.model, rows, chosen[:, 0])
            context = context.repeat_interleave(SAMPLES_A_SCENE, dim=0)
            noise = torch.randn(len(context), STATE, generator=run.generator)
            estimate = run.model.estimate(noise, torch.zeros(len(noise)), context)
        samples = estimate.float().view(count, SAMPLES_A_SCENE, STATE)
        scaled = weight.sqrt()
        distance = torch.cdist(samples * scaled, solutions * scaled).square() / STATE
        return distance.amin(dim=1).mean() + distance.amin(dim=2).mean()

    return loss


def distilled_loss(teacher):
    """The distance from the teacher's samples from the same noise."""

    def loss(run, rows, batch, weight, arguments):
        with torch.autocast("cpu", dtype=torch.bfloat16, enabled=arguments.bf16):
            context, data = batch_of(run.model, rows, batch)
            noise = torch.randn(data.shape, generator=run.generator)
            with torch.no_grad():
                known, _ = batch_of(teacher, rows, batch)
                aim = teacher.draw(noise, known, TEACHER_EVALUATIONS, is_shortcut=False) / teacher.coefficient_std
            estimate = run.model.estimate(noise, torch.zeros(len(noise)), context)
        return ((estimate.float() - aim.float()).square() * weight).mean()

    return loss


def load(checkpoint):
    """The averaged model of a checkpoint, and its method."""
    state = torch.load(checkpoint, map_location="cpu", weights_only=True)
    model = StartModel(state["facts"]["width"], state["facts"]["blocks"])
    model.load_state_dict(state["average"])
    return model, state["facts"]["method"]


def train(arguments):
    """Trains one of the methods."""
    if torch.cuda.is_available():
        raise SystemExit("written for the processor: hide the accelerator (CUDA_VISIBLE_DEVICES=)")
    rows = StartRows(arguments.data, prepare(arguments))
    model = StartModel(arguments.width, arguments.blocks)
    facts = {name: getattr(arguments, name) for name in ("width", "blocks", "method")}
    run = Run(model, facts, arguments, rows, torch.device("cpu"))
    if arguments.method == "distilled":
        teacher, _ = load(arguments.begin_from)
        fit(run, rows, arguments, distilled_loss(teacher))
    elif arguments.method == "set":
        fit(run, rows, arguments, set_loss(rows.scenes()))
    else:
        fit(run, rows, arguments, {"flow": flow_loss, "shortcut": shortcut_loss}[arguments.method])


def turned(pairs, angle):
    """Pairs [..., 2] turned by angles that fit them."""
    x, y = pairs[..., 0], pairs[..., 1]
    return torch.stack([angle.cos() * x - angle.sin() * y, angle.sin() * x + angle.cos() * y], dim=-1)


def canonical(cases):
    """Starts, target tips and balls [M, 4] of cases with the targets' azimuths turned to zero; counts; the azimuths.

    Targets on the axis, where the planner takes the start tip's azimuth, are not turned: none of the sets has one.
    """
    names = ("starts", "target_tips", "obstacle_centres", "obstacle_radii")
    starts, targets, centres, radii = (torch.from_numpy(cases[name]).float() for name in names)
    counts = torch.from_numpy(np.diff(cases["obstacle_offsets"]))
    azimuth = torch.atan2(targets[:, 1], targets[:, 0])
    starts = turned(starts.view(-1, 3, 2), -azimuth[:, None]).flatten(1)
    targets = torch.cat([turned(targets[:, :2], -azimuth), targets[:, 2:]], dim=1)
    of_ball = torch.repeat_interleave(azimuth, counts)
    balls = torch.cat([turned(centres[:, :2], -of_ball), centres[:, 2:], radii[:, None]], dim=1)
    return starts, targets, balls, counts, azimuth


def paths_of(starts, states):
    """Paths [N, 64, 6] from starts [N, 6] and states [N, 78]."""
    u = torch.linspace(0.0, 1.0, WAYPOINTS)
    sines = torch.sin(torch.arange(1, TERMS + 1)[None] * math.pi * u[:, None])
    line = torch.lerp(starts[:, None], states[:, None, :6], u[None, :, None])
    return line + sines @ states[:, 6:].view(-1, TERMS, 6)


@torch.no_grad()
def propose(arguments):
    """Draws paths for cases and says what one costs."""
    torch.set_num_threads(1)
    torch.manual_seed(arguments.seed)
    model, method = load(arguments.checkpoint)
    with np.load(arguments.cases) as cases:
        starts, targets, balls, counts, azimuth = canonical(cases)
    began = time.perf_counter()
    ends, described = describe(starts, targets, balls, counts)
    order = torch.argsort(counts, stable=True)
    of_row = torch.split(described, counts.tolist())
    packed = torch.cat([of_row[row] for row in order.tolist()])
    context = torch.empty(len(counts), model.context.out_features)
    context[order] = model.condition(ends[order], model.pool(packed, ball_groups(counts[order])))
    context = context.repeat_interleave(arguments.candidates, dim=0)
    noise = torch.randn(len(context), STATE)
    states = model.draw(noise, context, arguments.evaluations, method == "shortcut")
    paths = paths_of(starts.repeat_interleave(arguments.candidates, dim=0), states)
    angle = azimuth.repeat_interleave(arguments.candidates)[:, None, None]
    paths = turned(paths.view(len(paths), WAYPOINTS, 3, 2), angle)
    seconds = time.perf_counter() - began
    paths = paths.reshape(len(counts), arguments.candidates, WAYPOINTS, 6)
    np.savez_compressed(arguments.out, paths=paths.numpy())
    print(f"{arguments.out}: {len(context)} paths by {method}, {1e6 * seconds / len(context):.1f} us each in one batch")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)

    p = commands.add_parser("train", help="train; goes on from the checkpoint if there is one")
    add_training_arguments(p, {"required": True, "help": "checkpoint; the log is beside it"})
    p.add_argument("--method", choices=("flow", "shortcut", "set", "distilled"), default="flow", help="default %(default)s")
    p.set_defaults(run=train)

    p = commands.add_parser("propose", help="draw paths for the cases of a paths.npz")
    p.add_argument("--checkpoint", required=True, help="checkpoint of `train`")
    p.add_argument("--cases", required=True, help="paths.npz that `pcc evaluate` wrote, by whatever planner")
    p.add_argument("--candidates", type=int, default=10, help="paths a case (default %(default)s)")
    p.add_argument("--evaluations", type=int, default=1, help="evaluations of the network (default %(default)s)")
    p.add_argument("--seed", type=int, default=0, help="seed of the noise (default %(default)s)")
    p.add_argument("--out", required=True, help="archive to write")
    p.set_defaults(run=propose)

    arguments = parser.parse_args()
    arguments.run(arguments)


if __name__ == "__main__":
    main()
