"""xatlas: an atlas of many charts."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np

from baselines.tools.atlas import atlas
from baselines.tools.optional import optional
from parapoint.method import UnsupportedError
from parapoint.surfaces.frame import UNIT, Frame, in_unit
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import Mesh, Surface

xatlas = optional("xatlas", "pip install xatlas")

CHART_OPTIONS = {
    "max_chart_area",
    "max_boundary_length",
    "normal_deviation_weight",
    "roundness_weight",
    "straightness_weight",
    "normal_seam_weight",
    "max_cost",
    "max_iterations",
    "fix_winding",
}
"""Fields of Xatlas that are attributes of xatlas.ChartOptions; the others are of PackOptions."""
DIMENSIONS = {"max_chart_area": 2, "max_boundary_length": 1, "texels_per_unit": -1}
"""Fields that are lengths to some power, and the power."""


@dataclass(frozen=True)
class Xatlas:
    """Atlas of charts grown by cost, flattened by LSCM or projection, and packed.

    J. Young, https://github.com/jpcy/xatlas; chart growing after Sander et al. 2003, "Multi-chart
    geometry images". Works in float32. Takes any mesh. About half of its charts come back mirrored,
    which is no flip: it turns charts by a quarter by swapping u and v. Several pages are laid side
    by side.

    Attributes:
        max_chart_area: largest 3D area of a chart; 0 for no limit.
        max_boundary_length: longest boundary of a chart; 0 for no limit.
        normal_deviation_weight: cost of angles between a face's and its chart's normal.
        roundness_weight: cost of long boundaries.
        straightness_weight: cost of crooked boundaries.
        normal_seam_weight: cost of charts across creases; over 1000 none crosses.
        max_cost: a chart grows until its cost is above this; lower means more charts.
        max_iterations: rounds of growing and seeding anew.
        fix_winding: turn mirrored charts over before packing.
        max_chart_size: larger charts are scaled down to this many texels; 0 for no limit.
        padding: texels between charts.
        texels_per_unit: texels in a unit of length; 0 for about a 1024 x 1024 page.
        resolution: side of a page in texels; 0 for one page as large as it needs.
        bilinear: leave room for bilinear filtering.
        block_align: align charts to blocks of 4 x 4 texels.
        brute_force: pack slowly and best.
        rotate_charts_to_axis: turn charts to the axis of their convex hull.
        rotate_charts: turn charts while packing.
    """

    max_chart_area: float = 0.0
    max_boundary_length: float = 0.0
    normal_deviation_weight: float = 2.0
    roundness_weight: float = 0.01
    straightness_weight: float = 6.0
    normal_seam_weight: float = 4.0
    max_cost: float = 2.0
    max_iterations: int = 1
    fix_winding: bool = False
    max_chart_size: int = 0
    padding: int = 0
    texels_per_unit: float = 0.0
    resolution: int = 0
    bilinear: bool = True
    block_align: bool = False
    brute_force: bool = False
    rotate_charts_to_axis: bool = True
    rotate_charts: bool = True

    requires: ClassVar[frozenset[str]] = frozenset({"faces"})
    packages: ClassVar[tuple[str, ...]] = ("xatlas",)

    def parameterize(self, surface: Surface, *, seed: int) -> Parameterization:  # noqa: ARG002 (xatlas takes no seed)
        """The atlas, in texels.

        Raises:
            UnsupportedError: the surface is a point cloud, or xatlas is not installed.
            FlatteningError: xatlas returned no atlas, other faces, or NaN.
        """
        if not isinstance(surface, Mesh):
            raise UnsupportedError("needs faces; the surface is a point cloud")
        made = xatlas.Atlas()
        vertices = in_unit(surface.vertices, surface.faces)
        unit = UNIT / Frame.of(surface.vertices[surface.referenced]).scale
        made.add_mesh(vertices.astype(np.float32), surface.faces.astype(np.uint32))
        chart_options, pack_options = xatlas.ChartOptions(), xatlas.PackOptions()
        for field in fields(self):
            options = chart_options if field.name in CHART_OPTIONS else pack_options
            name = {"block_align": "blockAlign", "brute_force": "bruteForce"}.get(
                field.name, field.name
            )
            value = getattr(self, field.name)
            if field.name in DIMENSIONS:
                value *= unit ** DIMENSIONS[field.name]
            setattr(options, name, value)
        made.generate(chart_options, pack_options)
        source, corners, uv = made.get_mesh(0)
        page, _ = made.get_mesh_vertex_assignment(0)
        return atlas(
            surface,
            source=source,
            corners=corners,
            uv=uv,
            page_size=(made.width, made.height),
            page=page,
        )
