"""The paper's denoiser in PyTorch: temporal U-Net, FiLM, obstacle graph (docs/evaluation.md "Network").

Paths are [batch, 64, 6] in normalised configuration, scenes are padded to the batch's largest number of balls:
centres [batch, balls, 3] and radii [batch, balls] in normalised positions, `present` [batch, balls] tells real balls.
The layers' names are those of the weights file, which `crates/denoiser` reads.
"""

import math

import torch
from torch import Tensor, nn
from torch.nn import functional as F

ARCHITECTURE = "temporal-unet-v1"
SCHEDULE = "cosine, offset 0.008, betas within [1e-8, 0.999]; the network predicts the noise"
STEPS = 1000
HORIZON = 64
CONTEXT = 256
GRAPH = 128
GROUPS = 8


def perceptron(inputs: int, hidden: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(inputs, hidden), nn.SiLU(), nn.Linear(hidden, outputs))


def windows(x: Tensor) -> Tensor:
    """Every frame of x [batch, frames, channels] with its two neighbours [batch * frames, 3 * channels]; 0 outside."""
    padded = F.pad(x, (0, 0, 1, 1))
    return torch.cat([padded[:, :-2], x, padded[:, 2:]], dim=-1).flatten(0, 1)


class ThreeTaps(torch.autograd.Function):
    """x [batch, frames, inputs] with a weight [3, inputs, outputs] along the frames; both ways products of windows."""

    @staticmethod
    def forward(x: Tensor, weight: Tensor) -> Tensor:
        return (windows(x) @ weight.flatten(0, 1)).unflatten(0, x.shape[:2])

    @staticmethod
    def setup_context(ctx, inputs: tuple[Tensor, Tensor], output: Tensor):
        ctx.save_for_backward(*inputs)

    @staticmethod
    def backward(ctx, gradient: Tensor) -> tuple[Tensor, Tensor]:
        x, weight = ctx.saved_tensors
        around = windows(gradient)
        to_x = (around @ weight.flip(0).transpose(1, 2).flatten(0, 1)).view_as(x)
        to_weight = (x.flatten(0, 1).T @ around).unflatten(1, (3, -1)).transpose(0, 1).flip(0)
        return to_x, to_weight


def convolve(layer: nn.Conv1d | nn.ConvTranspose1d, x: Tensor) -> Tensor:
    """The layer along the frames of x [batch, frames, channels].

    PyTorch's own convolution is the faster one forwards, but twice as slow as products of windows backwards.
    """
    return (by_products if torch.is_grad_enabled() else natively)(layer, x)


def natively(layer: nn.Conv1d | nn.ConvTranspose1d, x: Tensor) -> Tensor:
    """As a convolution of images one pixel high with the channels last: the fastest of the forms that PyTorch has."""
    image = x.transpose(1, 2).unsqueeze(2)
    weight, stride, padding = layer.weight.unsqueeze(2), (1, *layer.stride), (0, *layer.padding)
    operation = F.conv_transpose2d if isinstance(layer, nn.ConvTranspose1d) else F.conv2d
    return operation(image, weight, layer.bias, stride, padding).squeeze(2).transpose(1, 2).float()


def by_products(layer: nn.Conv1d | nn.ConvTranspose1d, x: Tensor) -> Tensor:
    """As products in autocast's precision, the result in f32.

    A layer of four taps and stride two is one of three taps on pairs of frames.
    """
    kind = torch.get_autocast_dtype(x.device.type) if torch.is_autocast_enabled(x.device.type) else x.dtype
    x, weight = x.to(kind), layer.weight.to(kind)
    if layer.kernel_size == (1,):
        return x @ weight.squeeze(2).T + layer.bias
    if layer.kernel_size == (3,):
        return ThreeTaps.apply(x, weight.permute(2, 1, 0)) + layer.bias
    taps = F.pad(weight, (1, 1)).unflatten(2, (3, 2))
    if isinstance(layer, nn.ConvTranspose1d):
        pairs = ThreeTaps.apply(x, taps.flip(2).permute(2, 0, 3, 1).flatten(2))
        return pairs.unflatten(2, (2, -1)).flatten(1, 2) + layer.bias
    return ThreeTaps.apply(x.unflatten(1, (-1, 2)).flatten(2), taps.permute(2, 3, 1, 0).flatten(1, 2)) + layer.bias


