#!/usr/bin/env python3
"""Train and export the paper's denoiser, the temporal U-Net with its obstacle graph (docs/evaluation.md "Training").

Subcommands: `train`, `export`; each has its own --help. Data: folders written by `pcc dataset`, the authors' format. Rows
whose exact clearance is stored and negative are left out: they collide between the points that the generator looks at.
A run that was stopped goes on from its checkpoint; weights/README.md has the recipe of the committed weights.
"""

import argparse
import json
import math
import time
from pathlib import Path

import numpy as np
import torch
from safetensors import safe_open
from torch import nn

from scene_symmetries import Symmetries, moved
from unet_model import ARCHITECTURE, STEPS, TemporalUnet, cosine_schedule, metadata
from weights_export import record_of, this_machine, write_weights

WARM_UP_UPDATES = 500
AVERAGE_EVERY = 4
VALIDATION_ROWS = 2048
UPDATES_BEFORE_CAPTURE = 3
# Totals of a run and those that it goes on from, by their names in a weights file.
NOTHING_DONE = {"updates": 0, "rows_used": 0, "training_rows": 0, "training_seconds": 0, "data": []}
SCALE_TENSORS = tuple(
    f"normalisation.{part}" for part in ("configuration_low", "configuration_high", "position_centre", "position_scale")
)


class Scale:
    """Normalisation: configurations to [-1, 1] by the data's range, positions by one centre and one scale.

    With symmetries the range is the same in all directions and the centre lies on the axis, so that a turn stays a turn.
    """

    def __init__(self, low, high, centre, scale):
        self.low, self.high, self.centre, self.scale = low, high, centre, scale

    @classmethod
    def of(cls, paths, tips, centres, symmetries):
        low, high = paths.amin((0, 1)).clamp(max=0), paths.amax((0, 1)).clamp(min=0)
        points = torch.cat([tips, centres])
        centre = (points.amin(0) + points.amax(0)) / 2
        if symmetries:
            high = torch.maximum(high, -low).amax().expand(6).clone()
            low, centre = -high, centre * torch.tensor([0, 0, 1], device=centre.device)
        return cls(low, high, centre, (points - centre).abs().max().reshape(1))

    def configuration(self, values):
        return 2 * (values - self.low) / (self.high - self.low) - 1

    def position(self, values):
        return (values - self.centre) / self.scale

    def is_symmetric(self):
        ranges = torch.cat([self.high, -self.low])
        return bool((ranges == ranges[0]).all() and (self.centre[:2] == 0).all())

    def tensors(self):
        return dict(zip(SCALE_TENSORS, (self.low, self.high, self.centre, self.scale)))


class Rows:
    """The training and validation rows of some data sets, normalised, on the device."""

    def __init__(self, folders, device, symmetries, scale=None):
        metas = [json.loads((Path(folder) / "dataset_meta.json").read_text()) for folder in folders]
        self.recipes = [meta.get("config", {}) | {"paths": meta["actual_paths"]} for meta in metas]
        self.theta_max = bending_limit(self.recipes)
        parts = [read(Path(folder), meta) for folder, meta in zip(folders, metas)]
        most = max(part["balls"].shape[1] for part in parts)
        for part in parts:
            part["balls"] = nn.functional.pad(part["balls"], (0, 0, 0, most - part["balls"].shape[1]))
        merged = {key: torch.cat([part[key] for part in parts]).to(device) for key in parts[0]}
        balls, counts = merged["balls"], merged["counts"]
        self.present = torch.arange(most, device=device) < counts.unsqueeze(1)
        self.scale = scale or Scale.of(merged["paths"], merged["tips"], balls[self.present][:, :3], symmetries)
        self.symmetries = Symmetries(balls, self.present) if symmetries else None
        self.paths = self.scale.configuration(merged["paths"])
        self.goals = self.scale.position(merged["tips"])
        self.centres = self.scale.position(balls[..., :3]) * self.present.unsqueeze(-1)
        self.radii = balls[..., 3] / self.scale.scale
        self.train = (merged["split"] == 0).nonzero().squeeze(1)
        self.validation = (merged["split"] == 1).nonzero().squeeze(1)[:VALIDATION_ROWS]

    def batch(self, rows, generator):
        """The rows' paths, goals and scenes, each through a symmetry of its scene where those are wanted."""
        paths, goals = self.paths[rows], self.goals[rows]
        if self.symmetries:
            paths, goals = moved(paths, goals, self.symmetries.draw(rows, generator))
        return paths, goals, (self.centres[rows], self.radii[rows], self.present[rows])


