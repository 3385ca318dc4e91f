"""Optimisers: AdamW, the choice of the paper's group, and SOAP, which needs far fewer steps."""

from __future__ import annotations

from typing import ClassVar, Protocol

import torch
from torch import Tensor

WIDEST = 256
"""Rows or columns of a matrix up to which SOAP turns that side of it. The paper's networks have one
wider layer each, of 512: turning that side, too, takes as long as the networks' own products."""
REFRESH = 10
"""Steps between two refreshes of SOAP's bases."""
DECAY = 0.95
"""What SOAP's averages keep of the past at each step."""
TINY = 1e-8
"""Added to the root of the second moment, below which a gradient counts as none."""


class Optimizer(Protocol):
    """What a trainer needs of an optimiser.

    Attributes:
        learning_rate: with which a run begins where the preset names none.
    """

    learning_rate: ClassVar[float]

    def step(self, learning_rate: float) -> None:
        """Move the parameters that have a gradient, and drop the gradients."""
        ...

    def state(self) -> dict[str, Tensor]:
        """All that the next step depends on beside the parameters, by name, not copied."""
        ...

    def restore(self, state: dict[str, Tensor]) -> None:
        """Copy in what `state` returned."""
        ...


class AdamW:
    """Adam with decoupled weight decay (Loshchilov and Hutter 2019, algorithm 2).

    The same as `torch.optim.AdamW`, whose first use takes two seconds of imports. The learning rate
    and the weight decay are those of the group's later code.
    """

    learning_rate: ClassVar[float] = 1e-3
    weight_decay: ClassVar[float] = 1e-8

    def __init__(self, parameters: list[Tensor]) -> None:
        self.parameters = parameters
        self.steps = [torch.zeros((), device=p.device) for p in parameters]
        self.first = [torch.zeros_like(p) for p in parameters]
        self.second = [torch.zeros_like(p) for p in parameters]

    @torch.no_grad()
    def step(self, learning_rate: float) -> None:
        """See `Optimizer`."""
        rows = [
            (parameter, parameter.grad, *moments)
            for parameter, *moments in zip(
                self.parameters, self.first, self.second, self.steps, strict=True
            )
            if parameter.grad is not None
        ]
        parameters, gradients, first, second, steps = (list(of) for of in zip(*rows, strict=True))
        torch._foreach_add_(steps, 1)
        # The kernel that torch.optim calls.
        torch._fused_adamw_(
            parameters,
            gradients,
            first,
            second,
            [],
            steps,
            lr=learning_rate,
            beta1=0.9,
            beta2=0.999,
            weight_decay=self.weight_decay,
            eps=TINY,
            amsgrad=False,
            maximize=False,
        )
        for parameter in parameters:
            parameter.grad = None

    def state(self) -> dict[str, Tensor]:
        """See `Optimizer`."""
        moments = {"steps": self.steps, "first": self.first, "second": self.second}
        return {f"{name}.{i}": t for name, of in moments.items() for i, t in enumerate(of)}

    def restore(self, state: dict[str, Tensor]) -> None:
        """See `Optimizer`."""
        for name, tensor in self.state().items():
            tensor.copy_(state[name])


class SOAP:
    """Adam in the eigenbasis of Shampoo's statistics (Vyas et al. 2024, algorithm 3).

    Of the gradients G of a matrix, averages of G Gᵀ and Gᵀ G are kept; Adam's moments live in the
    bases of their eigenvectors. The first gradient sets the bases and moves nothing; from then on
    one step of the power method and a QR decomposition refresh them every `REFRESH` steps. There is
    no weight decay. A step whose gradients are not all finite is skipped.

    Args:
        parameters: tensors of any shape; each counts as a matrix of its first dimension by all
            others. Those of one shape go through each product together.
        widest: see `WIDEST`.
    """

    learning_rate: ClassVar[float] = 6e-3

    def __init__(self, parameters: list[Tensor], widest: int = WIDEST) -> None:
        self.parameters = parameters
        self.steps = torch.zeros((), dtype=torch.int64)
        shapes = dict.fromkeys(_matrix_shape(p) for p in parameters)
        self.groups = [
            _Group([p for p in parameters if _matrix_shape(p) == shape], widest) for shape in shapes
        ]

    @torch.no_grad()
    def step(self, learning_rate: float) -> None:
        """See `Optimizer`."""
        gradients = [p.grad for p in self.parameters if p.grad is not None]
        is_finite = bool(torch.stack([g.sum() for g in gradients]).isfinite().all())
        if is_finite:
            done = int(self.steps)
            for group in self.groups:
                group.step(done, learning_rate)
            self.steps += 1
        for parameter in self.parameters:
            parameter.grad = None

    def state(self) -> dict[str, Tensor]:
        """See `Optimizer`."""
        kept = {"steps": self.steps}
        for i, group in enumerate(self.groups):
            kept |= {f"{name}.{i}": tensor for name, tensor in group.state().items()}
        return kept

    def restore(self, state: dict[str, Tensor]) -> None:
        """See `Optimizer`."""
        for name, tensor in self.state().items():
            tensor.copy_(state[name])


