"""Turns and mirrors of a row that leave its scene as it is: exact copies of a training row that cost no generator.

A robot of constant-curvature sections without twist is the same from every side: where the base turns by an angle about
its axis, each section's (ζ_x, ζ_y) and the tip turn by it. A mirror through the axis takes the tip to its image, and
(ζ_x, ζ_y), which points along the axis of bending, to the negative of its image.
Which of them map the balls onto themselves is looked up among those of the square; balls on the axis allow every angle.
"""

import math

import torch
from torch import Tensor

SAME_PLACE = 1e-5
QUARTER = torch.tensor([[0.0, -1.0], [1.0, 0.0]])
MIRROR = torch.tensor([[1.0, 0.0], [0.0, -1.0]])
TURNS = [torch.linalg.matrix_power(QUARTER, quarters) for quarters in range(4)]
OF_THE_SQUARE = torch.stack(TURNS + [turn @ MIRROR for turn in TURNS])


def turned(vectors: Tensor, matrices: Tensor) -> Tensor:
    """The first two components of vectors [rows, count, 2..] through matrices [rows, 2, 2]; the others stay."""
    return torch.cat([vectors[..., :2] @ matrices.transpose(1, 2), vectors[..., 2:]], dim=-1)


def maps_onto_itself(balls: Tensor, present: Tensor, matrix: Tensor) -> Tensor:
    """Whether each scene of balls [rows, balls, 4] (centre, radius) looks the same through the matrix [2, 2]: [rows]."""
    images = turned(balls, matrix.expand(len(balls), 2, 2))
    apart = (images.unsqueeze(2) - balls.unsqueeze(1)).abs().amax(-1)
    apart = apart.masked_fill(~present.unsqueeze(1), math.inf)
    return ((apart.amin(2) < SAME_PLACE) | ~present).all(1)


class Symmetries:
    """Those of every row of a data set, of which one is drawn each time a row is used."""

    def __init__(self, balls: Tensor, present: Tensor):
        self.matrices = OF_THE_SQUARE.to(balls.device)
        self.axial = ((balls[..., :2].abs().amax(-1) < SAME_PLACE) | ~present).all(1)
        if balls.shape[1] == 0:
            self.choices = torch.arange(8, device=balls.device).expand(len(balls), 8)
            return
        keeps = torch.stack([maps_onto_itself(balls, present, matrix) for matrix in self.matrices], dim=1)
        kept_first = torch.argsort(keeps.int(), dim=1, descending=True, stable=True)
        # The order of a group divides that of the square, so that all of its members come equally often.
        places = torch.arange(8, device=balls.device) % keeps.sum(1, keepdim=True)
        self.choices = kept_first.gather(1, places)

    def draw(self, rows: Tensor, generator: torch.Generator) -> Tensor:
        """A symmetry of each row's scene: [rows, 2, 2]."""
        device = rows.device
        choice = torch.randint(8, rows.shape, generator=generator, device=device)
        angle = 2 * math.pi * torch.rand(rows.shape, generator=generator, device=device) * self.axial[rows]
        sine, cosine = angle.sin(), angle.cos()
        turn = torch.stack([cosine, -sine, sine, cosine], dim=1).unflatten(1, (2, 2))
        return turn @ self.matrices[self.choices[rows, choice]]


def moved(paths: Tensor, tips: Tensor, matrices: Tensor) -> tuple[Tensor, Tensor]:
    """Paths [rows, frames, 6] and tips [rows, 3] through matrices [rows, 2, 2]."""
    sections = paths.unflatten(2, (3, 2)).flatten(1, 2)
    determinants = matrices[:, 0, 0] * matrices[:, 1, 1] - matrices[:, 0, 1] * matrices[:, 1, 0]
    sections = turned(sections, determinants.view(-1, 1, 1) * matrices)
    return sections.unflatten(1, (-1, 3)).flatten(2), turned(tips.unsqueeze(1), matrices).squeeze(1)