def bending_limit(recipes):
    """The one limit of all data, rad; the authors' format does not say it, and theirs is a right angle."""
    limits = {recipe.get("bending_limit_rad", math.pi / 2) for recipe in recipes}
    if len(limits) > 1:
        raise SystemExit(f"data of robots with different bending limits: {sorted(limits)} rad")
    return limits.pop()


def read(folder, meta):
    """The rows of one data set that do not collide, balls padded to the largest number [rows, balls, 4]."""
    arrays = np.load(folder / "dataset.npz")
    offsets = arrays["obstacle_offsets"]
    counts = np.diff(offsets)
    centres = arrays["obstacle_centres"].reshape(-1, 3)
    radii = arrays["obstacle_radii"] if "obstacle_radii" in arrays else np.full(len(centres), meta["sphere_radius"])
    balls = np.zeros((len(counts), counts.max(initial=0), 4), np.float32)
    row = np.repeat(np.arange(len(counts)), counts)
    balls[row, np.arange(len(centres)) - offsets[row]] = np.column_stack([centres, radii])
    clear = arrays["clearances"] >= 0 if "clearances" in arrays else np.ones(len(counts), bool)
    print(f"{folder}: {clear.sum()} of {len(clear)} rows are clear", flush=True)
    columns = {
        "paths": arrays["paths"].astype(np.float32), "tips": arrays["target_tips"].astype(np.float32),
        "split": arrays["split_indices"], "counts": counts, "balls": balls,
    }  # fmt: skip
    return {key: torch.from_numpy(np.ascontiguousarray(value[clear])) for key, value in columns.items()}


class Diffusion:
    """The forward process and the loss."""

    def __init__(self, model, device, bf16):
        share = cosine_schedule(STEPS).to(device)
        self.signal, self.noise = share.sqrt().float(), (1 - share).sqrt().float()
        self.model, self.device, self.bf16 = model, device, bf16
        self.compiled = torch.compile(self.loss)

    def loss(self, paths, goals, scene, steps, noise):
        """Mean squared error of the predicted noise over frames 1..63; the first frame is given."""
        signal, spread = self.signal[steps].view(-1, 1, 1), self.noise[steps].view(-1, 1, 1)
        noisy = torch.cat([paths[:, :1], (signal * paths + spread * noise)[:, 1:]], dim=1)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.bf16):
            context = self.model.embed(steps, paths[:, 0], goals, scene)
            predicted = self.model(noisy, context)
        return ((predicted - noise)[:, 1:] ** 2).mean()

    def random_loss(self, rows, picks, generator, operation):
        paths, goals, scene = rows.batch(picks, generator)
        steps = torch.randint(STEPS, (len(picks),), generator=generator, device=self.device)
        noise = torch.randn(paths.shape, generator=generator, device=self.device)
        return operation(paths, goals, scene, steps, noise)


