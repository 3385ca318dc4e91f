"""check_method finds each broken promise."""

import subprocess
import sys
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import pytest

from parapoint.method import REQUIREMENTS, UnsupportedError
from parapoint.surfaces.parameterization import Parameterization, PointParameterization, TracePoint
from parapoint.surfaces.preparation import prepared
from parapoint.surfaces.surface import Mesh, PointCloud
from parapoint.testing import BrokenPromiseError, check_method, irregular_disk, sample_surfaces


@dataclass(frozen=True)
class Good:
    """Drops the third coordinate."""

    requires: ClassVar[frozenset[str]] = frozenset()

    def parameterize(self, surface, *, seed):  # noqa: ARG002 (the protocol's signature)
        if isinstance(surface, PointCloud):
            return PointParameterization(surface.points[:, :2])
        return self.of_mesh(surface)

    def of_mesh(self, mesh):
        return Parameterization(mesh.vertices[:, :2], mesh.faces)


@dataclass(frozen=True)
class MeshOnly(Good):
    requires: ClassVar[frozenset[str]] = frozenset({"faces"})

    def parameterize(self, surface, *, seed):  # noqa: ARG002 (the protocol's signature)
        if not isinstance(surface, Mesh):
            raise UnsupportedError("needs faces")
        return self.of_mesh(surface)


@dataclass(frozen=True)
class Silent(Good):
    requires: ClassVar[frozenset[str]] = frozenset({"faces"})


@dataclass(frozen=True)
class UnknownWord(Good):
    requires: ClassVar[frozenset[str]] = frozenset({"wings"})


@dataclass(frozen=True)
class FewFaces(Good):
    def of_mesh(self, mesh):
        return Parameterization(mesh.vertices[:, :2], mesh.faces[1:])


@dataclass(frozen=True)
class Shuffled(Good):
    def of_mesh(self, mesh):
        moved = np.roll(mesh.faces, 1, axis=0)
        return Parameterization(
            mesh.vertices[mesh.faces].mean(axis=1)[:, :2],
            np.tile(np.arange(len(moved))[:, None], 3),
        )


@dataclass(frozen=True)
class Collapsed(Good):
    def of_mesh(self, mesh):
        return Parameterization(mesh.vertices[:, [0, 0]], mesh.faces)


@dataclass(frozen=True)
class Unseeded(Good):
    def of_mesh(self, mesh):
        uv = mesh.vertices[:, :2] * np.random.default_rng().uniform(1, 2)
        return Parameterization(uv, mesh.faces)


@dataclass(frozen=True)
class Meddling(Good):
    def of_mesh(self, mesh):
        result = super().of_mesh(mesh)
        mesh.vertices.setflags(write=True)
        mesh.vertices[0] += 1
        return result


@dataclass(frozen=True)
class OfOnePlace(Good):
    """Rounds to single precision before it moves the surface to the origin."""

    def of_mesh(self, mesh):
        rounded = mesh.vertices.astype(np.float32).astype(np.float64)
        return Parameterization((rounded - rounded.mean(axis=0))[:, :2], mesh.faces)


@dataclass(frozen=True)
class OfOneUnit(Good):
    """Sees nothing that is smaller than a tenth."""

    def of_mesh(self, mesh):
        fine = np.floor((mesh.vertices - mesh.vertices.min(axis=0)) / 0.1) * 0.1
        return Parameterization(fine[:, :2] + 1e-3 * mesh.vertices[:, :2], mesh.faces)


@dataclass(frozen=True)
class OfAllVertices(Good):
    """Takes its unit from vertices of no face too, and rounds to single precision."""

    def of_mesh(self, mesh):
        low, size = mesh.vertices.min(axis=0), np.ptp(mesh.vertices)
        inside = 1 + ((mesh.vertices - low) / size).astype(np.float32)
        return Parameterization(inside[:, :2].astype(np.float64), mesh.faces)


@dataclass(frozen=True)
class Failing(Good):
    def of_mesh(self, mesh):
        if np.abs(mesh.vertices).max() > 1e3:
            raise ValueError("too far")
        return super().of_mesh(mesh)


@dataclass(frozen=True)
class Drawn(Good):
    """A map of each seed's own, which place and unit change no more than another seed does."""

    def parameterize(self, surface, *, seed):
        seeds = [seed, int(np.abs(surface.points).max() if isinstance(surface, PointCloud) else 0)]
        if isinstance(surface, Mesh):
            seeds[1] = int(np.abs(surface.vertices).max())
            factor = np.random.default_rng(seeds).uniform(1, 2)
            return Parameterization(surface.vertices[:, :2] * [1, factor], surface.faces)
        return super().parameterize(surface, seed=seed)


@dataclass(frozen=True)
class Picky(Good):
    def of_mesh(self, mesh):
        if mesh.component_count > 1:
            raise UnsupportedError("one component at a time")
        return super().of_mesh(mesh)


