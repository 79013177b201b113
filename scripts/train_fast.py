#!/usr/bin/env python3
"""Train and export the few-step path sampler `fast` (flow matching, conditioned on both ends and the scene).

Subcommands: `train`, `export`, `fixture`; each has its own --help. Training arrays come from `pcc features`:
files `shard-XXXX.npz` with

  ends [N, 36] f32          description of the two ends, canonical frame
  balls [M, 28] f32         descriptions of all balls, those of row n at ball_offsets[n]..ball_offsets[n + 1]
  ball_offsets [N + 1] i64
  coefficients [N, 72] f32  residual to the straight segment, rad: [k * 6 + d] multiplies sin((k + 1) pi u) of degree d
  group [N] i64             the same for all rows of one target (of the path forwards); 2 % of the groups are held out
  frame [1] u8              1: all of it in the base frame instead (`pcc features --frame base`); without it canonical

There are four rows a path, in this order: the path, its mirror image, the path backwards, its mirror image.
weights/README.md has the recipe of the committed weights.
"""

import argparse
import copy
import json
import math
import time
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn import functional

from weights_export import record_of, this_machine, write_weights

ARCHITECTURE = "both-ends-flow-v1"
COEFFICIENTS = 72
END_FEATURES = 36
BALL_FEATURES = 28
BALL_WIDTH = 128
TIME_FEATURES = 32
EVALUATIONS = 2
FRAMES = ("canonical", "base")
WARM_UP_UPDATES = 500
AVERAGE_DECAY = 0.999


