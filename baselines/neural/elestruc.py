"""EleStruc: AtlasNet with learned shapes in place of its squares."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from baselines.neural.atlasnet import AtlasNet
from parapoint.parameters import check_whole

if TYPE_CHECKING:
    import torch

    from baselines.neural.sheets import Sheets


@dataclass(frozen=True)
class EleStruc(AtlasNet):
    """Learned elementary structures, each adjusted to a part of the surface.

    T. Deprelle, T. Groueix, M. Fisher, V. G. Kim, B. C. Russell and M. Aubry 2019, "Learning
    elementary structures for 3D shape generation and matching". A network deforms the square to a
    structure in n dimensions ("deformation learning"), another adjusts the structure to the
    surface; both learn together under the Chamfer distance. The paper's other kind, "point
    learning", moves single points freely: between them there is no surface to find a preimage on,
    so it is left out. A structure starts as the square itself; uv is the place in the square.

    In the paper the structures are shared by a collection of shapes and an encoder tells the
    adjustment which shape is meant. Of one shape there is no collection: a structure is then what
    helps this one, and square and structure give a deeper network than AtlasNet's.

    Attributes:
        dimension: n, of the space in which the structures lie, 2 to 10.
    """

    dimension: int = 3

    def __post_init__(self) -> None:
        super().__post_init__()
        check_whole("dimension", self.dimension, 2, 10)

    def networks(self, generator: torch.Generator) -> Sheets:
        """See `SheetMethod`."""
        from baselines.neural.elestruc_networks import EleStrucNetworks

        return EleStrucNetworks(self.charts, self.dimension, generator)