@dataclass(frozen=True)
class WrongType(Good):
    def of_mesh(self, mesh):
        return PointParameterization(mesh.vertices[:, :2])


@dataclass(frozen=True)
class BackwardTrace(Good):
    def of_mesh(self, mesh):
        trace = tuple(TracePoint(n, 0.0, {}) for n in (2, 1))
        return Parameterization(mesh.vertices[:, :2], mesh.faces, trace)


@dataclass(frozen=True)
class TraceOfOtherShape(Good):
    def of_mesh(self, mesh):
        trace = (TracePoint(1, 0.0, {}, np.zeros((3, 2))),)
        return Parameterization(mesh.vertices[:, :2], mesh.faces, trace)


@dataclass(frozen=True)
class ArrayReport(Good):
    def of_mesh(self, mesh):
        return Parameterization(mesh.vertices[:, :2], mesh.faces, report={"a": np.ones(2)})


@dataclass(frozen=True)
class ArrayParameter(Good):
    weights: object = field(default_factory=lambda: np.ones(2))


@dataclass(frozen=True)
class Unpicklable(Good):
    def __reduce__(self):
        raise TypeError("no")


class NoDataclass(Good):
    def __new__(cls):
        return object.__new__(type("Plain", (), {"requires": frozenset()}))


def test_honest_methods_pass():
    check_method(Good())
    check_method(MeshOnly())
    check_method(Picky(), irregular_disk())
    check_method(Drawn())


@pytest.mark.parametrize(
    ("method", "promise"),
    [
        (Silent(), "on a point cloud: returned a map, though"),
        (UnknownWord(), r"requires unknown words \['wings'\]"),
        (FewFaces(), r"corners have shape \(127, 3\), the faces \(128, 3\)"),
        (Shuffled(), "not in the order of the mesh"),
        (Collapsed(), "collapsed to a line"),
        (Unseeded(), "another map under the same seed"),
        (OfOnePlace(), r"moved by 500000 times .* has another map: lengths or areas differ by"),
        (OfOneUnit(), "scaled by 1e-06, it has another map"),
        (OfAllVertices(), "with a far vertex of no face, it has another map"),
        (Failing(), r"moved by 6e\+06 times .* cannot be mapped: too far"),
        (Meddling(), "changed the surface's vertices"),
        (Picky(), "on two components: refused, though it meets `requires`"),
        (WrongType(), "returned PointParameterization; a mesh needs a Parameterization"),
        (BackwardTrace(), "the iterations of the trace go back"),
        (TraceOfOtherShape(), "the map at iteration 1 of the trace is not one"),
        (ArrayReport(), "the report cannot be written as JSON"),
        (ArrayParameter(), "its parameters cannot be written as JSON"),
        (Unpicklable(), "cannot be pickled: no"),
        (NoDataclass(), "is no dataclass"),
        (Good, "give a method, not its class"),
    ],
    ids=lambda value: getattr(value, "__name__", type(value).__name__),
)
def test_broken_promise_is_named(method, promise):
    with pytest.raises(BrokenPromiseError, match=promise):
        check_method(method)


def test_a_broken_promise_is_found_when_python_optimizes_too():
    code = (
        "from baselines.disks.tutte import Tutte\n"
        "from parapoint.testing import BrokenPromiseError, check_method\n"
        "try:\n"
        "    check_method(Tutte)\n"
        "except BrokenPromiseError as error:\n"
        "    print(error)\n"
    )
    command = [sys.executable, "-O", "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == "type: give a method, not its class\n"


def test_method_that_can_do_nothing_here_is_unsupported():
    class Absent(MeshOnly):
        def of_mesh(self, mesh):  # noqa: ARG002 (as its base)
            raise UnsupportedError("needs a package that is not installed")

    Absent.__qualname__ = "Absent"
    globals()["Absent"] = Absent  # pickle looks it up
    with pytest.raises(UnsupportedError):
        check_method(Absent())
    with pytest.raises(UnsupportedError):
        check_method(MeshOnly(), PointCloud(np.ones((3, 3))))


def test_samples_cover_what_methods_may_require():
    surfaces = sample_surfaces()
    topologies = {s.topology for s in surfaces.values() if isinstance(s, Mesh)}
    assert {"disk", "sphere", "2 components", "genus 0 with 2 boundary loops"} <= topologies
    littered = surfaces["a disk with unreferenced and duplicate vertices"]
    assert not littered.referenced.all()
    assert len(np.unique(littered.vertices, axis=0)) < len(littered.vertices) - 1
    for word in REQUIREMENTS.keys() - {"cuda"}:
        refused = 0
        for surface in surfaces.values():
            try:
                prepared(surface, frozenset({word}))
            except UnsupportedError:
                refused += 1
        assert 1 <= refused < len(surfaces), word