def group_means(x: Tensor, count: int) -> Tensor:
    """Means over `count` groups of the channels of x [.., channels], each at all channels of its group.

    With gradients a product brings them there: by indices, the compiler would not vectorise.
    """
    size = x.shape[-1] // count
    if not torch.is_grad_enabled():
        return x.unflatten(-1, (count, size)).mean(-1).repeat_interleave(size, dim=-1)
    members = torch.eye(count, device=x.device).repeat_interleave(size, dim=0)
    with torch.autocast(x.device.type, enabled=False):
        return x @ members @ (members.T / size)


def group_scale(norm: nn.GroupNorm, x: Tensor) -> tuple[Tensor, Tensor]:
    """Group normalisation of x [batch, frames, channels] as a scale and a shift [batch, 1, channels]."""
    moments = torch.stack([x.mean(1), (x * x).mean(1)])
    centre, square = group_means(moments, norm.num_groups).unbind()
    scale = norm.weight * torch.rsqrt((square - centre**2).clamp(min=0) + norm.eps)
    return scale.unsqueeze(1), (norm.bias - centre * scale).unsqueeze(1)


class Block(nn.Module):
    """A residual block that the context scales and shifts (FiLM)."""

    def __init__(self, inputs: int, outputs: int):
        super().__init__()
        self.norm1 = nn.GroupNorm(GROUPS, inputs)
        self.conv1 = nn.Conv1d(inputs, outputs, 3, padding=1)
        self.film = nn.Linear(CONTEXT, 2 * outputs)
        self.norm2 = nn.GroupNorm(GROUPS, outputs)
        self.conv2 = nn.Conv1d(outputs, outputs, 3, padding=1)
        if inputs != outputs:
            self.skip = nn.Conv1d(inputs, outputs, 1)

    def forward(self, x: Tensor, context: Tensor) -> Tensor:
        scale, shift = group_scale(self.norm1, x)
        h = convolve(self.conv1, F.silu(x * scale + shift))
        film_scale, film_shift = self.film(context).float().unsqueeze(1).chunk(2, dim=-1)
        scale, shift = group_scale(self.norm2, h)
        h = convolve(self.conv2, F.silu(h * (scale * (1 + film_scale)) + (shift * (1 + film_scale) + film_shift)))
        return h + (convolve(self.skip, x) if hasattr(self, "skip") else x)


class GraphLayer(nn.Module):
    """One round of messages between all pairs of balls."""

    def __init__(self):
        super().__init__()
        self.message = perceptron(2 * GRAPH + 4, GRAPH, GRAPH)
        self.update = perceptron(2 * GRAPH, GRAPH, GRAPH)
        self.norm = nn.LayerNorm(GRAPH)

    def forward(self, x: Tensor, relative: Tensor, pairs: Tensor) -> Tensor:
        count = x.shape[1]
        receiver = x.unsqueeze(2).expand(-1, -1, count, -1)
        sender = x.unsqueeze(1).expand(-1, count, -1, -1)
        messages = self.message(torch.cat([receiver, sender, relative], dim=-1))
        received = (messages * pairs.unsqueeze(-1)).sum(dim=2)
        return self.norm(x + self.update(torch.cat([x, received], dim=-1)))


class Graph(nn.Module):
    """Any number of balls to one vector."""

    def __init__(self):
        super().__init__()
        self.node = perceptron(4, GRAPH, GRAPH)
        self.layers = nn.ModuleList([GraphLayer(), GraphLayer()])
        self.pool = perceptron(2 * GRAPH + 1, CONTEXT, CONTEXT)
        self.empty = nn.Parameter(torch.zeros(2 * GRAPH))

    def forward(self, centres: Tensor, radii: Tensor, present: Tensor) -> Tensor:
        count = present.sum(dim=1, keepdim=True).to(centres.dtype)
        log_count = torch.log1p(count)
        if centres.shape[1] == 0:
            pooled = self.empty.expand(len(centres), -1)
            return self.pool(torch.cat([pooled, log_count], dim=1))
        x = self.node(torch.cat([centres, radii.unsqueeze(-1)], dim=-1))
        offset = centres.unsqueeze(1) - centres.unsqueeze(2)
        relative = torch.cat([offset, torch.sqrt((offset**2).sum(-1, keepdim=True) + 1e-12)], dim=-1)
        others = ~torch.eye(centres.shape[1], dtype=torch.bool, device=centres.device)
        pairs = (present.unsqueeze(1) & present.unsqueeze(2) & others).to(x.dtype)
        for layer in self.layers:
            x = layer(x, relative, pairs)
        weights = present.unsqueeze(-1).to(x.dtype)
        mean = (x * weights).sum(1) / count.clamp(min=1)
        largest = x.masked_fill(~present.unsqueeze(-1), -torch.inf).amax(1)
        pooled = torch.where(count > 0, torch.cat([mean, largest], dim=1), self.empty)
        return self.pool(torch.cat([pooled, log_count], dim=1))