def time_features(t):
    """Features [B, 32] of t [B] in [0, 1]: sin(2 pi f t), then cos(2 pi f t), with f = 0.5, 1, 1.5, ..., 8."""
    frequency = 0.5 * torch.arange(1, TIME_FEATURES // 2 + 1, dtype=t.dtype, device=t.device)
    angle = 2.0 * math.pi * t[:, None] * frequency
    return torch.cat([angle.sin(), angle.cos()], dim=1)


class Block(nn.Module):
    """h + outer(silu(inner(norm(h))))."""

    def __init__(self, width):
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.inner = nn.Linear(width, width)
        self.outer = nn.Linear(width, width)

    def forward(self, h):
        return h + self.outer(functional.silu(self.inner(self.norm(h))))


class FastModel(nn.Module):
    """Estimates the data at the end of the flow x_t = (1 - t) noise + t data, in normalised coefficients.

    The velocity is (estimate - x_t) / (1 - t): the network need not carry the noise through to its output.
    A regression reads neither x_t nor t: it estimates the mean of the data.
    """

    def __init__(self, width, blocks, regression=False, sizes=(END_FEATURES, BALL_FEATURES, COEFFICIENTS)):
        super().__init__()
        self.regression = regression
        end_features, ball_features, coefficients = sizes
        self.register_buffer("end_mean", torch.zeros(end_features))
        self.register_buffer("end_std", torch.ones(end_features))
        self.register_buffer("ball_mean", torch.zeros(ball_features))
        self.register_buffer("ball_std", torch.ones(ball_features))
        self.register_buffer("coefficient_std", torch.ones(coefficients))
        self.ball_inner = nn.Linear(ball_features, BALL_WIDTH)
        self.ball_outer = nn.Linear(BALL_WIDTH, BALL_WIDTH)
        self.context = nn.Linear(2 * BALL_WIDTH + end_features, width)
        self.time = nn.Linear(TIME_FEATURES, width)
        self.input = nn.Linear(coefficients, width)
        self.blocks = nn.ModuleList(Block(width) for _ in range(blocks))
        self.norm = nn.LayerNorm(width)
        self.output = nn.Linear(width, coefficients)
        nn.init.zeros_(self.output.weight)

    def pool(self, balls, groups):
        """Pooled balls [B, 256]: largest, then a quarter of the sum.

        balls [M, 28] are packed in the order of the rows, which ascend by ball count; groups lists
        (ball count, rows that have it). Rows of one count pool as one view, without padding or scatter.
        """
        x = (balls - self.ball_mean) / self.ball_std
        x = functional.silu(self.ball_outer(functional.silu(self.ball_inner(x))))
        pooled, first = [], 0
        for count, rows in groups:
            if count == 0:
                pooled.append(x.new_zeros(rows, 2 * BALL_WIDTH))
                continue
            part = x[first : first + count * rows].view(rows, count, BALL_WIDTH)
            pooled.append(torch.cat([part.amax(dim=1), part.sum(dim=1) / 4.0], dim=1))
            first += count * rows
        return torch.cat(pooled)

    def condition(self, ends, pooled):
        """Context [B, W] of ends [B, 36] and pooled balls [B, 256]."""
        return self.context(torch.cat([pooled, (ends - self.end_mean) / self.end_std], dim=1))

    def estimate(self, x, t, context):
        """Estimate [B, 72] of the normalised coefficients from x [B, 72] at t [B]."""
        if self.regression:
            x, t = torch.zeros_like(x), torch.zeros_like(t)
        h = self.input(x) + context + self.time(time_features(t))
        for block in self.blocks:
            h = block(h)
        return self.output(functional.silu(self.norm(h)))

    def forward(self, x, t, ends, pooled):
        return self.estimate(x, t, self.condition(ends, pooled))

    def sample(self, noise, context, evaluations=EVALUATIONS):
        """Coefficients [B, 72], rad, by Euler steps of the flow from noise [B, 72]."""
        x = noise
        for step in range(evaluations):
            t = torch.full((len(x),), step / evaluations, dtype=x.dtype, device=x.device)
            x = x + (self.estimate(x, t, context) - x) / (evaluations - step)
        return x * self.coefficient_std


def ball_groups(counts):
    """(ball count, rows that have it) of ascending counts [B]."""
    values, rows = torch.unique_consecutive(counts, return_counts=True)
    return list(zip(values.tolist(), rows.tolist(), strict=True))


def chosen_groups(group, share):
    """Which rows belong to a share of the groups: the same for all kinds of scenes, a smaller share within a larger."""
    return group * 2246822519 % 4294967296 < share * 4294967296


class Rows:
    """All training rows in memory, balls packed; training uses a share of their groups."""

    def __init__(self, folder, device, share=1.0):
        names = ("ends", "balls", "coefficients", "group", "counts")
        parts = {name: [] for name in names}
        frames = set()
        for file in sorted(Path(folder).glob("shard-*.npz")):
            with np.load(file) as shard:
                frames.add(FRAMES[int(shard["frame"][0]) if "frame" in shard else 0])
                for name in names:
                    parts[name].append(np.diff(shard["ball_offsets"]) if name == "counts" else shard[name])
        if not parts["ends"]:
            raise SystemExit(f"no shard-*.npz in {folder}")
        if len(frames) > 1:
            raise SystemExit(f"{folder} has shards in different frames: {sorted(frames)}")
        self.frame = frames.pop()
        joined = {name: torch.from_numpy(np.concatenate(values)).to(device) for name, values in parts.items()}
        self.ends, self.balls, self.coefficients = joined["ends"], joined["balls"], joined["coefficients"]
        self.counts, self.group = joined["counts"], joined["group"]
        self.first_ball = torch.cumsum(self.counts, 0) - self.counts
        held_out = self.group * 2654435761 % 4294967296 // 65536 % 50 == 0
        self.train = torch.nonzero(~held_out & chosen_groups(self.group, share)).squeeze(1)
        self.validation = torch.nonzero(held_out).squeeze(1)
        if not len(self.validation) or not len(self.train):
            raise SystemExit(f"{folder} has too few groups: {len(self.train)} rows to train, {len(self.validation)} held out")

    def gather(self, rows):
        """Ends, packed balls, ball groups and coefficients of some rows, ascending by ball count."""
        rows = rows[torch.argsort(self.counts[rows], stable=True)]
        counts = self.counts[rows]
        ends_of_rows = torch.cumsum(counts, 0)
        slots = torch.arange(int(ends_of_rows[-1]), device=rows.device)
        slots += torch.repeat_interleave(self.first_ball[rows] - ends_of_rows + counts, counts)
        return self.ends[rows], self.balls[slots], ball_groups(counts), self.coefficients[rows]


def normalise(model, rows):
    """Sets the normalisation from the training rows; the floors keep constant features and tiny coefficients harmless."""
    model.end_mean.copy_(rows.ends[rows.train].mean(0))
    model.end_std.copy_(rows.ends[rows.train].std(0).clamp(min=1e-2))
    if len(rows.balls) > 1:
        model.ball_mean.copy_(rows.balls.mean(0))
        model.ball_std.copy_(rows.balls.std(0).clamp(min=1e-2))
    model.coefficient_std.copy_(rows.coefficients[rows.train].square().mean(0).sqrt().clamp(min=1e-3))


def loss_weight(model):
    """Weight [72] of each squared normalised error, mean 1.

    Proportional to the coefficient's standard deviation: half-way between error in rad (its square) and equal
    attention to all terms, with a floor for the terms that are nearly nothing.
    """
    weight = (model.coefficient_std / model.coefficient_std.mean()).clamp(min=0.05)
    return weight / weight.mean()


def flow_times(count, generator, device):
    """Times [B]: 40 % at 0 and 30 % at 1/2, where two evaluations are made; the rest uniform."""
    t = torch.rand(count, generator=generator, device=device)
    kind = torch.rand(count, generator=generator, device=device)
    return torch.where(kind < 0.4, 0.0, torch.where(kind < 0.7, 0.5, t))


def batch_loss(model, rows, batch, weight, generator, bf16):
    """Weighted mean squared error of the estimated normalised coefficients over one batch."""
    ends, balls, groups, coefficients = rows.gather(batch)
    data = coefficients / model.coefficient_std
    noise = torch.randn(data.shape, generator=generator, device=data.device)
    t = flow_times(len(batch), generator, data.device)
    x = torch.lerp(noise, data, t[:, None])
    with torch.autocast(data.device.type, dtype=torch.bfloat16, enabled=bf16):
        estimate = model(x, t, ends, model.pool(balls, groups))
    return ((estimate.float() - data).square() * weight).mean()


@torch.no_grad()
def validate(model, rows, weight, limit=4096):
    """Flow loss, and how far samples are from the held-out paths, on the same rows and noise each time.

    A path's error is the root mean square over the path of the 6-vector's norm, rad: sqrt(sum of squared coefficient
    errors / 2). Reported for one and two evaluations and for the straight segment: root mean square and median.
    """
    generator = torch.Generator(device=rows.ends.device).manual_seed(1)
    chosen = rows.validation[torch.randperm(len(rows.validation), generator=generator, device=rows.ends.device)[:limit]]
    report = {"flow_loss": float(batch_loss(model, rows, chosen, weight, generator, False))}
    ends, balls, groups, coefficients = rows.gather(chosen)
    context = model.condition(ends, model.pool(balls, groups))
    noise = torch.randn(coefficients.shape, generator=generator, device=coefficients.device)
    errors = {"straight": coefficients}
    for evaluations in (1, 2):
        errors[str(evaluations)] = model.sample(noise, context, evaluations) - coefficients
    for name, error in errors.items():
        mean_square = 0.5 * error.square().sum(dim=1)
        report[f"path_rms_rad_{name}"] = float(mean_square.mean().sqrt())
        report[f"path_median_rad_{name}"] = float(mean_square.median().sqrt())
    return {name: round(value, 5) for name, value in report.items()}


class Run:
    """Everything a training run changes; saved and restored as a whole."""

    def __init__(self, model, facts, arguments, rows, device):
        self.model = model.to(device)
        normalise(self.model, rows)
        self.average = copy.deepcopy(self.model)
        self.optimiser = torch.optim.AdamW(
            self.model.parameters(), lr=arguments.rate, weight_decay=arguments.decay, betas=(0.9, 0.99), fused=True
        )
        self.generator = torch.Generator(device=device).manual_seed(arguments.seed)
        self.updates = 0
        self.seconds = 0.0
        self.fixed = facts | {"seed": arguments.seed, "batch": arguments.batch}
        self.facts = self.fixed | {"rows": len(rows.train)}

    def save(self, file, record):
        state = {name: getattr(self, name).state_dict() for name in ("model", "average", "optimiser")}
        state |= {"generator": self.generator.get_state(), "updates": self.updates, "seconds": self.seconds}
        state |= {"facts": self.facts, "record": record}
        part = file.with_suffix(".part")
        torch.save(state, part)
        part.replace(file)

    def begin_from(self, file, device):
        """Starts with the averaged weights and the normalisation of another run."""
        state = torch.load(file, map_location=device, weights_only=True)
        self.model.load_state_dict(state["average"])
        self.average.load_state_dict(state["average"])

    def restore(self, file, device):
        state = torch.load(file, map_location=device, weights_only=True)
        if any(state["facts"][name] != value for name, value in self.fixed.items()):
            raise SystemExit(f"{file} is of another run: {state['facts']}, this one is {self.facts}")
        for name in ("model", "average", "optimiser"):
            getattr(self, name).load_state_dict(state[name])
        self.generator.set_state(state["generator"].cpu())
        self.updates, self.seconds = state["updates"], state["seconds"]


def step(run, rows, weight, loss_of, arguments, share):
    """One update; returns the loss. `share` is the part of the run that is over."""
    rate = arguments.rate * min(1.0, (run.updates + 1) / WARM_UP_UPDATES) * (0.5 + 0.5 * math.cos(math.pi * share))
    for group in run.optimiser.param_groups:
        group["lr"] = rate
    picks = torch.randint(len(rows.train), (arguments.batch,), generator=run.generator, device=rows.train.device)
    loss = loss_of(run, rows, rows.train[picks], weight, arguments)
    run.optimiser.zero_grad(set_to_none=True)
    loss.backward()
    nn.utils.clip_grad_norm_(run.model.parameters(), 1.0)
    run.optimiser.step()
    run.updates += 1
    keep = min(AVERAGE_DECAY, run.updates / (run.updates + 10))
    with torch.no_grad():
        torch._foreach_lerp_(list(run.average.parameters()), list(run.model.parameters()), 1.0 - keep)
    return loss


def share_done(run, arguments):
    """The part of the run that is over: 1 or more when it has its length."""
    return run.seconds / (60.0 * arguments.minutes) if arguments.minutes else run.updates / arguments.updates


def prepare(arguments):
    """Seeds and threads as asked for; returns the device."""
    torch.manual_seed(arguments.seed)
    torch.set_num_threads(arguments.threads)
    return torch.device("cuda" if torch.cuda.is_available() else "cpu")


def train(arguments):
    """Trains the model of both ends."""
    device = prepare(arguments)
    rows = Rows(arguments.data, device, arguments.fraction)
    facts = {name: getattr(arguments, name) for name in ("width", "blocks", "regression", "fraction")}
    model = FastModel(arguments.width, arguments.blocks, arguments.regression)
    run = Run(model, facts | {"frame": rows.frame}, arguments, rows, device)
    fit(run, rows, arguments, flow_loss)


def flow_loss(run, rows, batch, weight, arguments):
    """The loss of flow matching over one batch of a run."""
    return batch_loss(run.model, rows, batch, weight, run.generator, arguments.bf16)


def fit(run, rows, arguments, loss_of):
    """Trains, with checkpoints; a run that was stopped goes on where it was, with shards added since if there are any.

    `loss_of` is the loss over one batch, as `flow_loss` is.
    """
    device = rows.ends.device
    checkpoint = Path(arguments.checkpoint)
    checkpoint.parent.mkdir(parents=True, exist_ok=True)
    if checkpoint.exists():
        run.restore(checkpoint, device)
    elif arguments.begin_from:
        run.begin_from(arguments.begin_from, device)
    weight = loss_weight(run.model)
    print(f"{len(rows.train)} training rows, {len(rows.validation)} held out, from update {run.updates}", flush=True)
    began, share, losses = time.monotonic() - run.seconds, share_done(run, arguments), []
    while share < 1.0:
        losses.append(step(run, rows, weight, loss_of, arguments, share).detach())
        run.seconds = time.monotonic() - began
        share = share_done(run, arguments)
        if run.updates % arguments.every == 0 or share >= 1.0:
            record = {"update": run.updates, "seconds": round(run.seconds, 1), "loss": float(torch.stack(losses).mean())}
            record |= validate(run.average, rows, weight)
            losses.clear()
            print(json.dumps(record), flush=True)
            with checkpoint.with_suffix(".jsonl").open("a") as log:
                log.write(json.dumps(record) + "\n")
            run.save(checkpoint, record)


def metadata_of(state, recipe, measured, machine):
    """Everything the loader checks, and how the weights were made."""
    facts = state["facts"]
    return {
        "architecture": ARCHITECTURE,
        "width": str(facts["width"]),
        "blocks": str(facts["blocks"]),
        "end_features": str(END_FEATURES),
        "ball_features": str(BALL_FEATURES),
        "coefficients": str(COEFFICIENTS),
        "estimates": "data",
        "evaluations": str(1 if facts["regression"] else EVALUATIONS),
        "frame": facts["frame"],
        "sections": "3",
        "theta_max": repr(math.pi / 2),
        "basis": "coefficient [k * 6 + d] times sin((k + 1) pi u), residual to the straight segment, rad",
        "schedule": "x_t = (1 - t) noise + t data; the network estimates data; Euler from t = 0",
        "normalisation": "ends and balls by mean and standard deviation, coefficients by root mean square: the tensors say",
    } | record_of(state, recipe, measured, machine)


def without_state(tensors):
    """Tensors of a regression such that whoever runs them as a flow gets the same estimate from every x at every t."""
    start = time_features(torch.zeros(1))[0]
    return tensors | {
        "input.weight": torch.zeros_like(tensors["input.weight"]),
        "time.weight": torch.zeros_like(tensors["time.weight"]),
        "time.bias": tensors["time.bias"] + tensors["time.weight"] @ start,
    }


def export(arguments):
    """Writes the averaged weights and the manifest's entry."""
    state = torch.load(arguments.checkpoint, map_location="cpu", weights_only=True)
    tensors = without_state(state["average"]) if state["facts"]["regression"] else state["average"]
    measured = json.dumps(json.loads(arguments.measured))
    metadata = metadata_of(state, arguments.recipe, measured, arguments.machine or this_machine())
    entry = write_weights(Path(arguments.out), arguments.name, tensors, metadata)
    print(entry)


def random_model():
    """A tiny model none of whose tensors is trivial."""
    model = FastModel(width=32, blocks=2)
    with torch.no_grad():
        nn.init.normal_(model.output.weight, std=0.2)
        for norm in [block.norm for block in model.blocks] + [model.norm]:
            norm.weight.copy_(torch.rand(32) + 0.5)
            norm.bias.copy_(0.1 * torch.randn(32))
        for name, buffer in model.named_buffers():
            buffer.copy_(torch.rand_like(buffer) + 0.5 if name.endswith("std") else 0.1 * torch.randn_like(buffer))
    return model


@torch.no_grad()
def fixture(arguments):
    """Writes a tiny random model and its outputs, layer by layer, for the parity test."""
    from safetensors.torch import save_file

    torch.manual_seed(7)
    model = random_model()
    counts = torch.tensor([0, 1, 5])
    given = {
        "ends": torch.randn(3, END_FEATURES), "balls": torch.randn(6, BALL_FEATURES), "ball_counts": counts.float(),
        "noise": torch.randn(3, COEFFICIENTS),
    }  # fmt: skip
    t = torch.full((3,), 0.3)
    layers = {"pooled": model.pool(given["balls"], ball_groups(counts))}
    layers["context"] = context = model.condition(given["ends"], layers["pooled"])
    layers["time"] = model.time(time_features(t))
    layers["input"] = h = model.input(given["noise"]) + context + layers["time"]
    for index, block in enumerate(model.blocks):
        layers[f"block_{index}"] = h = block(h)
    layers["estimate"] = model.estimate(given["noise"], t, context)
    layers["sample"] = model.sample(given["noise"], context, 2)
    folder = Path(arguments.out)
    folder.mkdir(parents=True, exist_ok=True)
    facts = {"width": 32, "blocks": 2, "seed": 7, "batch": 0, "rows": 0, "regression": False, "frame": "canonical"}
    state = {"facts": facts, "updates": 0, "seconds": 0, "record": {}}
    metadata = metadata_of(state, "random, for the parity test", "{}", "any")
    write_weights(folder, "tiny", model.state_dict(), metadata)
    outputs = folder / "tiny_layers.safetensors"
    save_file({name: value.contiguous() for name, value in (given | layers).items()}, outputs)
    outputs.chmod(0o644)


def add_training_arguments(p, checkpoint):
    """What every training run is told; `checkpoint` are the keywords of that option."""
    p.add_argument("--data", required=True, help="folder with shard-XXXX.npz from `pcc features`")
    p.add_argument("--checkpoint", **checkpoint)
    p.add_argument("--begin-from", type=Path, help="checkpoint of another run, whose averaged weights this one begins with")
    length = p.add_mutually_exclusive_group(required=True)
    length.add_argument("--updates", type=int, help="length of the run in updates (reproducible)")
    length.add_argument("--minutes", type=float, help="length of the run in minutes; the rate decays by elapsed time")
    p.add_argument("--batch", type=int, default=1024, help="rows an update (default %(default)s)")
    p.add_argument("--rate", type=float, default=1e-3, help="highest learning rate (default %(default)s)")
    p.add_argument("--decay", type=float, default=1e-2, help="AdamW's weight decay (default %(default)s)")
    p.add_argument("--width", type=int, default=384, help="W (default %(default)s)")
    p.add_argument("--blocks", type=int, default=4, help="N (default %(default)s)")
    p.add_argument("--threads", type=int, default=1, help="processor threads (default %(default)s)")
    p.add_argument("--seed", type=int, default=0, help="seed of weights, noise and batches (default %(default)s)")
    p.add_argument("--every", type=int, default=1000, help="updates between checkpoints (default %(default)s)")
    p.add_argument("--bf16", action="store_true", help="bfloat16 matrix products: faster where the processor has them")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    checkpoint = {"default": "weights/checkpoints/fast.pt", "help": "checkpoint (default %(default)s); the log is beside it"}

    p = commands.add_parser("train", help="train; goes on from the checkpoint if there is one")
    add_training_arguments(p, checkpoint)
    p.add_argument("--fraction", type=float, default=1.0, help="share of the targets to train on (default %(default)s)")
    p.add_argument("--regression", action="store_true", help="estimate the mean path instead of sampling paths")
    p.set_defaults(run=train)

    p = commands.add_parser("export", help="write NAME.safetensors and its entry in MANIFEST.toml")
    p.add_argument("--checkpoint", **checkpoint)
    p.add_argument("--name", default="fast", help="name of the weights (default %(default)s)")
    p.add_argument("--recipe", required=True, help="how the data was made and the training went, in one line")
    p.add_argument("--machine", help="where and with how many threads it was trained (default: this machine)")
    p.add_argument("--measured", default="{}", help="what `pcc evaluate` measured, as a JSON object")
    p.add_argument("--out", default="weights", help="folder of the weights (default %(default)s)")
    p.set_defaults(run=export)

    p = commands.add_parser("fixture", help="write the fixture of the Rust parity test")
    p.add_argument("--out", default="crates/denoiser/tests/fixtures", help="folder (default %(default)s)")
    p.set_defaults(run=fixture)
    arguments = parser.parse_args()
    arguments.run(arguments)


if __name__ == "__main__":
    main()
