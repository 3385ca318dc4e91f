"""Neural Surface Maps: a flattened mesh as a network, refined between its vertices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from baselines.neural.method import NeuralMethod
from parapoint import clock
from parapoint.method import UnsupportedError
from parapoint.planar.descent import Run, sound
from parapoint.planar.growth import PRICE, Need, grown
from parapoint.surfaces.parameterization import Parameterization, TracePoint
from parapoint.surfaces.surface import Mesh, Surface

if TYPE_CHECKING:
    from baselines.neural.stepping import Terms

FLATTENING_SHARE = 0.5
"""Share of a time budget that the map to be fitted takes at most."""
REFINEMENT_SHARE = 0.15
"""Share of the steps, and of what is left of the time budget, that the refinement takes."""
EXTENT = 16.0
"""Longest side of the flattened mesh as the networks see it; with less they learn slower."""
REFINED_AT = 20_000
"""Samples at most at which the distortion is lowered."""
CHECKED = 4_000
"""Fresh places at which the report measures the networks."""


@dataclass(frozen=True)
class NSM(NeuralMethod):
    """A network overfitted to an isometric map of the mesh, and a second one that refines the map.

    L. Morreale, N. Aigerman, V. G. Kim and N. J. Mitra 2021, "Neural Surface Maps". The mesh is cut
    and flattened as by `automatic+slim`. A residual network f from the plane to space is fitted to
    dense samples of the triangles, positions and normals (surface map, section 3). A network h from
    the plane to itself, at first the identity, lowers the symmetric Dirichlet energy of f ∘ h⁻¹,
    tr M + tr (M + ε)⁻¹ of its first fundamental form, over places anywhere on the surface; the
    boundary is free, flips of h are penalised (parameterization, section 4). A vertex lies at h of
    its place in the flattened mesh.

    Ours: a smaller network, squareplus in place of softplus, SOAP in place of RMSProp, and more
    samples where f is far off. Left out: maps between two surfaces, and collections of them.

    Attributes:
        points: samples of the triangles.
        iterations: steps of both trainings together.
        subset: samples of a step.
        time_budget: seconds of work, that of the flattening among them.
    """

    points: int = 100_000
    iterations: int = 20_000
    subset: int = 256

    requires: ClassVar[frozenset[str]] = frozenset({"faces", "disk_after_cut"})
    packages: ClassVar[tuple[str, ...]] = ("torch", "libigl", "scipy", "shapely")
    on_cpu: ClassVar[bool] = True

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:
        """The map at the vertices, in the unit of the surface.

        Raises:
            UnsupportedError: the surface is a cloud.
            InputError: a triangle has no area.
            FlatteningError: Tutte's embedding has flips.
        """
        import torch

        from baselines.neural import nsm_training as of
        from baselines.neural.nsm_networks import Refinement, SurfaceMap
        from baselines.neural.nsm_samples import Triangles
        from baselines.neural.stepping import trained

        if not isinstance(surface, Mesh):
            raise UnsupportedError("needs faces; the surface is a point cloud")
        began = clock.worked()
        flat = flattened(surface, self.time_budget)
        corners, uv = flat.mesh.faces, flat.uv
        unit = float(np.ptp(uv, axis=0).max()) / EXTENT
        inside = (uv - (uv.min(axis=0) + uv.max(axis=0)) / 2) / unit
        solid = (flat.mesh.vertices - flat.mesh.vertices.mean(axis=0)) / unit
        triangles = Triangles(*(torch.as_tensor(at[corners]) for at in (inside, solid)))
        generator = torch.Generator().manual_seed(seed)
        fitted, refined = SurfaceMap(generator), Refinement(generator)
        samples = triangles.drawn(self.points, generator)
        batches = of.batches(fitted, samples, self.subset, generator)
        trace: list[TracePoint] = []

        def train(network: torch.nn.Module, terms: Terms, rate: float, end: float) -> None:
            steps = round(end * self.iterations) - len(trace)
            left = None
            if self.time_budget is not None:
                spent = clock.worked() - began
                left = (self.time_budget - spent) * (end if network is fitted else 1.0)
            for losses in trained(network, terms, rate, steps, left):
                trace.append(TracePoint(len(trace) + 1, clock.worked() - began, losses))

        def overfit() -> dict[str, torch.Tensor]:
            return of.overfit_terms(fitted, samples.rows(next(batches)))

        train(fitted, overfit, of.RATES[0], 1 - REFINEMENT_SHARE)
        steps_of_fit = len(trace)
        refined_at = samples.uv[:REFINED_AT]
        forms = of.first_forms(fitted, refined_at)

        def distortion() -> dict[str, torch.Tensor]:
            rows = torch.randint(len(forms), (self.subset,), generator=generator)
            return of.distortion_terms(refined, refined_at[rows], forms[rows])

        train(refined, distortion, of.RATES[1], 1.0)
        with torch.no_grad():
            moved = refined(torch.as_tensor(inside, dtype=torch.float32)[None])[0]
            checked = of.figures(fitted, refined, triangles.drawn(CHECKED, generator))
        extent = float(np.ptp(solid, axis=0).max())
        report: dict[str, object] = {
            "points": self.points,
            "points_of_a_step": self.subset,
            "iterations": [steps_of_fit, len(trace) - steps_of_fit],
            "losses": dict(trace[-1].values) if trace else {},
            "flattening": flat.report(),
            "rms_of_fit": checked.pop("distance") / extent,
            **checked,
        }
        return Parameterization(
            unit * moved.numpy().astype(np.float64), corners, tuple(trace), report
        )


def flattened(mesh: Mesh, time_budget: float | None) -> Run:
    """The isometric map of `automatic+slim`, in its part of the time."""
    run = Run(sound(mesh))
    if time_budget is not None:
        run.deadline = clock.worked() + FLATTENING_SHARE * time_budget
    run.begin()
    run.improve()
    run = grown(run, Need(PRICE))
    run.improve()
    return run
