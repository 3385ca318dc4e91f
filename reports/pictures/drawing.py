"""The rendered pictures of a report: each model, and each map on its model and in the plane.

They are the expensive part, so they are kept: a picture is drawn again only if the surface, the map
or the source of the renderer has changed.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cached_property, partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from PIL import Image as Images

from benchmarks.metrics.distortion import FaceDistortion
from benchmarks.metrics.seams import spanning_edges
from benchmarks.metrics.state import MapState
from benchmarks.store.results import Store
from benchmarks.store.rows import ResultRow
from parapoint.errors import InputError
from parapoint.sources import source_hash
from parapoint.surfaces.parameterization import Parameterization
from parapoint.surfaces.surface import BoolArray, FloatArray, Mesh, PointCloud, edge_table
from reports.contents import Contents
from reports.page import viewer
from reports.pictures import clouds, render
from reports.pictures.render import Camera, Floats, Image, Scene, View
from reports.tables.published import published_values

Content = Image | viewer.Script
"""What is in a file beside the pictures: one of them, or what the viewer reads."""

SIZE, SMALL, SAMPLES = 360, 280, 2
"""Longer side of a picture in pixels: what the largest figure of a model prints, and enough for the
others, of reports with too many models for such figures; samples along a pixel.
"""

FIELDS = 44
"""Fields of the checkerboard along the diagonal of a model's bounding box."""

SPANNING_TONE = render.linear([0.90, 0.91, 0.90])

ANGLE_SCALE, AREA_SCALE = ("magma_r", 0.0, 2.0), ("PuOr_r", -3.0, 3.0)
"""Colour map and range of log2(sigma1 / sigma2), and of log2(UV area / 3D area)."""


def slug(text: str) -> str:
    """`text` as a part of a file name; a short hash is added where characters had to go."""
    plain = re.sub(r"[^a-z0-9.]+", "-", text.lower()).strip("-.")[:60]
    if plain == text.lower():
        return plain
    return f"{plain}-{hashlib.sha256(text.encode()).hexdigest()[:6]}".strip("-")


@dataclass(frozen=True, eq=False)
class Map:
    """A parameterization of a mesh, ready to be drawn.

    Attributes:
        mesh: the surface.
        parameterization: its map.
    """

    mesh: Mesh
    parameterization: Parameterization

    @cached_property
    def _state(self) -> MapState:
        return MapState(self.mesh, self.parameterization)

    @property
    def has_area(self) -> bool:
        """Whether any face has an area in the plane: else there is nothing to see."""
        return bool((self._state.triangles.uv_area != 0).any())

    @cached_property
    def spanning(self) -> BoolArray:
        """(F,) faces that span a learned seam; without a spanning edge there are none.

        Most maps have none: their overlaps, a fourth of the time of their pictures, are not needed.
        """
        if spanning_edges(self.mesh, self.parameterization).any():
            return self._state.spanning
        return np.zeros(len(self.mesh.faces), dtype=np.bool_)

    @cached_property
    def flipped(self) -> BoolArray:
        """(F,) faces turned against the majority of their chart; spanning faces are not counted."""
        return self._state.validity.flipped & ~self.spanning

    @property
    def distortion(self) -> FaceDistortion:
        """Of the faces that do not span a seam."""
        state = self._state
        return state.distortion_without_spanning if self.spanning.any() else state.distortion

    @cached_property
    def uv(self) -> FloatArray:
        """(F, 3, 2) uv of the corners: area as on the surface, upright, seen from outside."""
        uv = self.parameterization.uv[self.parameterization.corners]
        signed = self._state.triangles.uv_area
        kept = ~self.spanning if (~self.spanning & (signed != 0)).any() else signed != 0
        area = float(np.abs(signed[kept]).sum())
        scale = np.sqrt(self.mesh.face_areas[kept].sum() / area) if area > 0 else 1.0
        middle = (uv.min(axis=(0, 1)) + uv.max(axis=(0, 1))) / 2
        uv = (uv - middle) * scale
        if signed[kept].sum() < 0:
            uv = uv * [-1, 1]
        if len(np.unique(self.parameterization.charts())) == 1:
            points = uv[kept].reshape(-1, 2)
            _, axes = np.linalg.eigh(np.cov(points.T))
            up = axes[:, 1] * (1 if axes[1, 1] >= 0 else -1)
            uv = uv @ np.array([[up[1], up[0]], [-up[0], up[1]]])
        return np.asarray(uv, dtype=np.float64)

    @cached_property
    def seams(self) -> FloatArray:
        """(S, 2, 3) the edges of the surface along which the map is cut."""
        return np.asarray(self.mesh.vertices[self.parameterization.seams(self.mesh)])

    def by_face(self, values: FloatArray) -> FloatArray:
        """(F,) `values` of the faces in `distortion`, NaN for the others."""
        full = np.full(len(self.mesh.faces), np.nan)
        full[self.distortion.faces] = values
        return full

    @cached_property
    def angle(self) -> FloatArray:
        """(F,) log2(sigma1 / sigma2), 0 where angles are kept; NaN where it is not defined."""
        found = self.distortion
        ratio = np.full(len(found.faces), np.inf)
        ratio[found.finite] = found.sigma1[found.finite] / found.sigma2[found.finite]
        return self.by_face(np.log2(ratio))

    @cached_property
    def area(self) -> FloatArray:
        """(F,) log2(UV area / 3D area), both with sum 1; NaN where it is not defined."""
        found = self.distortion
        ratio = np.where(found.finite, found.uv_area / found.area, 1.0)
        return self.by_face(np.where(found.finite & (ratio > 0), np.log2(ratio), -np.inf))


