#!/usr/bin/env python3
"""Writes what the sampler's parity test compares with: samples of a small network by PyTorch.

    scripts/fixtures_sampling.py     # reads tests/data/reference-mixed-sample, writes crates/planning/tests/fixtures

The network is trained for a minute: the reverse process of a random one amplifies rounding errors without bound.

DDIM and both refinements follow docs/evaluation.md "Sampling"; forces come from automatic differentiation of the forward
kinematics. Needs scripts/requirements-train.txt.
"""

import math
from pathlib import Path

import torch
import train_unet
import unet_model
from safetensors.torch import save_file
from torch import Tensor
from weights_export import write_weights

ROOT = Path(__file__).resolve().parent.parent
CANDIDATES = 2
WIDTH = 16
UPDATES = 1500
STEPS = 50
REFINED = 20
TUBE = 0.2
START = torch.tensor([0.3, -0.2, 0.1, 0.4, -0.3, 0.2])
TARGET = torch.tensor([0.9, -0.7, 2.1])
# grazed, not crossed: deep in a ball the deepest point changes from frame to frame, and rounding errors grow
BALLS = torch.tensor([[1.0, 0.1, 1.4, 0.1], [-0.7, 0.5, 1.6, 0.15], [0.1, -0.9, 1.2, 0.1]])


def section(xi: Tensor, fraction: float) -> tuple[Tensor, Tensor]:
    """Rotation [..., 3, 3] and end [..., 3] of the first part of a section of length 1."""
    a, b = (xi * fraction).unbind(-1)
    zero, s = torch.zeros_like(a), a * a + b * b
    small = s < 1e-8
    theta = torch.sqrt(torch.where(small, torch.ones_like(s), s))
    sine = torch.where(small, 1 - s / 6, theta.sin() / theta)
    versine = torch.where(small, 0.5 - s / 24, 2 * (theta / 2).sin() ** 2 / theta**2)
    w = torch.stack([zero, zero, b, zero, zero, -a, -b, a, zero], -1).unflatten(-1, (3, 3))
    end = fraction * torch.stack([versine * b, -versine * a, sine], -1)
    return torch.eye(3) + sine[..., None, None] * w + versine[..., None, None] * w @ w, end


def points(shape: Tensor) -> Tensor:
    """Nine points [..., 9, 3] of the backbone, the tip last."""
    rotation, base, out = torch.eye(3), torch.zeros(3), []
    for k in range(3):
        xi = shape[..., 2 * k : 2 * k + 2]
        for fraction in (1 / 3, 2 / 3, 1.0):
            turn, end = section(xi, fraction)
            out.append(base + (rotation @ end.unsqueeze(-1)).squeeze(-1))
        rotation, base = rotation @ turn, out[-1]
    return torch.stack(out, -2)


def force(shapes: Tensor, balls: Tensor, tip_weight: float, push_weight: float) -> Tensor:
    """Minus the weighted energy gradients [candidates, 64, 6] at shapes of that size."""
    shapes = shapes.detach().requires_grad_(True)
    body = points(shapes)
    energy = tip_weight * 0.5 * ((body[:, -1, -1] - TARGET) ** 2).sum()
    if len(balls):
        offset = body.unsqueeze(-2) - balls[:, :3]
        distance = offset.norm(dim=-1) - balls[:, 3]
        nearest = distance.flatten(2).argmin(-1)
        deepest = torch.gather(offset.flatten(2, 3), 2, nearest[..., None, None].expand(-1, -1, 1, 3)).squeeze(2)
        radius = balls[nearest % len(balls), 3] + 1.5 * TUBE
        inside = (distance.flatten(2).amin(-1) < 1.5 * TUBE).to(body.dtype)
        flat = deepest[..., :2].norm(dim=-1)
        wanted = (radius**2 - deepest[..., 2] ** 2).clamp(min=0).sqrt()
        out = torch.cat([deepest[..., :2] * ((wanted - flat) / flat).unsqueeze(-1), torch.zeros_like(flat)[..., None]], -1)
        energy = energy - push_weight * (inside.unsqueeze(-1) * out.detach() * deepest).sum()
    (gradient,) = torch.autograd.grad(energy, shapes)
    gradient[:, 0] = 0
    return -gradient


