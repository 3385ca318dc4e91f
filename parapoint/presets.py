"""Presets: every number of the method, frozen. `paper` holds what the text fixes."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Preset:
    """All numbers of a run.

    The defaults are the paper's wherever it gives a number; those it leaves open say so.

    Attributes:
        hidden: hidden layer sizes of every stack.
        embedding: d, channels of the embedding in Deform and Cut.
        activation: "leaky_relu" (slope 0.01) or "softplus" (sharpness 10).
        octaves: sines and cosines of the coordinates at this many octaves go into the stacks
            beside 3D points; 0 in the paper.
        branches: "both", or one of the ablations "3d" (3D→2D→3D alone) and "2d".
        points: training points.
        iterations: steps, warm-up included (the text gives none; the group's later code 10,000).
        subset: points of a step before `all_from`, drawn anew each time (open: "a sparser subset").
        all_from: share of the run after which each step takes all points (open: "later").
        warm_up: share of the run that goes to the points' convex hull (open).
        perturbation: standard deviation of the noise on points, in mean distances between
            neighbouring training points (open: "slightly").
        unwrap_weight, wrap_weight, cycle_weight, distortion_weight, anti_flip_weight: weights.
        distortion: "conformal" or "isometric".
        eigenvalues: "singular" values of the Jacobian, or of its "gram" matrix (open).
        intrinsic_weight: of the conformal term on the cloud's own tangent planes; not the paper's.
        unwrap_neighbours: K_u (open; the group's later code has 8).
        unwrap_spacing: ε = spacing · L(Q) / √N.
        anti_flip_neighbours: K of the anti-flip term.
        anti_flip_angle: T_angle.
        seam_neighbours: K_cut.
        seam_threshold: T_cut, a fraction of L(Q).
        learning_rate, final_learning_rate: ends of the cosine (open; from the later code).
        weight_decay: of AdamW (open; from the later code).
        precision: "float32", or "bfloat16" for the wide products of training where the processor
            has units for them (twice as fast; the gradient's direction stays, cosine 0.9995).
    """

    hidden: tuple[int, ...] = (64, 128, 512, 128)
    embedding: int = 64
    activation: str = "leaky_relu"
    octaves: int = 0
    branches: str = "both"
    points: int = 10_000
    iterations: int = 10_000
    subset: int = 2_048
    all_from: float = 0.5
    warm_up: float = 0.25
    perturbation: float = 0.1
    unwrap_weight: float = 0.01
    wrap_weight: float = 1.0
    cycle_weight: float = 0.01
    distortion_weight: float = 0.01
    anti_flip_weight: float = 0.01
    distortion: str = "conformal"
    eigenvalues: str = "singular"
    intrinsic_weight: float = 0.0
    unwrap_neighbours: int = 8
    unwrap_spacing: float = 0.1
    anti_flip_neighbours: int = 4
    anti_flip_angle: float = math.pi / 2
    seam_neighbours: int = 3
    seam_threshold: float = 0.01
    learning_rate: float = 1e-3
    final_learning_rate: float = 1e-5
    weight_decay: float = 1e-8
    precision: str = "float32"


PAPER = Preset()
FAST = Preset(hidden=(256, 256, 256), activation="softplus")
PRESETS = {"paper": PAPER, "fast": FAST}