def heat(values: FloatArray, scale: tuple[str, float, float]) -> Floats:
    """(F, 3) linear colours of `values` on a scale; grey for NaN."""
    name, low, high = scale
    known = ~np.isnan(values)
    place = np.clip((np.where(known, values, low) - low) / (high - low), 0, 1)
    colours = colormaps[name](place)[:, :3]
    return render.linear(np.where(known[:, None], colours, 0.8))


def textured(view: View, found: Map) -> Image:
    """The checkerboard on the surface; flips in orange, seams and faces that span one in green."""
    colours = view.checker(found.uv - found.uv.min(axis=(0, 1)), FIELDS / view.scene.size)
    colours = _mixed(colours, render.FLIP_ORANGE, found.flipped[view.face], 0.75)
    colours = _mixed(colours, render.SEAM_GREEN, found.spanning[view.face], 0.8)
    return view.image(_mixed(colours, render.SEAM_GREEN, view.near_lines(found.seams, 2.6), 1.0))


def _mixed(colours: Floats, colour: Floats, where: BoolArray, share: float) -> Floats:
    """`colours` (S, 3) with `share` of `colour` where said."""
    mixed = colours.copy()
    mixed[where] = (1 - share) * colours[where] + share * colour
    return mixed


def meshed(view: View) -> Image:
    """The bare surface with the edges of its mesh."""
    cover = view.edge_cover(1.1)
    return view.image(np.asarray(render.CLAY * (1 - cover) + render.INK * cover, np.float32))


class Layout:
    """The map in the plane. Faces that span a seam lie below the others, pale."""

    def __init__(self, found: Map, size: int) -> None:
        """The layout of `found`, its longer side of `size` pixels."""
        low = 1e-3 * float(np.ptp(found.uv, axis=(0, 1)).max() or 1)
        height = np.where(found.spanning, -low, np.where(found.flipped, low, 0.0))
        corners = np.concatenate(
            [found.uv, np.broadcast_to(height[:, None, None], (len(height), 3, 1))], axis=2
        )
        flat = Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
        camera: Camera = render.camera(flat, np.eye(3)[2], np.eye(3)[1])
        self._map = found
        self._view = Scene(flat, shadows=False).view(camera, size, SAMPLES)
        self._outline = self._view.near_lines(_outline(found), 1.6)

    def image(self, colours: Floats) -> Image:
        """The layout under `colours` (F, 3) of faces or (F, 3, 3) of corners, charts outlined."""
        view, found = self._view, self._map
        at = colours[view.face] if colours.ndim == 2 else view.at_corners(colours)
        at = np.where(found.spanning[view.face, None], SPANNING_TONE, at).astype(np.float32)
        return view.image(_mixed(at, render.INK, self._outline, 1.0), lit=False)


