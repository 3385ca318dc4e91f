"""Presets: every number of the method, frozen. `paper` holds what the text fixes."""

from __future__ import annotations

import math
from dataclasses import dataclass

from parapoint.errors import InputError


@dataclass(frozen=True)
class Preset:
    """All numbers of a run.

    The defaults are the paper's wherever it gives a number; those it leaves open say so.

    Attributes:
        hidden: hidden layer sizes of every stack.
        embedding: d, channels of the embedding in Deform and Cut.
        activation: "leaky_relu" (slope 0.01) or "squareplus" (width 0.2).
        is_computed: whether Cut and Stitch hold a computed map (`parapoint.computed.flattening`),
            so that Deform alone is trained; `SMOOTH` stands in where there is none.
        branches: "both", or one of the ablations "3d" (3D→2D→3D alone) and "2d".
        points: training points.
        iterations: steps, warm-up included (the text gives none; the group's later code 10,000).
        subset: points that go through the networks in a step before `all_from`, drawn anew each
            time (open: "a sparser subset"); the Chamfer distance is to all points throughout.
        patch: points of a step that lie beside one another, each centre's nearest of all points, so
            that terms which compare neighbours see neighbours; 1 draws each for itself (open).
        all_from: share of the run after which each step takes all points (open: "later").
        starts: runs from other weights, of which the one with the lowest loss goes on (open).
        start_share: share of the run that goes to each, where there are several (open).
        warm_up: share of the run that goes to the points' convex hull (open).
        perturbation: standard deviation of the noise on points, in mean distances between
            neighbouring training points (open: "slightly").
        unwrap_weight, wrap_weight, cycle_weight, distortion_weight, anti_flip_weight: weights.
        unfolding_weight: of `losses.unfolding_loss` on the cloud's tangent planes; 0 in the paper,
            which then does without normals.
        distortion: "conformal" or "isometric".
        eigenvalues: "singular" values of the Jacobian, or of its "gram" matrix (open).
        unwrap_neighbours: K_u (open; the group's later code has 8).
        unwrap_spacing: ε = spacing · L(Q) / √N.
        anti_flip_neighbours: K of the anti-flip term.
        anti_flip_angle: T_angle.
        seam_neighbours: K_cut.
        seam_threshold: T_cut, a fraction of L(Q).
        optimizer: "adamw", as in the group's later code, or "soap" (open).
        learning_rate: with which the run begins; None takes the optimiser's own (open).
    """

    hidden: tuple[int, ...] = (64, 128, 512, 128)
    embedding: int = 64
    activation: str = "leaky_relu"
    is_computed: bool = False
    branches: str = "both"
    points: int = 10_000
    iterations: int = 10_000
    subset: int = 2_048
    patch: int = 1
    all_from: float = 0.5
    starts: int = 1
    start_share: float = 0.05
    warm_up: float = 0.15
    perturbation: float = 0.1
    unwrap_weight: float = 0.01
    wrap_weight: float = 1.0
    cycle_weight: float = 0.01
    distortion_weight: float = 0.01
    anti_flip_weight: float = 0.01
    unfolding_weight: float = 0.0
    distortion: str = "conformal"
    eigenvalues: str = "singular"
    unwrap_neighbours: int = 8
    unwrap_spacing: float = 0.1
    anti_flip_neighbours: int = 4
    anti_flip_angle: float = math.pi / 2
    seam_neighbours: int = 3
    seam_threshold: float = 0.01
    optimizer: str = "adamw"
    learning_rate: float | None = None


PAPER = Preset()
"""The paper."""

SMOOTH = Preset(
    hidden=(256, 256, 256),
    activation="squareplus",
    subset=512,
    all_from=1.0,
    iterations=3_000,
    cycle_weight=0.1,
    unfolding_weight=0.1,
)
"""The paper's training with smooth networks, for clouds that `fast` cannot follow. It departs from
the paper in a smooth activation (a piecewise linear network has a piecewise constant Jacobian), in
layers of equal width, in a larger weight of the cycle, and in a conformal term on the tangent
planes of the cloud, signed by normals that are oriented inside, so that folds are pushed out. On a
disk of 3,400 vertices a smooth activation halved the angle distortion at equal cost (0.088 to
0.040), and the term brought it to 0.024; that was a softplus. The squareplus in its place makes a
step 7 % faster; angles are as good within what seeds differ by: 0.120 for 0.119 on max planck after
1,500 steps (overlap 1.49 for 1.14), 0.253 for 0.274 in the mean of six runs of 400 steps, of which
both on max planck are worse."""