class Run:
    """Everything a training run changes, saved and restored as a whole, and the facts that it may not change."""

    def __init__(self, arguments, rows, device):
        self.model = TemporalUnet(arguments.width).to(device)
        self.average = TemporalUnet(arguments.width).to(device)
        self.average.load_state_dict(self.model.state_dict())
        captured = device.type == "cuda"
        rate = torch.tensor(arguments.rate, device=device) if captured else arguments.rate
        self.optimiser = torch.optim.AdamW(
            self.model.parameters(), lr=rate, weight_decay=1e-4, fused=True, capturable=captured
        )
        self.generator = torch.Generator(device=device).manual_seed(arguments.seed)
        self.updates, self.seconds, self.cool_down = 0, 0.0, arguments.cool_down
        self.facts = {name: getattr(arguments, name) for name in ("width", "seed", "batch", "rate", "average", "symmetries")}
        self.facts |= {"products": "bf16" if arguments.bf16 else "f32", "begun_from": "nothing", "before": NOTHING_DONE}
        self.facts |= {"rows": len(rows.train), "theta_max": rows.theta_max, "data": json.dumps(rows.recipes)}

    def save(self, file, rows, record):
        state = {name: getattr(self, name).state_dict() for name in ("model", "average", "optimiser")}
        state |= {"generator": self.generator.get_state(), "updates": self.updates, "seconds": self.seconds}
        state |= {"facts": self.facts, "cool_down": self.cool_down, "record": record, "scale": rows.scale.tensors()}
        part = file.with_suffix(".part")
        torch.save(state, part)
        part.replace(file)

    def begin_from(self, state, name):
        """Takes another run's weights and what has been done for them, and nothing else."""
        for model in (self.model, self.average):
            model.load_state_dict(state["average"])
        self.facts |= {"begun_from": f"{name}, {state['done']['updates']} updates", "before": state["done"]}

    def restore(self, state):
        here = self.facts | {name: state["facts"][name] for name in ("begun_from", "before")}
        for name, there in state["facts"].items():
            if here[name] != there:
                raise SystemExit(f"the checkpoint is of another run: its {name} is {there}, not {here[name]}")
        self.facts = here
        for name in ("model", "average", "optimiser"):
            getattr(self, name).load_state_dict(state[name])
        self.generator.set_state(state["generator"].cpu())
        self.updates, self.seconds = state["updates"], state["seconds"]


class Captured:
    """An operation of the accelerator as a graph, which replays it without the processor's share of the work."""

    def __init__(self, operation, generator):
        self.operation, self.left = operation, UPDATES_BEFORE_CAPTURE
        self.graph = torch.cuda.CUDAGraph()
        self.graph.register_generator_state(generator)
        self.stream = torch.cuda.Stream()

    def __call__(self):
        if self.left > 0:
            return self.before_capture()
        if self.left == 0:
            self.left = -1
            with torch.cuda.graph(self.graph, stream=self.stream):
                self.result = self.operation()
        self.graph.replay()
        return self.result.clone()

    def before_capture(self):
        """The first calls compile and allocate, which a graph cannot."""
        self.left -= 1
        self.stream.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(self.stream):
            result = self.operation()
        torch.cuda.current_stream().wait_stream(self.stream)
        return result


def descent(run, diffusion, rows, batch):
    """The operation of one update: draws a batch, changes the model, gives the loss."""

    def descend():
        picks = torch.randint(len(rows.train), (batch,), generator=run.generator, device=diffusion.device)
        run.optimiser.zero_grad(set_to_none=True)
        loss = diffusion.random_loss(rows, rows.train[picks], run.generator, diffusion.compiled)
        loss.backward()
        nn.utils.clip_grad_norm_(run.model.parameters(), 1.0)
        run.optimiser.step()
        return loss.detach()

    return Captured(descend, run.generator) if diffusion.device.type == "cuda" else descend


def set_rate(optimiser, rate):
    for group in optimiser.param_groups:
        if isinstance(group["lr"], torch.Tensor):
            group["lr"].fill_(rate)
        else:
            group["lr"] = rate


def step(run, descend, arguments):
    """One update; returns the loss. The rate falls to nothing over the last `cool_down` updates."""
    left = (arguments.updates - run.updates) / max(arguments.cool_down, 1)
    set_rate(run.optimiser, arguments.rate * min(1.0, (run.updates + 1) / WARM_UP_UPDATES, left))
    loss = descend()
    run.updates += 1
    if run.updates % AVERAGE_EVERY == 0:
        keep = min(arguments.average**AVERAGE_EVERY, run.updates / (run.updates + 10 * AVERAGE_EVERY))
        with torch.no_grad():
            torch._foreach_lerp_(list(run.average.parameters()), list(run.model.parameters()), 1.0 - keep)
    return loss


