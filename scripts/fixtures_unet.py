#!/usr/bin/env python3
"""Writes what the Rust denoiser's parity tests compare with: random weights, inputs, and PyTorch's output of every layer.

    scripts/fixtures_unet.py                                  # the small fixture of crates/denoiser/tests
    scripts/fixtures_unet.py --width 64 --context 256 --graph 128 --out FOLDER   # the shipped size

Three cases with 0, 1 and 4 balls; time-major. Needs scripts/requirements-train.txt.
"""

import argparse
import pathlib

import torch
import unet_model
from safetensors.torch import save_file
from torch import Tensor, nn
from weights_export import write_weights

BALLS = [0, 1, 4]
STEPS = [999.0, 500.0, 3.0]
LIMIT = 1.5707963267948966
EMBEDDINGS = ("time", "start", "goal", "graph.node", "graph.pool", "context")
CONVOLUTIONS = ("stem", "down.0.shrink", "down.1.shrink", "up.0.grow", "up.1.grow")


def random_model(width: int) -> nn.Module:
    """PyTorch's initial weights, with normalisations that do something."""
    model = unet_model.TemporalUnet(width)
    for name, values in model.named_parameters():
        if "norm" in name or name.endswith("empty"):
            values.data += 0.3 * torch.randn_like(values)
    return model


def random_normalisation() -> dict[str, Tensor]:
    low = -1.5 - 0.1 * torch.arange(6)
    return {
        "configuration_low": low,
        "configuration_high": low + 3.0 + 0.2 * torch.arange(6),
        "position_centre": torch.tensor([0.1, -0.2, 1.3]),
        "position_scale": torch.tensor([2.5]),
    }


def random_inputs() -> dict[str, Tensor]:
    cases = len(BALLS)
    radii = 0.2 + 0.2 * torch.rand(sum(BALLS), 1)
    return {
        "step": torch.tensor(STEPS),
        "start": torch.randn(cases, 6),
        "target": torch.randn(cases, 3),
        "balls": torch.cat([torch.randn(sum(BALLS), 3), radii], dim=1),
        "paths": torch.randn(cases, unet_model.HORIZON, 6),
        "cotangent": torch.randn(cases, unet_model.HORIZON, 6),
    }


def record(model: nn.Module) -> dict[str, list[Tensor]]:
    """Notes the output, without the batch of one, of every layer at each call from now on."""
    layers: dict[str, list[Tensor]] = {}

    def note(name: str, output: Tensor):
        layers.setdefault(name, []).append(output[0].detach())

    kinds = (unet_model.Block, unet_model.GraphLayer)
    for name, module in model.named_modules():
        if isinstance(module, kinds) or name in EMBEDDINGS:
            module.register_forward_hook(lambda _, __, output, name=name: note(name, output))
    convolve = unet_model.convolve
    names = {model.get_submodule(name): name for name in CONVOLUTIONS}

    def noting(layer: nn.Module, x: Tensor) -> Tensor:
        output = convolve(layer, x)
        if layer in names:
            note(names[layer], output)
        return output

    unet_model.convolve = noting
    return layers


def run(model: nn.Module, normalisation: dict[str, Tensor], inputs: dict[str, Tensor]) -> dict[str, Tensor]:
    """Every layer's output for each case, and the gradient."""
    layers = record(model)
    low, high = normalisation["configuration_low"], normalisation["configuration_high"]
    centre, scale = normalisation["position_centre"], normalisation["position_scale"]
    for case, balls in enumerate(inputs["balls"].split(BALLS)):
        start = 2 * (inputs["start"][case : case + 1] - low) / (high - low) - 1
        target = (inputs["target"][case : case + 1] - centre) / scale
        present = torch.ones(1, len(balls), dtype=torch.bool)
        scene = (((balls[:, :3] - centre) / scale)[None], (balls[:, 3] / scale)[None], present)
        context = model.embed(inputs["step"][case : case + 1], start, target, scene)
        paths = inputs["paths"][case : case + 1].clone().requires_grad_()
        noise = model(paths, context)
        (gradient,) = torch.autograd.grad(noise, paths, inputs["cotangent"][case : case + 1])
        layers.setdefault("noise", []).append(noise[0].detach())
        layers.setdefault("gradient", []).append(gradient[0])
    per_ball = ("graph.node", "graph.layers")
    joined = {name: torch.cat(found) if name.startswith(per_ball) else torch.stack(found) for name, found in layers.items()}
    return {name: values.contiguous() for name, values in joined.items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--width", type=int, default=16)
    parser.add_argument("--context", type=int, default=32)
    parser.add_argument("--graph", type=int, default=16, help="width of the obstacle graph")
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("crates/denoiser/tests/fixtures/unet"))
    arguments = parser.parse_args()
    torch.manual_seed(3)
    unet_model.CONTEXT, unet_model.GRAPH = arguments.context, arguments.graph
    model, normalisation, inputs = random_model(arguments.width), random_normalisation(), random_inputs()
    weights = {f"normalisation.{name}": values for name, values in normalisation.items()} | model.state_dict()
    made = {"recipe": "random, for the parity test", "updates": "0", "training_seconds": "0", "measured": "{}"}
    write_weights(arguments.out, "unet", weights, unet_model.metadata(arguments.width, LIMIT) | made)
    given = {f"input.{name}": values for name, values in inputs.items()}
    save_file(given | run(model, normalisation, inputs), arguments.out / "layers.safetensors")


if __name__ == "__main__":
    main()
