"""Training within steps and seconds."""

import torch

from baselines.neural.stepping import trained


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