@torch.no_grad()
def validate(run, diffusion, rows):
    """The averaged model's loss on held-out targets, always with the same steps and noise."""
    generator = torch.Generator(device=diffusion.device).manual_seed(1)
    averaged = Diffusion(run.average, diffusion.device, diffusion.bf16)
    chunks = rows.validation.split(256)
    losses = [averaged.random_loss(rows, chunk, generator, averaged.loss) * len(chunk) for chunk in chunks]
    return float(sum(losses) / len(rows.validation)) if chunks and len(rows.validation) else math.nan


def done(state):
    """What a run has done for its weights, with the runs that it goes on from."""
    facts, updates = state["facts"], state["updates"]
    here = {"updates": updates, "rows_used": updates * facts["batch"], "training_rows": facts["rows"]}
    here |= {"training_seconds": round(state["seconds"]), "data": json.loads(facts["data"])}
    return {name: before + here[name] for name, before in facts["before"].items()}


def checkpoint_of(file, device):
    """A run's checkpoint; those without the totals of the runs before are of a first run, or are refused."""
    state = torch.load(file, map_location=device, weights_only=True)
    if "before" not in state["facts"] and state["facts"]["begun_from"] != "nothing":
        raise SystemExit(f"{file} does not say what was done before it for the weights of {state['facts']['begun_from']}")
    state["facts"].setdefault("before", NOTHING_DONE)
    return state


def state_of(source, device):
    """A run's checkpoint, or of a weights file what a new run begins with: averaged weights, scale and what was done for them."""
    if source.suffix != ".safetensors":
        state = checkpoint_of(source, device)
        return state | {"done": done(state)}
    with safe_open(source, "pt", device=str(device)) as file:
        facts, tensors = file.metadata() or {}, {name: file.get_tensor(name) for name in file.keys()}
    if facts.get("architecture") != ARCHITECTURE:
        raise SystemExit(f"{source} has weights of {facts.get('architecture')}, and those of {ARCHITECTURE} are needed")
    scale = {name: tensors.pop(name) for name in SCALE_TENSORS}
    facts.setdefault("rows_used", str(int(facts["updates"]) * int(facts["batch"])))
    return {"average": tensors, "scale": scale, "done": {name: json.loads(facts[name]) for name in NOTHING_DONE}}


def begin(arguments, device):
    """The run, from its checkpoint, from another one's weights, or from nothing; and its rows."""
    checkpoint = Path(arguments.checkpoint)
    source = checkpoint if checkpoint.exists() else arguments.begin_from
    state = state_of(Path(source), device) if source else None
    scale = state and Scale(*state["scale"].values())
    if scale and arguments.symmetries and not scale.is_symmetric():
        raise SystemExit(f"{source} was trained without --symmetries: its scale is not the same in all directions")
    rows = Rows(arguments.data, device, arguments.symmetries, scale)
    run = Run(arguments, rows, device)
    if checkpoint.exists():
        run.restore(state)
    elif state:
        run.begin_from(state, Path(source).stem)
    return run, rows


def train(arguments):
    """Trains, with checkpoints; the state before the cool-down stays, so that a longer run can go on from it."""
    torch.manual_seed(arguments.seed)
    torch.set_num_threads(arguments.threads)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    checkpoint = Path(arguments.checkpoint)
    checkpoint.parent.mkdir(parents=True, exist_ok=True)
    run, rows = begin(arguments, device)
    diffusion = Diffusion(run.model, device, arguments.bf16)
    print(f"{len(rows.train)} training rows, {len(rows.validation)} to validate, from update {run.updates}", flush=True)
    descend = descent(run, diffusion, rows, arguments.batch)
    began, losses, record = time.monotonic() - run.seconds, [], {}
    while run.updates < arguments.updates:
        losses.append(step(run, descend, arguments))
        run.seconds = time.monotonic() - began
        stays = run.updates == arguments.updates - arguments.cool_down or run.updates % arguments.keep == 0
        if run.updates % arguments.every == 0 or stays or run.updates == arguments.updates:
            record = {"update": run.updates, "seconds": round(run.seconds, 1), "loss": float(torch.stack(losses).mean())}
            record["validation_loss"] = validate(run, diffusion, rows)
            losses.clear()
            print(json.dumps(record), flush=True)
            with checkpoint.with_suffix(".jsonl").open("a") as log:
                log.write(json.dumps(record) + "\n")
            run.save(checkpoint, rows, record)
            if stays:
                run.save(checkpoint.with_suffix(f".{run.updates}.pt"), rows, record)