def _outline(found: Map) -> FloatArray:
    """(n, 2, 3) the edges around the charts, at the height of `Layout`."""
    kept = ~found.spanning
    _, edge, count = edge_table(found.parameterization.corners[kept])
    uv = found.uv[kept]
    ends = np.stack([uv, np.roll(uv, -1, axis=1)], axis=2).reshape(-1, 2, 2)[count[edge] == 1]
    return np.concatenate([ends, np.zeros((len(ends), 2, 1))], axis=2)


def normal_colours(scene: Scene, camera: Camera) -> Floats:
    """(F, 3, 3) colours of the corners by their normals as the camera sees them, shaded.

    Seen in the plane they tell which part of the surface lies where.
    """
    axes = camera.axes.astype(np.float32)
    normals = scene.corner_normals @ axes.T
    sky = scene.coarse_openness[scene.mesh.faces, :1]
    colours = (0.5 + 0.42 * normals) * (0.30 + 0.70 * sky)
    return render.linear(np.clip(colours, 0, 1))


MODEL_PICTURES = ("mesh-1", "mesh-2")
TEXTURED_PICTURES = ("checker-1", "checker-2", "layout")
HEAT_PICTURES = ("angle", "angle-uv", "area", "area-uv")
ARTIST_PICTURES = ("artist-checker-1", "artist-layout")
CLOUD_PICTURES = ("cloud", "cloud-uv", "dense", "seams")
VIEWED = "view"
"""Kind of the file beside the pictures that the viewer reads, of a model and of a map."""


def model_kinds(*, points: bool, artist: bool) -> tuple[str, ...]:
    """The files of a model: of `points`, the `artist`'s own map if there is one."""
    return MODEL_PICTURES + (VIEWED,) * (not points) + ARTIST_PICTURES * artist


def map_kinds(row: ResultRow, *, points: bool, with_heat: bool) -> tuple[str, ...]:
    """The files of a map, of `points` or of a mesh: of both, for the one method that sees points.

    In a report without the figures of a model the second view of other methods is in none, and only
    the paper's models are shown as points.
    """
    if points:
        return CLOUD_PICTURES
    second_view = with_heat or row.method in {"slim", "parapoint"}
    as_points = row.method == "parapoint" and (with_heat or bool(published_values(row.case)))
    return (
        *(kind for kind in TEXTURED_PICTURES if second_view or kind != "checker-2"),
        *HEAT_PICTURES * with_heat,
        *CLOUD_PICTURES * as_points,
        VIEWED,
    )


def model_file(case: str, kind: str) -> str:
    """File name of a picture of a model, or of what the viewer reads."""
    return f"{slug(case)}.{kind}.{_ending(kind)}"


def map_file(row: ResultRow, kind: str) -> str:
    """File name of a picture of a map, or of what the viewer reads."""
    return f"{slug(row.case)}.{slug(row.method)}.{row.id[:8]}.{kind}.{_ending(kind)}"


def _ending(kind: str) -> str:
    return "js" if kind == VIEWED else "webp"


