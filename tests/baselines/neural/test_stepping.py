"""Training within steps and seconds."""

import torch

from baselines.neural.stepping import trained
from parapoint import clock


def steps(seconds):
    network = torch.nn.Linear(2, 1)
    at = torch.ones(4, 2)
    return len(
        list(trained(network, lambda: {"all": network(at).square().mean()}, 1e-2, 5, seconds))
    )


def test_training_ends_with_its_steps_or_its_seconds():
    assert steps(None) == steps(1e6) == 5
    assert steps(1e-6) <= 1
    assert steps(-1.0) <= 1  # another part of the work took all


def test_training_ends_where_its_time_is_over(monkeypatch):
    """A second passes at each look at the clock, one a step."""
    monkeypatch.setattr(clock, "worked", map(float, range(100)).__next__)
    assert steps(3.5) == 3
