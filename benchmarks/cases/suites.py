"""The suites as data: the models, methods and seeds of each table."""

from __future__ import annotations

import difflib
import hashlib
import json
from dataclasses import dataclass

from benchmarks.cases.builtin import BUILTIN
from benchmarks.cases.coloured import WAVES
from benchmarks.cases.derived import seam_digest
from benchmarks.cases.models import registry
from parapoint.errors import InputError


@dataclass(frozen=True)
class Suite:
    """The cells of one table.

    Attributes:
        name: its name on the command line.
        title: the heading of its table.
        cases: canonical names of models, in the order of the rows.
        methods: specs, `name` or `name(key=value, ...)`, in the order of the columns.
        seeds: the seeds of each case and method.
        version: raised by one when the cases or the seeds change once results are published.
    """

    name: str
    title: str
    cases: tuple[str, ...]
    methods: tuple[str, ...]
    seeds: tuple[int, ...] = (0,)
    version: int = 1

    @property
    def digest(self) -> str:
        """16 hexadecimal digits over what makes results comparable: cases, their files, seeds."""
        models = [registry().get(name.partition("@")[0]) for name in self.cases]
        files = [
            (model.sha256 if model else "") + seam_digest(name)
            for name, model in zip(self.cases, models, strict=True)
        ]
        text = json.dumps([self.name, self.version, self.cases, files, self.seeds])
        return hashlib.sha256(text.encode()).hexdigest()[:16]


ISOMETRIC = "slim(energy=symmetric_dirichlet)"
ONE_ITERATION = "slim(energy=symmetric_dirichlet, iterations=1)"
CONFORMAL = "slim(energy=conformal)"

MESH_METHODS = ("tutte", "lscm", ISOMETRIC, CONFORMAL, "xatlas")

# The paper's training and ours, each with half of the 300 seconds that one core has for a cell: the
# suite `paper` has six cells of each, and runs two at a time.
PAPER = "parapoint(preset=paper, time_budget=150)"
LEARNED = "parapoint(preset=learned, time_budget=150)"
PAPER_SHORT = "parapoint(preset=paper, points=2048, iterations=300, subset=256, all_from=0.99)"
COMPUTED = "computed(time_budget=120)"
COMPUTED_CONFORMAL = "computed(distortion=conformal, time_budget=120)"
# The budget of PAPER for the neural maps of other authors.
EQUAL = "points=4096, subset=256, time_budget=150"

HYBRID = "unwrap(time_budget=120)"
LEARNED_SEAM = "unwrap(time_budget=120, price=None)"

# What a user with a scan would do today: every reconstruction, followed by every flattening.
MESHED_METHODS = tuple(
    f"meshed(reconstruction={reconstruction}, flattening={flattening})"
    for reconstruction in ("poisson", "ball_pivoting")
    for flattening in ("xatlas", "lscm", "slim")
)
SAMPLED_MODELS = ("camelhead", "bunny_i_f10000", "cowhead_bff", "fairing-cross")
COLOURED_MODELS = ("spot_c3d", "max_planck_i_f8000", "camelhead", "fertility")
SAMPLINGS = ("noise=0", "noise=0.005", "noise=0.01", "uneven")

NEFERTITI = "nefertiti-lowres_odedstein"
PAPER_CASES = (
    "beetle_igl",
    "mannequin-devil",
    "keenan-ogre",
    "hand_1_i_f5000",
    "max_planck_i_f8000",
    NEFERTITI,
)
QUALITY_CASES = (
    "beetle_igl",
    "hand_1_i_f5000",
    "max_planck_i_f8000",
    "camelhead",
    "keenan-ogre",
    "mannequin-devil",
    NEFERTITI,
    "fertility",
    "rocker-arm",
    "fandisk",
)


def ablated(option: str) -> str:
    """The paper's training, with one option changed."""
    return PAPER.replace(")", f", {option})")


def field(seconds: int) -> tuple[str, ...]:
    """Every method of the field, those that take a budget with so many seconds."""
    return (
        "tutte",
        "harmonic",
        "mean_value",
        "lscm",
        "bff",
        "abf",
        "blender_angle_based",
        "arap",
        ISOMETRIC,
        CONFORMAL,
        f"smith_schaefer(time_budget={seconds})",
        "geometry_image",
        "automatic+slim",
        "seamster",
        "erickson_har_peled",
        "da_wand",
        f"unwrap(time_budget={seconds})",
        "xatlas",
        "uvatlas",
        "uvunwrap",
        f"computed(time_budget={seconds})",
        f"parapoint(preset=paper, time_budget={seconds})",
        f"parapoint(preset=learned, time_budget={seconds})",
        f"foldingnet(time_budget={seconds})",
        f"atlasnet(time_budget={seconds})",
        f"diffsr(time_budget={seconds})",
        f"elestruc(time_budget={seconds})",
        f"gtif(time_budget={seconds})",
        f"tearingnet(time_budget={seconds})",
        f"flattening_net(time_budget={seconds})",
        f"reggeonet(time_budget={seconds})",
        f"nsm(time_budget={seconds})",
        f"fam(points=4096, subset=256, time_budget={seconds})",
        f"nuvo(points=4096, subset=256, time_budget={seconds})",
        f"nuvo(charts=4, time_budget={seconds})",
    )


def members(*sets: str) -> tuple[str, ...]:
    """Names of all models in some sets of the registry."""
    return tuple(model.name for model in registry().values() if model.set in sets)


WELL_BEHAVED = members("disk", "closed", "genus", "cad", "artist")