def draw(contents: Contents, folder: Path, jobs: int) -> list[str]:
    """Draw the pictures of the suite that `folder` lacks; what could not be drawn, and why.

    `jobs` processes share the models.
    """
    folder.mkdir(parents=True, exist_ok=True)
    record = folder / "keys.json"
    known = known_keys(record)
    source = source_hash(__name__)
    with_heat = not contents.is_large
    work: list[tuple[list[ResultRow], list[str]]] = []
    keys: dict[str, str] = {}
    for case in contents.cases:
        rows = [row for row in contents.rows if row.case == case and row.surface_hash]
        if not rows:
            continue
        todo: list[ResultRow] = []
        missing: list[str] = []
        latest, points = rows[-1], case in contents.clouds
        artist = contents.store.reference_path(latest.surface_hash).exists()
        names = [model_file(case, kind) for kind in model_kinds(points=points, artist=artist)]
        wanted = dict.fromkeys(names, (latest, str(artist)))
        for row in rows:
            if row.status == "ok":
                own = map_kinds(row, points=points, with_heat=with_heat)
                files = (map_file(row, kind) for kind in own)
                wanted |= dict.fromkeys(files, (row, row.uv_sha256))
        for name, (row, content) in wanted.items():
            text = f"{source} {with_heat} {row.surface_hash} {content}"
            keys[name] = hashlib.sha256(text.encode()).hexdigest()[:16]
            if known.get(name) != keys[name] or not (folder / name).exists():
                missing.append(name)
                if row not in todo:
                    todo.append(row)
        if todo:
            work.append((todo, missing))
    faults: list[str] = []
    wanting = itertools.chain.from_iterable(missing for _, missing in work)
    done = {name: keys[name] for name in keys.keys() - set(wanting)}
    made = _results(contents.store, work, folder, with_heat, jobs)
    for (_, missing), (failed, said) in zip(work, made, strict=True):
        faults += said
        done |= {name: keys[name] for name in set(missing).difference(failed)}
        _note(record, known | done)  # a report that is stopped goes on where it was
    for name in known.keys() - done.keys():  # of a cell that gave way to a newer one
        (folder / name).unlink(missing_ok=True)
    _note(record, done)
    return faults


def _note(record: Path, keys: Mapping[str, str]) -> None:
    """Keep what `known_keys` is to return."""
    record.write_text(json.dumps(keys, indent=0, sort_keys=True) + "\n")


PLAIN_NAME = re.compile(r"\w[\w.+-]*")
"""Names that may stand in a record of what was drawn: no folders, nothing hidden."""


def known_keys(record: Path) -> dict[str, str]:
    """The keys of what was drawn before; none where the file is missing or damaged.

    A folder of results may come from elsewhere, and these names become those of files: what is not
    the plain name of a file in this very folder is left out.
    """
    try:
        content = json.loads(record.read_bytes())
    except (OSError, ValueError):
        return {}
    if not isinstance(content, dict):
        return {}
    return {name: key for name, key in content.items() if PLAIN_NAME.fullmatch(name)}


def _results(
    store: Store,
    work: list[tuple[list[ResultRow], list[str]]],
    folder: Path,
    with_heat: bool,
    jobs: int,
) -> Iterator[tuple[list[str], list[str]]]:
    make = partial(draw_model, store.folder, folder, with_heat)
    if jobs <= 1 or len(work) <= 1:
        for todo in work:
            yield make(*todo)
        return
    with ProcessPoolExecutor(min(jobs, len(work)), mp_context=get_context("spawn")) as pool:
        pending = [pool.submit(make, *todo) for todo in work]
        for done in pending:
            yield done.result()


def draw_model(
    results: Path, folder: Path, with_heat: bool, rows: list[ResultRow], missing: Sequence[str]
) -> tuple[list[str], list[str]]:
    """Draw the maps of `rows` and, if files of it are `missing`, their model.

    The files that could not be drawn, and why.
    """
    store = Store(results)
    case = rows[0].case
    artist = store.reference_path(rows[-1].surface_hash).exists()
    failed: list[str] = []
    faults: list[str] = []

    def files_of(row: ResultRow, points: bool) -> list[str]:
        own = map_kinds(row, points=points, with_heat=with_heat)
        return [map_file(row, kind) for kind in own if row.status == "ok"]

    try:
        surface = store.surface(rows[-1])
    except InputError as error:
        everything = [model_file(case, kind) for kind in model_kinds(points=False, artist=artist)]
        everything += [name for row in rows for name in files_of(row, points=False)]
        return everything, [f"{case}: no pictures: {error}"]
    points = isinstance(surface, PointCloud)
    size = SIZE if with_heat else SMALL
    subject = (
        clouds.Portrait(surface, size, SAMPLES, FIELDS)
        if isinstance(surface, PointCloud)
        else Portrait(surface, size)
    )
    kinds = model_kinds(points=points, artist=artist)
    if not {model_file(case, kind) for kind in kinds}.isdisjoint(missing):
        for kind, content in subject.model().items():
            save(content, folder / model_file(case, kind))
    if not {model_file(case, kind) for kind in ARTIST_PICTURES}.isdisjoint(missing):
        try:
            made = subject.map(store.reference(rows[-1]), ("checker-1", "layout"))
            for kind, content in zip(ARTIST_PICTURES, made.values(), strict=True):
                save(content, folder / model_file(case, kind))
        except InputError as error:
            failed += [model_file(case, kind) for kind in ARTIST_PICTURES]
            faults.append(f"{case}: no picture of the artist's map: {error}")
    for row in rows:
        if row.status != "ok":
            continue
        try:
            result = store.result(row)
            kinds = map_kinds(row, points=points, with_heat=with_heat)
            for kind, content in subject.map(result, kinds).items():
                save(content, folder / map_file(row, kind))
        except InputError as error:
            failed += files_of(row, points)
            faults.append(f"{case}, {row.method}: no pictures: {error}")
    return failed, faults


