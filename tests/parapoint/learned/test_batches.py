"""Batches: patches of neighbouring points, and a lattice that fills the square."""

import numpy as np
import pytest
import torch

from parapoint.learned.batches import Cloud, lattice


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def line(count: int = 60) -> torch.Tensor:
    """(2, count, 3) points along the x axis, a point at each whole number; and vectors at them."""
    rows = torch.zeros(2, count, 3)
    rows[0, :, 0] = torch.arange(count)
    rows[1, :, 1] = torch.arange(count)
    return rows


def test_a_batch_is_made_of_patches_of_neighbours() -> None:
    batch = Cloud(line(), 5).drawn(23, generator())
    assert batch.shape == (2, 20, 3)
    patches = batch[0, :, 0].reshape(4, 5)
    centres = patches[:, 0]
    assert len(centres.unique()) == 4
    inside = (centres > 1) & (centres < 58)
    assert torch.equal(patches[inside].sort(1).values, centres[inside, None] + torch.arange(-2, 3))
    assert torch.equal(batch[1, :, 1], batch[0, :, 0])  # vectors stay with their points


def test_patches_of_one_are_points_drawn_without_repetition() -> None:
    batch = Cloud(line(), 1).drawn(40, generator())[0, :, 0]
    assert len(batch.unique()) == len(batch) == 40
    assert not torch.equal(batch, batch.sort().values)
    assert not torch.equal(batch, Cloud(line(), 1).drawn(40, generator(1))[0, :, 0])


@pytest.mark.parametrize("patch", [1, 8, 100])
def test_as_many_points_as_there_are_come_once_and_in_their_order(patch: int) -> None:
    assert torch.equal(Cloud(line(), patch).drawn(60, generator()), line())


@pytest.mark.parametrize(("count", "patch", "expected"), [(1, 8, 8), (7, 8, 8), (59, 100, 60)])
def test_a_batch_has_at_least_one_patch(count: int, patch: int, expected: int) -> None:
    assert Cloud(line(), patch).drawn(count, generator()).shape[1] == expected


def test_a_lattice_has_one_point_in_each_cell() -> None:
    points = lattice(4, torch.Generator().manual_seed(0)).numpy()
    cells = np.floor((points + 1) * 2).astype(int)
    assert len(np.unique(cells, axis=0)) == 16
    assert cells.min() == 0
    assert cells.max() == 3
