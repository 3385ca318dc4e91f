"""The straightforward way to write ParaPoint, and a race of `parapoint` against it.

It has plain torch layers, Jacobians by `torch.autograd.grad` with a graph (so that the gradient of
the losses on them differentiates twice), neighbours from the matrix of all distances, and all
10,000 points in every step. Losses, weights and learning rate are those of the preset `paper`.
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
from benchmarks.metrics.evaluation import evaluate
from parapoint.errors import InputError
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh

if TYPE_CHECKING:
    from torch import Tensor, nn

    from parapoint.surfaces.surface import FloatArray


class Reached(NamedTuple):
    """What one way to a map had reached at some time.

    Attributes:
        what: the name of the way.
        iterations: the number of training steps.
        cpu_seconds: processor time in seconds, all threads together.
        angle_difference: mean over all corners, radians.
    """

    what: str
    iterations: int
    cpu_seconds: float
    angle_difference: float


def race(case: str, seconds: float, *, seed: int = 0) -> Iterator[Reached]:
    """What the computed map, the preset `learned` and the straightforward way reach on a mesh.

    The computed map takes the time that it needs, and `learned` has `seconds` by the clock. The
    straightforward way has `seconds` of processor time, and is measured after 1, 2, 4, ... steps.

    Raises:
        InputError: there is no such model, or it is no mesh.
    """
    from parapoint.computed.computed_map import ComputedMap
    from parapoint.learned.parapoint import ParaPoint
    from parapoint.learned.presets import PAPER
    from parapoint.surfaces.frame import Frame
    from parapoint.surfaces.sampling import training_points

    mesh = models.load(case)
    if not isinstance(mesh, Mesh):
        raise InputError(f"{case} is a cloud; the race needs a mesh")

    def angle_difference(uv: FloatArray) -> float:
        return evaluate(mesh, Parameterization(uv, mesh.faces))["angle_difference_mean"]

    rivals = {
        "computed": ComputedMap(seed=seed),
        "learned": ParaPoint("learned", time_budget=seconds, seed=seed, device="cpu"),
    }
    for name, rival in rivals.items():
        begin = time.process_time()
        model = rival.fit(mesh)
        spent = time.process_time() - begin
        steps = int(str(model.report_.get("iterations", 0)))
        yield Reached(name, steps, spent, angle_difference(model.transform(mesh.vertices)))
    points = training_points(mesh, PAPER.points, seed)
    frame = Frame.of(points)
    maps = straightforward_maps(frame.inside(points), frame.inside(mesh.vertices), seed)
    shown = 1
    for iteration, (spent, uv) in enumerate(maps, start=1):
        if iteration == shown or spent >= seconds:
            shown *= 2
            yield Reached("straightforward", iteration, spent, angle_difference(uv))
        if spent >= seconds:
            return


def race_table(case: str, seconds: float) -> Table:
    """The results of `race` as a table."""
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
    """After each step, the processor seconds so far and the map (V, 2) of `at`; without an end.

    Args:
        points: (N, 3) training points, with their box around the origin and a largest norm of 1.
        at: (V, 3) points to map, in the same frame.
        seed: the seed of torch's generator.
    """
    import torch

    from parapoint.learned.optimizers import AdamW

    torch.manual_seed(seed)
    networks = straightforward_networks()
    rate, decay = AdamW.learning_rate, AdamW.weight_decay
    optimizer = torch.optim.AdamW(networks.parameters(), rate, weight_decay=decay)
    P, watched = torch.as_tensor(points).float(), torch.as_tensor(at).float()
    side = torch.linspace(-1, 1, round(math.sqrt(len(P))))
    grid = torch.cartesian_prod(side, side)
    seconds = 0.0
    while True:
        begin = time.process_time()
        loss = straightforward_loss(networks, P, grid)
        optimizer.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimizer.step()
        seconds += time.process_time() - begin
        with torch.no_grad():
            uv = networks["unwrap"](_moved(networks, "cut", watched))
        yield seconds, np.asarray(uv, dtype=np.float64)


def straightforward_networks() -> nn.ModuleDict:
    """The layers of the five networks; Deform and Cut have two stacks each, "embed" and "move"."""
    from torch import nn

    from parapoint.learned.presets import PAPER

    def phi(inputs: int, outputs: int) -> nn.Sequential:
        layers: list[nn.Module] = []
        for before, after in itertools.pairwise((inputs, *PAPER.hidden, outputs)):
            layers += [nn.Linear(before, after), nn.LeakyReLU(0.01)]
        return nn.Sequential(*layers[:-1])

    d = PAPER.embedding
    return nn.ModuleDict(
        {
            "deform_embed": phi(2, d),
            "deform_move": phi(d + 2, 2),
            "cut_embed": phi(3, d),
            "cut_move": phi(d + 3, 3),
            "unwrap": phi(3, 2),
            "wrap": phi(2, 3),
            "stitch": phi(3, 3),
        }
    )


def _moved(networks: nn.ModuleDict, name: str, x: Tensor) -> Tensor:
    """The points (N, 2 or 3) moved by Deform or Cut."""
    import torch

    embedding = networks[f"{name}_embed"](x)
    offset: Tensor = networks[f"{name}_move"](torch.cat([embedding, x], dim=1))
    return x + offset


def straightforward_loss(networks: nn.ModuleDict, P: Tensor, grid: Tensor) -> Tensor:
    """The weighted objective for all points (N, 3) and a lattice (M, 2) in the plane."""
    import torch

    from parapoint.learned.presets import PAPER

    unwrap, wrap, stitch = (networks[name] for name in ("unwrap", "wrap", "stitch"))
    S = _moved(networks, "cut", P)
    Q = unwrap(S)
    S_cycle = wrap(Q)
    P_cycle = stitch(S_cycle)
    Q_hat = _moved(networks, "deform", grid)
    S_hat = wrap(Q_hat)
    P_hat = stitch(S_hat)
    S_hat_cycle = _moved(networks, "cut", P_hat)
    Q_hat_cycle = unwrap(S_hat_cycle)
    J_f, J_g = _jacobian(P_cycle, Q), _jacobian(P_hat, Q_hat)
    spacing = PAPER.unwrap_spacing * (Q.amax(0) - Q.amin(0)).max().detach() / math.sqrt(len(Q))
    near = Q[_nearest(Q.detach(), PAPER.unwrap_neighbours)]
    repulsion = (spacing - (Q[:, None] - near).norm(dim=2)).clamp(min=0).sum(1).mean()
    apart = torch.cdist(P_hat, P)
    chamfer = torch.maximum(apart.amin(0).mean(), apart.amin(1).mean())
    pairs = ((P, P_cycle), (S, S_cycle), (Q_hat, Q_hat_cycle), (S_hat, S_hat_cycle))
    cycle = torch.stack([(a - b).abs().sum(1).mean() for a, b in pairs]).sum()
    total: Tensor = (
        PAPER.wrap_weight * chamfer
        + PAPER.unwrap_weight * repulsion
        + PAPER.cycle_weight * cycle
        + PAPER.distortion_weight * (_distortion(J_f) + _distortion(J_g))
        + PAPER.anti_flip_weight * (_anti_flip(J_f, P_cycle) + _anti_flip(J_g, P_hat))
    )
    return total


def _nearest(points: Tensor, count: int) -> Tensor:
    """(N, count) the rows of the nearest other points of each point."""
    import torch

    index: Tensor = torch.cdist(points, points).topk(count + 1, largest=False).indices
    return index[:, 1:]


def _jacobian(values: Tensor, uv: Tensor) -> Tensor:
    """(N, 3, 2) the Jacobians of values (N, 3) by uv (N, 2), which can be differentiated again."""
    import torch

    rows = [torch.autograd.grad(values[:, c].sum(), uv, create_graph=True)[0] for c in range(3)]
    return torch.stack(rows, dim=1)


def _distortion(J: Tensor) -> Tensor:
    """Mean of |λ1 − λ2| of Jacobians (N, 3, 2), with singular values λ1 and λ2."""
    import torch

    E, G = J.square().sum(1).unbind(1)
    F = J.prod(2).sum(1)
    least = 1e-12 * (E + G).detach()
    root = ((E - G).square() + 4 * F.square() + least.square()).sqrt()
    larger, smaller = (E + G + root) / 2, torch.maximum(E + G - root, least) / 2
    return (larger.sqrt() - smaller.sqrt()).abs().mean()


def _anti_flip(J: Tensor, made: Tensor) -> Tensor:
    """Mean over the points of how far the normals around them turn beyond T = π/2."""
    import torch

    from parapoint.learned.presets import PAPER

    crosses = torch.linalg.cross(J[:, :, 0], J[:, :, 1])
    normals = torch.nn.functional.normalize(crosses, dim=1)
    near = normals[_nearest(made.detach(), PAPER.anti_flip_neighbours)]
    return (-(normals[:, None] * near).sum(2)).clamp(min=0).sum(1).mean()
