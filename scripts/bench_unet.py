#!/usr/bin/env python3
"""Times the network's part of a sample with PyTorch and with ONNX Runtime, order by order.

    scripts/bench_unet.py --weights FOLDER --name NAME

Every line `WHAT THREADS` on standard input is answered by one number:
    torch 2   seconds that ten candidates take over 50 steps with PyTorch, eager, f32
    onnx 2    the same with ONNX Runtime, the network exported from PyTorch
    sgemm 2   10^9 multiply-adds a second of the faster of PyTorch's and NumPy's f32 matrix product, 1024 × 1024 × 1024
The contexts of the 50 steps are computed before and do not count. `crates/denoiser/examples/unet_time.rs` does the same
in Rust. Needs scripts/requirements-bench.txt.
"""

import argparse
import sys
import tempfile
import time
import tomllib
from pathlib import Path

import numpy as np
import onnxruntime
import torch
from safetensors.torch import load_file
from threadpoolctl import threadpool_limits

import unet_model

CANDIDATES = 10
STEPS = 50
START = [0.1] * 6
TARGET = [0.5, 0.3, 2.4]
BALLS = [[0.85, 0.85], [0.85, -0.85], [-0.85, 0.85], [-0.85, -0.85]]
BALL_HEIGHT, BALL_RADIUS = 1.5, 0.4
EXPORT_TOLERANCE = 1e-3
SGEMM_SIZE = 1024
SGEMM_SECONDS = 0.3


@torch.no_grad()
def load(folder: Path, name: str):
    """The network and its contexts [50, 256] from the last step to the first."""
    file = folder / tomllib.loads((folder / "MANIFEST.toml").read_text())[name]["file"]
    tensors = load_file(file)
    prefix = "normalisation."
    scale = {key.removeprefix(prefix): tensors.pop(key) for key in list(tensors) if key.startswith(prefix)}
    model = unet_model.TemporalUnet(tensors["stem.weight"].shape[0]).eval()
    model.load_state_dict(tensors)
    low, high = scale["configuration_low"], scale["configuration_high"]
    start = (2 * (torch.tensor([START]) - low) / (high - low) - 1).expand(STEPS, -1)
    balls = torch.tensor([[*ball, BALL_HEIGHT] for ball in BALLS])
    goal, centres = ((p - scale["position_centre"]) / scale["position_scale"] for p in (torch.tensor([TARGET]), balls))
    radii = torch.full((STEPS, len(BALLS)), BALL_RADIUS) / scale["position_scale"]
    scene = (centres.expand(STEPS, -1, -1), radii, torch.ones(STEPS, len(BALLS), dtype=torch.bool))
    steps = torch.linspace(999, 0, STEPS).round()
    return model, model.embed(steps, start, goal.expand(STEPS, -1), scene)


def export(model, paths, context, file: Path):
    """Writes the network for ten candidates and checks that ONNX Runtime has the same noise."""
    names = {"input_names": ["paths", "context"], "output_names": ["noise"]}
    # The exporter reports its progress on standard output, which is for the answers.
    answers, sys.stdout = sys.stdout, sys.stderr
    torch.onnx.export(model, (paths, context), file, dynamo=True, **names)
    sys.stdout = answers
    found = session(file, 1).run(None, {"paths": paths.numpy(), "context": context.numpy()})[0]
    error = np.abs(found - model(paths, context).detach().numpy()).max()
    if not error < EXPORT_TOLERANCE:
        sys.exit(f"bench_unet: the exported network is off by {error}")


def session(file: Path, threads: int):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    return onnxruntime.InferenceSession(file, options, providers=["CPUExecutionProvider"])


def seconds(sample) -> float:
    """A second run of 50: the first one after a pause is not what is measured."""
    sample(2)
    began = time.perf_counter()
    sample(STEPS)
    return time.perf_counter() - began


def sgemm_rate(product) -> float:
    """The best of several products, 10^9 multiply-adds a second."""
    until, best = time.perf_counter() + SGEMM_SECONDS, 0.0
    while time.perf_counter() < until:
        began = time.perf_counter()
        product()
        best = max(best, SGEMM_SIZE**3 / (time.perf_counter() - began) / 1e9)
    return best


@torch.inference_mode()
def answer(order, model, paths, contexts, sessions):
    what, threads = order.split()
    torch.set_num_threads(int(threads))
    wide = [context.expand(CANDIDATES, -1).contiguous() for context in contexts]

    def torch_sample(count):
        for context in wide[:count]:
            model(paths, context)

    def onnx_sample(count):
        for context in wide[:count]:
            sessions[int(threads)].run(None, {"paths": paths.numpy(), "context": context.numpy()})

    if what == "torch":
        return seconds(torch_sample)
    if what == "onnx":
        return seconds(onnx_sample)
    if what == "sgemm":
        a, b = torch.randn(2, SGEMM_SIZE, SGEMM_SIZE)
        with threadpool_limits(int(threads)):
            return max(sgemm_rate(lambda: torch.mm(a, b)), sgemm_rate(lambda: np.matmul(a.numpy(), b.numpy())))
    sys.exit(f"bench_unet: {what}: torch, onnx and sgemm are known")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--weights", type=Path, default=Path("weights"))
    parser.add_argument("--name", default="mixed")
    arguments = parser.parse_args()
    torch.manual_seed(0)
    with tempfile.TemporaryDirectory() as folder:
        model, contexts = load(arguments.weights, arguments.name)
        paths = torch.randn(CANDIDATES, unet_model.HORIZON, 6)
        # The contexts are known; the exporter takes a module of this name for its own.
        del model.graph
        file = Path(folder) / "unet.onnx"
        export(model, paths, contexts[:1].expand(CANDIDATES, -1).contiguous(), file)
        sessions = {threads: session(file, threads) for threads in (1, 2)}
        print(f"torch {torch.__version__}, onnxruntime {onnxruntime.__version__}", flush=True)
        for order in sys.stdin:
            print(answer(order, model, paths, contexts, sessions), flush=True)


if __name__ == "__main__":
    main()