class TemporalUnet(nn.Module):
    """Predicts the noise of a noisy path."""

    def __init__(self, width: int = 64):
        super().__init__()
        widths = [width, 2 * width, 4 * width]
        self.width = width
        self.stem = nn.Conv1d(7, width, 3, padding=1)
        self.down = nn.ModuleList()
        for level, outputs in enumerate(widths):
            inputs = widths[max(level - 1, 0)]
            parts = {"block1": Block(inputs, outputs), "block2": Block(outputs, outputs)}
            if level < 2:
                parts["shrink"] = nn.Conv1d(outputs, outputs, 4, stride=2, padding=1)
            self.down.append(nn.ModuleDict(parts))
        self.middle = nn.ModuleDict({name: Block(widths[2], widths[2]) for name in ("block1", "block2")})
        self.up = nn.ModuleList()
        for level in range(2):
            inner, outer = widths[level + 1], widths[level]
            grow = nn.ConvTranspose1d(inner, outer, 4, stride=2, padding=1)
            parts = {"grow": grow, "block1": Block(2 * outer, outer), "block2": Block(outer, outer)}
            self.up.append(nn.ModuleDict(parts))
        self.final = nn.ModuleDict(
            {"norm": nn.GroupNorm(GROUPS, width), "conv": nn.Conv1d(width, 6, 3, padding=1)}
        )
        self.time = perceptron(width, CONTEXT, CONTEXT)
        self.start = perceptron(6, CONTEXT, CONTEXT)
        self.goal = perceptron(3, CONTEXT, CONTEXT)
        self.graph = Graph()
        self.context = nn.Sequential(nn.SiLU(), nn.Linear(CONTEXT, CONTEXT), nn.SiLU())

    def embed(self, step: Tensor, start: Tensor, goal: Tensor, scene: tuple[Tensor, Tensor, Tensor]) -> Tensor:
        """The context: [batch, 256] of diffusion step (0..999), start, goal and scene."""
        half = self.width // 2
        rates = torch.exp(-math.log(1e4) * torch.arange(half, device=step.device) / (half - 1))
        angles = step.float().unsqueeze(1) * rates
        time = self.time(torch.cat([angles.sin(), angles.cos()], dim=1))
        return self.context(time + self.start(start) + self.goal(goal) + self.graph(*scene))

    def forward(self, paths: Tensor, context: Tensor) -> Tensor:
        """Noise [batch, 64, 6] of normalised paths [batch, 64, 6]."""
        mask = torch.zeros_like(paths[..., :1])
        mask[:, 0] = 1
        x = convolve(self.stem, torch.cat([paths, mask], dim=-1))
        skips = []
        for level in self.down:
            x = level["block2"](level["block1"](x, context), context)
            if "shrink" in level:
                skips.append(x)
                x = convolve(level["shrink"], x)
        x = self.middle["block2"](self.middle["block1"](x, context), context)
        for level in reversed(self.up):
            x = torch.cat([convolve(level["grow"], x), skips.pop()], dim=-1)
            x = level["block2"](level["block1"](x, context), context)
        scale, shift = group_scale(self.final["norm"], x)
        return convolve(self.final["conv"], F.silu(x * scale + shift))


def metadata(width: int, theta_max: float) -> dict[str, str]:
    """What the loader of a weights file checks, for a robot of three sections with this bending limit, rad."""
    facts = {"width": width, "context": CONTEXT, "graph_hidden": GRAPH, "horizon": HORIZON, "steps": STEPS}
    facts |= {"architecture": ARCHITECTURE, "schedule": SCHEDULE, "sections": 3, "theta_max": theta_max}
    return {name: str(value) for name, value in facts.items()}


def cosine_schedule(steps: int = STEPS, offset: float = 0.008) -> Tensor:
    """Cumulated signal shares ᾱ_t [steps], f64 (Nichol & Dhariwal 2021; betas within [1e-8, 0.999])."""
    t = torch.arange(steps + 1, dtype=torch.float64) / steps
    share = torch.cos((t + offset) / (1 + offset) * math.pi / 2) ** 2
    betas = (1 - share[1:] / share[:-1]).clamp(1e-8, 0.999)
    return torch.cumprod(1 - betas, 0)
