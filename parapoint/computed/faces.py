"""The computed map of a mesh by its own faces: nothing has to be reconstructed."""

from __future__ import annotations

import math
from typing import Any

import igl
import numpy as np

from parapoint.computed.flattening import flat_map_of_faces
from parapoint.computed.interpolation import Anchors, Interpolant
from parapoint.planar.coarse import simplified
from parapoint.surfaces.frame import Frame
from parapoint.surfaces.surface import FloatArray, Mesh

MOST_FACES, SIMPLIFIED = 12_000, 6_000
"""A mesh of more faces is simplified, and to how many: where a surface opens is a matter of its
whole shape. Seven models are cut no better with twice as many, in up to twice the time."""
LEAST_VERTICES = 3_000
"""A mesh of fewer vertices is refined: its own edges leave too little choice."""
MOST_SPLITS = 2
"""How often a face is split in four at most: what has few faces has a simple shape."""
LONGEST = 10.0
"""A mesh is uneven if its longest edge is longer than this many sides of an equilateral triangle of
its mean area, as slender faces of CAD parts make it: 16 on two of them, at most 8 on 45 scanned or
modelled surfaces."""


def is_even(mesh: Mesh) -> bool:
    """Whether the faces are even enough for a map of their own."""
    ends = mesh.vertices[mesh.edges]
    longest = float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).max())
    equal = math.sqrt(4 / math.sqrt(3) * float(mesh.face_areas.mean()))
    return longest <= LONGEST * equal


def map_of_faces(mesh: Mesh, deadline: float = math.inf) -> tuple[FloatArray, dict[str, Any]]:
    """(V, 2) a conformal map of the vertices, as `ComputedMap` makes it of a cloud, and its facts.

    A vertex on its seam lies on one of the two sides.

    Args:
        mesh: connected, manifold and oriented; no face without area, no vertex without a face.
        deadline: no descent takes a step after this time of `clock.worked`.

    Raises:
        ReconstructionError: the mesh has no flat map.
    """
    like = comparable(mesh)
    frame = Frame.of(like.vertices)
    inside = Mesh(frame.inside(like.vertices), like.faces)
    flat = flat_map_of_faces(inside, deadline)
    uv = flat.uv[: len(mesh.vertices)]
    if len(like.vertices) < len(mesh.vertices):
        anchors = Anchors(inside.vertices, flat.uv, flat.jacobians)
        uv = Interpolant.of(anchors)(frame.inside(mesh.vertices))
    return uv * frame.scale, flat.facts


def comparable(mesh: Mesh) -> Mesh:
    """The mesh with fewer faces if it is large, with finer ones behind its vertices if coarse."""
    if len(mesh.faces) > MOST_FACES:
        simple = simplified(mesh, SIMPLIFIED)
        return mesh if simple is None else simple[0]
    vertices, faces = mesh.vertices, mesh.faces
    for _ in range(MOST_SPLITS):
        # igl knows no neighbours of two faces that lie on one another, a mesh of their own.
        if len(faces) > 2 and len(vertices) < LEAST_VERTICES:
            vertices, faces = igl.upsample(vertices, faces)
    return Mesh(vertices, faces)
