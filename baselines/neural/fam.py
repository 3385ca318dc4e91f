"""Flatten Anything, the later model of ParaPoint's authors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from baselines.neural.method import NeuralMethod

if TYPE_CHECKING:
    from baselines.neural.training import SurfaceTrainer


@dataclass(frozen=True)
class FAM(NeuralMethod):
    """Flatten Anything: neural, global and free-boundary like ParaPoint, with given normals.

    Q. Zhang, J. Hou, W. Wang and Y. He 2024, "Flatten Anything: Unsupervised Neural Surface
    Parameterization". Offsets in Deform and Cut, no Stitch, Wrap gives normals too, which the cycle
    loss holds against those of the surface (left out for clouds without). What that text leaves
    open is as in the authors' released training: layer sizes, means in the losses, the unwrapping
    loss on three sets of coordinates, distortion on the 3D→2D→3D branch alone with eigenvalues of
    JᵀJ.
    """

    def trainer(self) -> type[SurfaceTrainer]:
        """See `NeuralMethod`."""
        from baselines.neural.fam_training import FAMTrainer

        return FAMTrainer