def _matrix_shape(tensor: Tensor) -> tuple[int, int]:
    return len(tensor), tensor.numel() // len(tensor)


class _Side:
    """The rows of K matrices (K, m, n), or their columns: their statistics and their basis."""

    def __init__(self, like: Tensor, *, is_left: bool) -> None:
        count, size = len(like), like.shape[1 if is_left else 2]
        self.is_left = is_left
        self.statistics = like.new_zeros(count, size, size)
        self.basis = torch.eye(size, dtype=like.dtype, device=like.device).repeat(count, 1, 1)

    def observe(self, gradient: Tensor, keep: float) -> None:
        """Average in the products of the gradients with themselves."""
        g = gradient if self.is_left else gradient.mT
        self.statistics.baddbmm_(g, g.mT, beta=keep, alpha=1 - keep)

    def decompose(self) -> None:
        """Take the eigenvectors, largest eigenvalue first."""
        self.basis.copy_(torch.linalg.eigh(self.statistics)[1].flip(2))

    def refresh(self, first: Tensor, second: Tensor) -> tuple[Tensor, Tensor]:
        """Bring the basis nearer to the eigenvectors; both moments in the new one."""
        power = self.statistics @ self.basis
        order = (power * self.basis).sum(1).argsort(dim=1, descending=True, stable=True)
        ordered = power.gather(2, order[:, None].expand_as(power))
        basis = torch.linalg.qr(ordered)[0]
        turn = basis.mT @ self.basis
        self.basis.copy_(basis)
        if self.is_left:
            return turn @ first, second.gather(1, order[:, :, None].expand_as(second))
        return first @ turn.mT, second.gather(2, order[:, None].expand_as(second))

    def into(self, x: Tensor) -> Tensor:
        """Matrices in the basis."""
        return self.basis.mT @ x if self.is_left else x @ self.basis

    def out_of(self, x: Tensor) -> Tensor:
        """Matrices in the basis as they were."""
        return self.basis @ x if self.is_left else x @ self.basis.mT


class _Group:
    """K parameters of one shape, as matrices (K, m, n)."""

    def __init__(self, parameters: list[Tensor], widest: int) -> None:
        self.parameters = parameters
        self.first = torch.stack([p.detach().reshape(_matrix_shape(p)) for p in parameters]).zero_()
        self.second = torch.zeros_like(self.first)
        self.sides = [
            _Side(self.first, is_left=is_left)
            for is_left, size in zip((True, False), self.first.shape[1:], strict=True)
            if 1 < size <= widest
        ]

    def step(self, done: int, learning_rate: float) -> None:
        """One step, after `done` others."""
        gradient = torch.stack(
            [
                (torch.zeros_like(p) if p.grad is None else p.grad).reshape(_matrix_shape(p))
                for p in self.parameters
            ]
        )
        for side in self.sides:
            side.observe(gradient, DECAY)
        if not done:
            for side in self.sides:
                side.decompose()
            return
        turned = gradient
        for side in self.sides:
            turned = side.into(turned)
        self.first.lerp_(turned, 1 - DECAY)
        self.second.mul_(DECAY).addcmul_(turned, turned, value=1 - DECAY)
        # Both averages began at 0: what they lack of the past is 1 - DECAY**done of them.
        seen = 1 - DECAY**done
        move = self.first / (self.second / seen).sqrt_().add_(TINY)
        for side in self.sides:
            move = side.out_of(move)
        for parameter, of in zip(self.parameters, move, strict=True):
            parameter.add_(of.reshape(parameter.shape), alpha=-learning_rate / seen)
        if done % REFRESH == 0:
            for side in self.sides:
                first, second = side.refresh(self.first, self.second)
                self.first.copy_(first)
                self.second.copy_(second)

    def state(self) -> dict[str, Tensor]:
        """All that the next step depends on, by name, not copied."""
        kept = {"first": self.first, "second": self.second}
        for side in self.sides:
            name = "left" if side.is_left else "right"
            kept |= {f"{name}_statistics": side.statistics, f"{name}_basis": side.basis}
        return kept


OPTIMIZERS: dict[str, type[AdamW | SOAP]] = {"adamw": AdamW, "soap": SOAP}
"""What `Preset.optimizer` may name."""