class Process:
    def __init__(self):
        rows = train_unet.Rows([ROOT / "tests/data/reference-mixed-sample"], torch.device("cpu"))
        rows.train = torch.arange(len(rows.paths))
        self.low, self.high, self.centre, self.scale = rows.scale.tensors().values()
        unet_model.CONTEXT, unet_model.GRAPH = 32, 16
        self.model = unet_model.TemporalUnet(WIDTH)
        self.train(rows)
        share = unet_model.cosine_schedule()
        self.signal, self.noise = share.sqrt(), (1 - share).sqrt()

    def train(self, rows: train_unet.Rows):
        diffusion = train_unet.Diffusion(self.model, torch.device("cpu"), bf16=False)
        optimiser = torch.optim.AdamW(self.model.parameters(), lr=2e-3)
        generator = torch.Generator().manual_seed(0)
        for update in range(UPDATES):
            picks = torch.randint(len(rows.train), (64,), generator=generator)
            loss = diffusion.random_loss(rows, picks, generator, diffusion.loss)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            if update % 200 == 0:
                print(f"update {update}: loss {loss:.3f}", flush=True)
        self.model.requires_grad_(False)

    def write_weights(self, folder: Path):
        recipe = "for the parity test, trained on tests/data/reference-mixed-sample"
        made = {"recipe": recipe, "seed": "11", "updates": str(UPDATES), "training_seconds": "0", "measured": "{}"}
        metadata = unet_model.metadata(WIDTH, math.pi / 2) | made
        scale = train_unet.Scale(self.low, self.high, self.centre, self.scale).tensors()
        write_weights(folder, "sampled", self.model.state_dict() | scale, metadata)

    def physical(self, x: Tensor) -> Tensor:
        return self.low + (x + 1) / 2 * (self.high - self.low)

    def normalised(self, shape: Tensor) -> Tensor:
        return 2 * (shape - self.low) / (self.high - self.low) - 1

    def predict(self, x: Tensor, step: int, balls: Tensor) -> Tensor:
        count = len(x)
        centres = ((balls[:, :3] - self.centre) / self.scale).expand(count, -1, -1)
        radii = (balls[:, 3] / self.scale).expand(count, -1)
        scene = (centres, radii, torch.ones(count, len(balls), dtype=torch.bool))
        start = self.normalised(START).expand(count, -1)
        goal = ((TARGET - self.centre) / self.scale).expand(count, -1)
        context = self.model.embed(torch.full((count,), step), start, goal, scene)
        return self.model(x, context)

    def guided(self, x: Tensor, step: int, balls: Tensor) -> Tensor:
        """Predicted noise plus sqrt(1 - share) times the energy's gradient with respect to x."""
        signal, noise = float(self.signal[step]), float(self.noise[step])
        x = x.detach().requires_grad_(True)
        predicted = self.predict(x, step, balls)
        estimate = (x - noise * predicted) / signal
        slope = -force(self.physical(estimate), balls, 50.0, 50.0) * (self.high - self.low) / 2
        (gradient,) = torch.autograd.grad(estimate, x, slope)
        return (predicted + noise * gradient).detach()

    def ddim(self, start_noise: Tensor, balls: Tensor, refinement: str, steps: int = STEPS) -> Tensor:
        visited = [round(v) for v in torch.linspace(0, 999, steps, dtype=torch.float64).tolist()][::-1]
        x, held = start_noise.clone(), self.normalised(START)
        x[:, 0] = held
        for index, step in enumerate(visited):
            active = index >= steps - max(round(0.4 * steps), 1)
            signal, noise = float(self.signal[step]), float(self.noise[step])
            guided = active and refinement == "guided"
            predicted = self.guided(x, step, balls) if guided else self.predict(x, step, balls)
            estimate = ((x - noise * predicted) / signal).clamp(-1, 1)
            if active and refinement == "post":
                shapes = self.physical(estimate)
                estimate = self.normalised(shapes + force(shapes, balls, 0.1, 5.0))
                estimate[:, 0] = ((x - noise * predicted) / signal).clamp(-1, 1)[:, 0]
            following = visited[index + 1] if index + 1 < steps else None
            signal, noise = (1.0, 0.0) if following is None else (float(self.signal[following]), float(self.noise[following]))
            x = signal * estimate + noise * predicted
            x[:, 0] = held
        return self.physical(x)


def main():
    torch.manual_seed(11)
    torch.set_num_threads(1)
    process = Process()
    noise = torch.randn(CANDIDATES, unet_model.HORIZON, 6)
    tensors = {"start": START, "target": TARGET, "balls": BALLS, "noise": noise}
    for name, balls in (("free", BALLS[:0]), ("mixed", BALLS)):
        for refinement in ("pure", "post"):
            tensors[f"{name}.{refinement}"] = process.ddim(noise, balls, refinement)
        tensors[f"{name}.guided"] = process.ddim(noise, balls, "guided", 10)
    folder = ROOT / "crates/planning/tests/fixtures"
    process.write_weights(folder)
    file = folder / "sampling.safetensors"
    save_file({key: value.contiguous() for key, value in tensors.items()}, file)
    file.chmod(0o644)
    spread = {key: f"{value.std():.3f}" for key, value in tensors.items() if "." in key}
    print(f"{file}: standard deviations {spread}, {math.prod(noise.shape)} values each")


if __name__ == "__main__":
    main()