def metadata_of(state, recipe, measured, machine):
    """Everything the loader checks, and how the weights were made."""
    facts = state["facts"]
    made = {name: str(facts[name]) for name in ("rate", "products", "begun_from", "average", "symmetries")}
    made["cool_down"] = str(state["cool_down"])
    made["normalisation"] = "configurations to [-1, 1], positions by one centre and one scale: the tensors say"
    told = metadata(facts["width"], facts["theta_max"]) | made | record_of(state, recipe, measured, machine)
    return told | {name: json.dumps(total) for name, total in done(state).items()}


def export(arguments):
    """Writes the averaged weights and the manifest's entry."""
    state = checkpoint_of(arguments.checkpoint, "cpu")
    measured = json.dumps(json.loads(arguments.measured))
    metadata = metadata_of(state, arguments.recipe, measured, arguments.machine or this_machine())
    print(write_weights(Path(arguments.out), arguments.name, state["average"] | state["scale"], metadata))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    checkpoint = {"required": True, "help": "checkpoint, such as weights/checkpoints/mixed.pt; the log is beside it"}

    p = commands.add_parser("train", help="train; goes on from the checkpoint if there is one")
    p.add_argument("--data", required=True, nargs="+", help="folders of data sets from `pcc dataset`")
    p.add_argument("--checkpoint", **checkpoint)
    p.add_argument("--begin-from", help="checkpoint of another run, or weights file, whose weights a new run begins with")
    p.add_argument("--updates", type=int, default=100_000, help="length of the run (default %(default)s, the paper's)")
    p.add_argument("--cool-down", type=int, default=0, help="last updates, over which the rate falls to 0 (default none)")
    p.add_argument("--batch", type=int, default=64, help="rows an update (default %(default)s)")
    p.add_argument("--rate", type=float, default=2e-4, help="learning rate (default %(default)s)")
    p.add_argument("--width", type=int, default=64, help="channels of the first level (default %(default)s)")
    p.add_argument("--threads", type=int, default=1, help="processor threads (default %(default)s)")
    p.add_argument("--seed", type=int, default=0, help="seed of weights, noise and batches (default %(default)s)")
    p.add_argument("--every", type=int, default=1000, help="updates between checkpoints (default %(default)s)")
    p.add_argument("--keep", type=int, default=10_000, help="updates between checkpoints that stay (default %(default)s)")
    p.add_argument("--average", type=float, default=0.995, help="share of the averaged weights kept by an update (default %(default)s)")
    p.add_argument("--symmetries", action="store_true", help="use each row through a random turn or mirror that leaves its scene as it is")
    p.add_argument("--bf16", action="store_true", help="bfloat16 products: faster where the processor has them")
    p.set_defaults(run=train)

    p = commands.add_parser("export", help="write NAME.safetensors and its entry in MANIFEST.toml")
    p.add_argument("--checkpoint", **checkpoint)
    p.add_argument("--name", required=True, help="name of the weights: mixed, free or general")
    p.add_argument("--recipe", required=True, help="how the data was made and the training went, in one line")
    p.add_argument("--machine", help="where and with how many threads it was trained (default: this machine)")
    p.add_argument("--measured", default="{}", help="what `pcc evaluate` measured, as a JSON object")
    p.add_argument("--out", default="weights", help="folder of the weights (default %(default)s)")
    p.set_defaults(run=export)
    arguments = parser.parse_args()
    arguments.run(arguments)


if __name__ == "__main__":
    main()