FAST = Preset(
    hidden=(256, 256, 256),
    activation="squareplus",
    is_computed=True,
    points=20_000,
    subset=512,
    all_from=1.0,
    warm_up=0.0,
    iterations=100,
    cycle_weight=0.1,
)
"""Ours. The forward map is computed, and held by the networks; it is not trained. It departs from
the paper in this:

- The map is computed on the bare cloud (`parapoint.computed.reconstruction`,
  `parapoint.computed.flattening`) in place of the warm-up on the hull and the training. Mean angle
  distortion over all faces, radians: beetle 0.011 (best published figure 0.037), camelhead 0.031
  (0.088), hand 0.078 (0.145), nefertiti 0.033 (0.117), max planck 0.044 (0.117), fertility 0.087
  (0.166), rocker-arm 0.032 (0.143), the worst of three seeds, in 6 to 53 s of one core. The
  settings were chosen on these among others.
- The map is bijective on the triangulation (`parapoint.computed.bijection`). Against two linear
  solves, with fronts alone and off the faces that span the seam, nefertiti overlapped itself by 0.6
  % of its area in place of 18 %, fertility by 0.03 % in place of 7 %.
- The cloud's triangulation is cut on where Tutte's embedding, from which the descent may start, is
  too small for numbers: along horns and tails, and to strips in holes. A dinosaur on which nothing
  had been chosen has 0.8 % of its faces flipped in place of 46 %.
- The map is laid out by an even scale (`parapoint.computed.scale`, `parapoint.computed.layout`)
  before it is made bijective, and cuts lead to where scale and distance are extreme. Against a
  descent on isometric and conformal energies alone the area discrepancy off the spanning faces is
  0.46 in place of 1.28 for bunny, 0.38 in place of 0.75 for nefertiti, 0.51 in place of 0.78 for
  hand (0.356 in place of 0.491 for camelhead, 0.43 in place of 0.41 for fertility), and the angle
  distortion is no larger on any of the ten; 0.003 % of rocker-arm's UV area is flipped in place of
  1.5 %.
- Noisy clouds are denoised first (`parapoint.computed.denoising`) where that halves the defects of
  the triangulation; none of the ten models counts as noisy.
- The triangulation is the best of two fronts and of one between inside and outside
  (`parapoint.computed.delaunay`), which tells apart the sheets of thin parts. Gargoyle, on which it
  was developed, has no handle in place of 24, and 0.10 % of its faces flipped in place of 26 %;
  lucy, on which nothing was chosen, one in place of 48, and 2.0 % in place of 21 %; nefertiti has
  0.02 to 0.05 % in place of 0.19 to 0.42 % on three seeds.
- A coarse mesh gives points of its faces, too (`parapoint.surfaces.sampling`): its vertices alone
  do not show parts that are nearer to one another than vertices are. Of lucy 0.3 % of the faces are
  flipped in place of 2.0 %, of seamster's cow 0.5 in place of 2.0 %, of camel_b 1 in place of 16 %,
  of teapot 1 in place of 7 %. On 12 models that their vertices show, 20,000 points leave 29 to 55 %
  less angle distortion between the vertices; at these it moves by at most 0.005 (gargoyle 0.101 to
  0.089), fertility overlaps itself by up to 0.9 % in place of 0, and it takes 10 to 20 s more.
- Triangles along the points' own sheets (`parapoint.computed.sheets`) are taken where sheets cross,
  as no complex of tetrahedra holds two that do. Of keenan-ogre, whose eyeball runs through its
  socket and on which this was developed, 0.37 % of the faces are flipped in place of 0.73 %, and
  0.6 % of the area overlaps in place of 6 %.
- It fails where the triangulation does: of mannequin-devil 2.3 % of the faces are flipped (6.2 % by
  fronts alone), and 3.4 % of the area overlaps, nearly all in two crumpled nostrils and along
  rolled eyelids, which cross themselves and have some eight points a turn. Along the model's own
  faces the same flattening leaves no flip and no overlap.
- Cut and Stitch are layers of local features that blend affine maps at anchors
  (`parapoint.computed.anchored`); Unwrap and Wrap drop and add a coordinate. The anchors are the
  fitted
  points: a map is kept exactly at these and interpolated between. Of nefertiti's 35,000 vertices
  20,000 are anchors, and the mean error of the inverse over all is 0.0003 of the radius.
- Deform alone is trained, by the paper's objective. What moved Cut and Stitch as well made the map
  and its inverse worse: hand from 0.128 to 0.265 in 150 steps of an early version.
- 20,000 points in place of 10,000, as anchors cost little.

Where no map can be computed, `SMOOTH` is trained on the same points; the report says so."""

PRESETS = {"paper": PAPER, "smooth": SMOOTH, "fast": FAST}


def named(preset: str) -> Preset:
    """The preset of that name.

    Raises:
        InputError: there is none.
    """
    if preset not in PRESETS:
        raise InputError(f"no preset {preset!r}; there are: {', '.join(PRESETS)}")
    return PRESETS[preset]