class Portrait:
    """A mesh, ready to be drawn under any map."""

    def __init__(self, mesh: Mesh, size: int) -> None:
        """Pictures of `size` pixels."""
        self.mesh = mesh
        self._size = size
        self._scene = Scene(mesh)
        cameras = render.two_cameras(self._scene)
        self._views = [self._scene.view(camera, size, SAMPLES) for camera in cameras]

    def model(self) -> Mapping[str, Content]:
        """The files of the mesh itself by their kind."""
        made: dict[str, Content] = {
            kind: meshed(view) for kind, view in zip(MODEL_PICTURES, self._views, strict=True)
        }
        sky = self._scene.coarse_openness
        return made | {VIEWED: viewer.shape(self.mesh, self._views[0].camera, sky)}

    def map(self, result: object, kinds: Sequence[str]) -> Mapping[str, Content]:
        """The files of a map by their kind, those of `kinds`.

        Raises:
            InputError: the map is not of this mesh, or there is nothing to see.
        """
        if not isinstance(result, Parameterization) or len(result.corners) != len(self.mesh.faces):
            raise InputError("the map is not of this mesh")
        found = Map(self.mesh, result)
        if not found.has_area:
            raise InputError("the map has no area")
        first, second = self._views
        layout = Layout(found, self._size)
        colours = normal_colours(self._scene, first.camera)

        makers: dict[str, Callable[[], Content]] = {
            "checker-1": lambda: textured(first, found),
            "checker-2": lambda: textured(second, found),
            "layout": lambda: layout.image(colours),
            "angle": lambda: first.image(heat(found.angle, ANGLE_SCALE)[first.face]),
            "angle-uv": lambda: layout.image(heat(found.angle, ANGLE_SCALE)),
            "area": lambda: first.image(heat(found.area, AREA_SCALE)[first.face]),
            "area-uv": lambda: layout.image(heat(found.area, AREA_SCALE)),
            VIEWED: lambda: viewed(found),
        }
        made = {kind: makers[kind]() for kind in kinds if kind in makers}
        if CLOUD_PICTURES[0] in kinds:
            uv = found.uv - found.uv.min(axis=(0, 1))
            squares = FIELDS / self._scene.size
            made |= clouds.images(first, uv, found.spanning, colours, squares)
        return made


def viewed(found: Map) -> viewer.Script:
    """Facts and arrays of a map, as the viewer draws it."""
    return viewer.uv_map(
        found.mesh,
        found.parameterization,
        found.uv,
        distortion={
            "angle": (found.angle, *ANGLE_SCALE[1:]),
            "area": (found.area, *AREA_SCALE[1:]),
        },
        spanning=found.spanning,
        flipped=found.flipped,
    )


def save(content: Content, path: Path) -> None:
    """Write a script, or a picture as WebP: the same content gives the same bytes."""
    if isinstance(content, tuple):
        path.write_text(viewer.script(path.name, *content), encoding="utf-8")
    else:
        Images.fromarray(content).save(path, format="WebP", quality=78, method=4)
