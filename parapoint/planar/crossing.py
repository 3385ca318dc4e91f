"""Whether a map of a planar domain without flips is one to one."""

from __future__ import annotations

import numpy as np
import shapely

from parapoint.surfaces.surface import FloatArray, IntArray, Mesh


def crossing_vertices(disk: Mesh, uv: FloatArray) -> IntArray:
    """The vertices of boundary edges that touch or cross others, other than the edges next to them.

    Without flips no point of the plane is covered more often than the boundary winds around it
    (its degree), so a map of a disk, with or without holes, is one to one if and only if the
    images of its boundary loops neither cross nor touch: if none is returned.

    Args:
        disk: a planar domain.
        uv: (V, 2) a map of it without flips.
    """
    start = np.concatenate(disk.boundary_loops)
    end = np.concatenate([np.roll(loop, -1) for loop in disk.boundary_loops])
    segments = np.asarray(shapely.linestrings(np.stack([uv[start], uv[end]], axis=1)))
    one, other = shapely.STRtree(segments).query(segments, predicate="intersects")
    apart = (start[one] != start[other]) & (start[one] != end[other]) & (end[one] != start[other])
    return np.unique([start[one[apart]], end[one[apart]]])
