"""What the points of a cloud know of a surface: rows without a value left out, normals outwards."""

from __future__ import annotations

import dataclasses
import logging

import numpy as np
from scipy.spatial import cKDTree

from parapoint.errors import InputError
from parapoint.surfaces.normals import AGREEING
from parapoint.surfaces.surface import BoolArray, FloatArray, Mesh, PointCloud, unit_normals

MAPS = ("colour", "normal", "position", "intensity")
"""What can be baked."""
SHOWN = {"colour": "colours", "intensity": "intensity"}
"""The attribute of the points that a map shows, of those that show one."""
COMPARED = 10_000
"""Points whose normals are looked at to tell whether all agree with the faces of a mesh."""

logger = logging.getLogger("parapoint")


def check_bakeable(cloud: PointCloud, kind: str) -> None:
    """Check that a cloud has what a map of this kind shows.

    Raises:
        InputError: there is no such kind of map, or the cloud has no such attribute.
    """
    if kind not in MAPS:
        raise InputError(f"--map must be one of {', '.join(MAPS)}, not {kind!r}")
    needed = SHOWN.get(kind)
    if needed is not None and needed not in cloud.attributes:
        known = ", ".join(sorted(cloud.attributes)) or "none"
        raise InputError(f"has no {needed} to bake; the attributes of its points: {known}")
    if kind == "normal" and cloud.normals is None:
        raise InputError("has no normals to bake; estimate them first, or bake another map")


def has_value(cloud: PointCloud, kind: str) -> BoolArray:
    """(P,) whether a point has what a map shows: a colour, an intensity, a normal with a length."""
    if kind == "normal" and cloud.normals is not None:
        return np.asarray((cloud.normals != 0).any(axis=1))
    if kind in SHOWN:
        values = cloud.attributes[SHOWN[kind]].reshape(len(cloud.points), -1)
        return np.asarray(np.isfinite(values).all(axis=1))
    return np.ones(len(cloud.points), dtype=bool)


def knowing(cloud: PointCloud, kind: str) -> PointCloud:
    """The points that have what a map shows; a logged warning counts the others.

    Raises:
        InputError: there is no such kind of map, or no point has a value.
    """
    check_bakeable(cloud, kind)
    known = has_value(cloud, kind)
    warn_of_unknown(int((~known).sum()), len(known), kind)
    return cloud if known.all() else cloud.chosen(known)


def warn_of_unknown(missing: int, count: int, kind: str) -> None:
    """Warn where some of `count` points miss what a map shows.

    Raises:
        InputError: all of them do.
    """
    name = SHOWN.get(kind, "normals").removesuffix("s")
    if missing == count:
        raise InputError(f"no {name} is known at any of its points")
    if missing:
        logger.warning("points without a known %s, which are left out: %d", name, missing)


def facing_outwards(cloud: PointCloud, mesh: Mesh) -> PointCloud:
    """A cloud whose normals are on the side that the faces of a mesh turn counter-clockwise to.

    All are turned if most of them point to the other side, and each by itself where they point to
    either side by chance; a logged warning tells. Otherwise they stay as they are.
    """
    assert cloud.normals is not None
    solid = mesh.face_areas > 0
    faces = cKDTree(mesh.vertices[mesh.faces[solid]].mean(axis=1))
    facing = unit_normals(mesh.vertices, mesh.faces[solid])

    def sides(rows: slice) -> FloatArray:
        normals = cloud.normals
        assert normals is not None
        near = facing[faces.query(cloud.points[rows])[1]]
        return np.where((near * normals[rows]).sum(axis=1) < 0, -1.0, 1.0)

    most = float(sides(slice(None, None, -(-len(cloud.points) // COMPARED))).mean())
    if most >= AGREEING:
        return cloud
    if most <= -AGREEING:
        logger.warning("normals point into the surface of the model: all are turned")
        return dataclasses.replace(cloud, normals=-cloud.normals)
    logger.warning("normals point to either side by chance: each is turned to the model's outside")
    turned = sides(slice(None))[:, None] * cloud.normals
    return dataclasses.replace(cloud, normals=turned)
