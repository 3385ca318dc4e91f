"""ParaPoint as it is written down at once, and the race of `parapoint` against it.

Plain torch layers, Jacobians by `torch.autograd.grad` with a graph (so the loss on them goes
backward twice), neighbours by all distances, all 10,000 points in every iteration. The losses,
weights and learning rate are those of the paper preset.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from rich.table import Table

from benchmarks.cases import models
from benchmarks.metrics.table import evaluate
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh

if TYPE_CHECKING:
    from torch import Tensor, nn

    from parapoint.surfaces.surface import FloatArray


class Reached(NamedTuple):
    """What a way to the map had reached.

    Attributes:
        what: the way.
        iterations: steps of training.
        cpu_seconds: processor time, all threads together.
        angle_difference: mean over all corners, radians.
    """

    what: str
    iterations: int
    cpu_seconds: float
    angle_difference: float


def race(case: str, seconds: float, *, seed: int = 0) -> Iterator[Reached]:
    """What `fast` and `smooth` reach on a mesh, and the straightforward way at 1, 2, 4, ... steps.

    `fast` takes what it takes, `smooth` has `seconds` by the clock, the straightforward one
    `seconds` of processor time.

    Raises:
        InputError: there is no such model, or it is no mesh.
    """
    from parapoint.estimator import ParaPoint
    from parapoint.learned.presets import PAPER
    from parapoint.surfaces.sampling import training_points

    mesh = models.load(case)
    if not isinstance(mesh, Mesh):
        raise InputError(f"{case} is a cloud; the race needs a mesh")

    def angle_difference(uv: FloatArray) -> float:
        return evaluate(mesh, Parameterization(uv, mesh.faces))["angle_difference_mean"]

    for preset, budget in (("fast", None), ("smooth", seconds)):
        begin = time.process_time()
        model = ParaPoint(preset=preset, time_budget=budget, seed=seed, device="cpu").fit(mesh)
        spent = time.process_time() - begin
        uv = model.transform(mesh.vertices)
        yield Reached(preset, int(str(model.report_["iterations"])), spent, angle_difference(uv))
    points = training_points(mesh, PAPER.points, seed)
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    scale = np.linalg.norm(points - centre, axis=1).max()
    maps = straightforward_maps((points - centre) / scale, (mesh.vertices - centre) / scale, seed)
    shown = 1
    for iteration, (spent, uv) in enumerate(maps, start=1):
        if iteration == shown or spent >= seconds:
            shown *= 2
            yield Reached("straightforward", iteration, spent, angle_difference(uv))
        if spent >= seconds:
            return


def race_table(case: str, seconds: float) -> Table:
    """`race` as a table."""
    columns = ("what", "iterations", "processor s", "angle difference")
    table = Table(*columns, title=f"Time to quality on {case}")
    for row in race(case, seconds):
        table.add_row(
            row.what, str(row.iterations), f"{row.cpu_seconds:.1f}", f"{row.angle_difference:.4f}"
        )
    return table


def straightforward_maps(
    points: FloatArray, at: FloatArray, seed: int
) -> Iterator[tuple[float, FloatArray]]:
    """Processor seconds of training and the map (V, 2) of `at` (V, 3) after each step, for ever.

    Args:
        points: (N, 3) training points, centred, largest norm 1.
        at: (V, 3) points to map, in the same frame.
        seed: of torch's generator.
    """
    import torch
    from torch import nn

    from parapoint.learned.optimizers import AdamW
    from parapoint.learned.presets import PAPER

    def nearest(queries: Tensor, among: Tensor, count: int) -> Tensor:
        index: Tensor = torch.cdist(queries, among).topk(count, largest=False).indices
        return index

    def phi(inputs: int, outputs: int) -> nn.Sequential:
        layers: list[nn.Module] = []
        for before, after in itertools.pairwise((inputs, *PAPER.hidden, outputs)):
            layers += [nn.Linear(before, after), nn.LeakyReLU(0.01)]
        return nn.Sequential(*layers[:-1])

    def offset(embed: nn.Module, move: nn.Module, x: Tensor) -> Tensor:
        moved: Tensor = move(torch.cat([embed(x), x], dim=1))
        return x + moved

    def jacobian(values: Tensor, uv: Tensor) -> Tensor:
        rows = [torch.autograd.grad(values[:, c].sum(), uv, create_graph=True)[0] for c in range(3)]
        return torch.stack(rows, dim=1)

    def distortion(J: Tensor) -> Tensor:
        E, G = J.square().sum(1).unbind(1)
        F = J.prod(2).sum(1)
        root = ((E - G).square() + 4 * F.square() + 1e-12).sqrt()
        larger, smaller = (E + G + root) / 2, (E + G - root).clamp(min=1e-12) / 2
        return (larger.sqrt() - smaller.sqrt()).abs().mean()

    def anti_flip(J: Tensor, made: Tensor) -> Tensor:
        normals = nn.functional.normalize(torch.linalg.cross(J[:, :, 0], J[:, :, 1]), dim=1)
        near = normals[nearest(made.detach(), made.detach(), PAPER.anti_flip_neighbours + 1)[:, 1:]]
        return (-(normals[:, None] * near).sum(2)).clamp(min=0).sum(1).mean()

    torch.manual_seed(seed)
    d = PAPER.embedding
    embed2, move2, embed3, move3 = phi(2, d), phi(d + 2, 2), phi(3, d), phi(d + 3, 3)
    unwrap, wrap, stitch = phi(3, 2), phi(2, 3), phi(3, 3)
    parameters = [
        p for net in (embed2, move2, embed3, move3, unwrap, wrap, stitch) for p in net.parameters()
    ]
    optimizer = torch.optim.AdamW(parameters, AdamW.learning_rate, weight_decay=AdamW.weight_decay)
    P, watched = torch.as_tensor(points).float(), torch.as_tensor(at).float()
    side = torch.linspace(-1, 1, round(math.sqrt(len(P))))
    grid = torch.cartesian_prod(side, side)
    seconds = 0.0
    while True:
        begin = time.process_time()
        S = offset(embed3, move3, P)
        Q = unwrap(S)
        S_cycle = wrap(Q)
        P_cycle = stitch(S_cycle)
        Q_hat = offset(embed2, move2, grid)
        S_hat = wrap(Q_hat)
        P_hat = stitch(S_hat)
        S_hat_cycle = offset(embed3, move3, P_hat)
        Q_hat_cycle = unwrap(S_hat_cycle)
        J_f, J_g = jacobian(P_cycle, Q), jacobian(P_hat, Q_hat)
        spacing = PAPER.unwrap_spacing * (Q.amax(0) - Q.amin(0)).max().detach() / math.sqrt(len(Q))
        near = Q[nearest(Q.detach(), Q.detach(), PAPER.unwrap_neighbours + 1)[:, 1:]]
        repulsion = (spacing - (Q[:, None] - near).norm(dim=2)).clamp(min=0).sum(1).mean()
        apart = torch.cdist(P_hat, P)
        chamfer = torch.maximum(apart.amin(0).mean(), apart.amin(1).mean())
        pairs = ((P, P_cycle), (S, S_cycle), (Q_hat, Q_hat_cycle), (S_hat, S_hat_cycle))
        cycle = torch.stack([(a - b).abs().sum(1).mean() for a, b in pairs]).sum()
        loss = (
            PAPER.wrap_weight * chamfer
            + PAPER.unwrap_weight * repulsion
            + PAPER.cycle_weight * cycle
            + PAPER.distortion_weight * (distortion(J_f) + distortion(J_g))
            + PAPER.anti_flip_weight * (anti_flip(J_f, P_cycle) + anti_flip(J_g, P_hat))
        )
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        seconds += time.process_time() - begin
        with torch.no_grad():
            uv = unwrap(offset(embed3, move3, watched))
        yield seconds, np.asarray(uv, dtype=np.float64)