SUITES: dict[str, Suite] = {
    suite.name: suite
    for suite in [
        Suite(
            "smoke",
            "Smoke run: two models, small budgets",
            ("hand_1_i_f5000", "cylinder_cgal"),
            (
                "tutte",
                "lscm",
                "slim(energy=symmetric_dirichlet, iterations=5)",
                PAPER_SHORT,
                "computed(time_budget=30)",
            ),
        ),
        Suite(
            "builtin",
            "Surfaces made in memory, with known answers",
            tuple(BUILTIN),
            (*MESH_METHODS, PAPER_SHORT),
        ),
        Suite(
            "paper",
            "The supplement's comparison: five disks and nefertiti",
            PAPER_CASES,
            (
                "tutte",
                "lscm",
                ISOMETRIC,
                ONE_ITERATION,
                CONFORMAL,
                "xatlas",
                PAPER,
                LEARNED,
                COMPUTED,
                COMPUTED_CONFORMAL,
            ),
        ),
        Suite(
            "drawn",
            "Nefertiti along a seam drawn by hand, and along the automatic cut",
            (f"{NEFERTITI}@drawn", NEFERTITI),
            ("lscm", ISOMETRIC, ONE_ITERATION, CONFORMAL),
        ),
        Suite("disk", "Disks", members("disk"), (*MESH_METHODS, COMPUTED)),
        Suite("closed", "Closed surfaces of genus 0", members("closed"), (*MESH_METHODS, COMPUTED)),
        Suite("genus", "Closed surfaces with handles", members("genus"), (*MESH_METHODS, COMPUTED)),
        Suite("cad", "CAD parts", members("cad"), (*MESH_METHODS, COMPUTED)),
        Suite("artist", "Models with a UV map of their own", members("artist"), MESH_METHODS),
        Suite("wild", "Defective meshes", members("wild"), (*MESH_METHODS, COMPUTED)),
        Suite(
            "scans",
            "Point clouds and noisy scans",
            members("scans"),
            (*MESH_METHODS, *MESHED_METHODS, COMPUTED, PAPER),
        ),
        Suite(
            "noise",
            "Clouds sampled from disks: noise in fractions of the diagonal, uneven density",
            tuple(f"{model}@{how}" for model in SAMPLED_MODELS for how in SAMPLINGS),
            (*MESHED_METHODS, COMPUTED, PAPER),
        ),
        Suite(
            "bake",
            "Coloured clouds as textured meshes: colours of held-out points read back",
            (
                *(f"{model}@{colours}" for model in COLOURED_MODELS for colours in WAVES),
                "milk",
                "simple",
            ),
            tuple(
                f"textured(pipeline={pipeline})"
                for pipeline in ("computed", "poisson", "ball_pivoting")
            ),
        ),
        Suite(
            "cuts",
            "SLIM along automatic, learned and artists' seams",
            members("artist", "closed", "genus"),
            (
                ISOMETRIC,
                "automatic+slim",
                "seamster",
                "erickson_har_peled",
                LEARNED_SEAM,
                HYBRID,
                "artist+slim",
            ),
        ),
        Suite(
            "core",
            "All well-behaved models",
            tuple(dict.fromkeys([*PAPER_CASES, *WELL_BEHAVED])),
            (*MESH_METHODS, COMPUTED),
        ),
        Suite(
            "neural",
            "Neural maps with 150 s each",
            (*PAPER_CASES, "camelhead"),
            (
                PAPER,
                LEARNED,
                f"fam({EQUAL})",
                f"nuvo({EQUAL})",
            ),
        ),
        Suite(
            "field",
            "The paper's field: every method on the same models, 60 s each",
            (*PAPER_CASES, "camelhead"),
            field(60),
        ),
        Suite(
            "field300",
            "The paper's field: every method on the same models, 300 s each",
            (*PAPER_CASES, "camelhead"),
            field(300),
        ),
        Suite(
            "hard",
            "The paper's field on defective meshes and on scans, 5 s each: who gives a map",
            members("wild", "scans"),
            field(5),
        ),
        Suite(
            "ablation",
            "The paper's ablation: distortion terms, branches, and each term left out",
            ("cube_odedstein", "cylinder_cgal", "eight_cfwen", "hand_1_i_f5000"),
            (
                PAPER,
                ablated("distortion=isometric"),
                ablated("branches='2d'"),
                ablated("branches='3d'"),
                ablated("distortion_weight=1e-4"),
                ablated("distortion_weight=0"),
                ablated("unwrap_weight=0"),
                ablated("cycle_weight=0"),
                ablated("anti_flip_weight=0"),
            ),
        ),
        Suite(
            "seeds",
            "ParaPoint over five seeds",
            PAPER_CASES,
            (PAPER, LEARNED),
            (0, 1, 2, 3, 4),
        ),
        Suite(
            "gpu",
            "The paper's whole budget, 10,000 points and steps, on a GPU",
            PAPER_CASES,
            ("parapoint(preset=paper, device=cuda)",),
        ),
        Suite(
            "quality",
            "The computed map on ten models, three seeds",
            QUALITY_CASES,
            ("lscm", ISOMETRIC, CONFORMAL, COMPUTED, COMPUTED_CONFORMAL),
            (0, 1, 2),
        ),
    ]
}
"""All suites by name."""


def suite(name: str) -> Suite:
    """The suite of this name.

    Raises:
        InputError: there is none; the message names all suites.
    """
    if name not in SUITES:
        near = difflib.get_close_matches(name, SUITES, n=1)
        hint = f"perhaps {near[0]}; " if near else ""
        raise InputError(f"there is no suite {name!r}; {hint}there are {', '.join(SUITES)}")
    return SUITES[name]
