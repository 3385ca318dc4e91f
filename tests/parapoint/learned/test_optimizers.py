"""AdamW is that of torch; SOAP is its textbook form, made fast."""

import math

import pytest
import torch

from parapoint.learned import optimizers
from parapoint.learned.optimizers import DECAY, OPTIMIZERS, REFRESH, SOAP, TINY, AdamW


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def parameters(*shapes: tuple[int, ...]) -> list[torch.nn.Parameter]:
    drawn = generator(1)
    return [
        torch.nn.Parameter(torch.randn(shape, generator=drawn, dtype=torch.float64))
        for shape in shapes
    ]


def set_gradients(of: list[torch.nn.Parameter], drawn: torch.Generator) -> None:
    """A gradient that depends on the parameters, with noise."""
    for p in of:
        noise = torch.randn(p.shape, generator=drawn, dtype=p.dtype)
        p.grad = p.detach().sin() + 0.3 * noise


def test_adamw_is_that_of_torch(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(AdamW, "weight_decay", 0.1)
    ours, theirs = (parameters((4, 3), (4, 3), (4, 3)) for _ in range(2))
    own, other = AdamW(ours), torch.optim.AdamW(theirs, lr=1e-2, weight_decay=0.1)
    drawn, again = generator(), generator()
    for _ in range(20):
        set_gradients(ours[:2], drawn)
        own.step(1e-2)
        set_gradients(theirs[:2], again)
        other.step()
        other.zero_grad()
    for mine, its in zip(ours, theirs, strict=True):
        torch.testing.assert_close(mine, its)
    assert torch.equal(ours[2], parameters((4, 3), (4, 3), (4, 3))[2])  # without a gradient


class TextbookSOAP:
    """SOAP of one matrix (Vyas et al. 2024, algorithm 3): each step as it is written there.

    Dense, one matrix at a time, and momentum stays in the matrix's own space. The first bases are
    given: of a gradient of low rank there are many.
    """

    def __init__(self, w: torch.Tensor, G: torch.Tensor, bases: list[torch.Tensor | None]) -> None:
        self.w, self.t, self.bases = w, 1, bases
        self.Q = [
            torch.eye(n, dtype=w.dtype) if Q is None else Q
            for Q, n in zip(bases, w.shape, strict=True)
        ]
        self.S = [(1 - DECAY) * G @ G.T, (1 - DECAY) * G.T @ G]
        self.M, self.V = torch.zeros_like(w), torch.zeros_like(w)
        for Q, S, given in zip(self.Q, self.S, bases, strict=True):
            if given is not None:
                in_basis = Q.T @ S @ Q
                torch.testing.assert_close(in_basis, torch.diag(torch.diag(in_basis)))
                torch.testing.assert_close(Q.T @ Q, torch.eye(len(Q), dtype=w.dtype))

    def step(self, G: torch.Tensor, rate: float) -> None:
        left, right = self.Q
        self.S[0] = DECAY * self.S[0] + (1 - DECAY) * G @ G.T
        self.S[1] = DECAY * self.S[1] + (1 - DECAY) * G.T @ G
        self.M = DECAY * self.M + (1 - DECAY) * G
        self.V = DECAY * self.V + (1 - DECAY) * (left.T @ G @ right) ** 2
        M = left.T @ self.M @ right / (1 - DECAY**self.t)
        V = self.V / (1 - DECAY**self.t)
        self.w -= rate * left @ (M / (V.sqrt() + TINY)) @ right.T
        if self.t % REFRESH == 0:
            for side, given in enumerate(self.bases):
                if given is not None:
                    Q, S = self.Q[side], self.S[side]
                    order = torch.diag(Q.T @ S @ Q).argsort(descending=True)
                    self.V = self.V.index_select(side, order)
                    self.Q[side] = torch.linalg.qr(S @ Q[:, order])[0]
        self.t += 1


def test_soap_is_the_textbook_s() -> None:
    shapes = ((6, 4), (4, 6), (6, 4), (6, 9), (9, 6), (5,))
    ours = parameters(*shapes)
    matrices = [p.detach().clone().reshape(len(p), -1) for p in ours]
    own, drawn, textbook = SOAP(ours, widest=8), generator(), []
    for step in range(3 * REFRESH + 2):
        set_gradients(ours, drawn)
        gradients = [p.grad.reshape(w.shape).clone() for p, w in zip(ours, matrices, strict=True)]
        own.step(1e-2)
        if not step:
            assert all(
                torch.equal(p.detach().view_as(w), w) for p, w in zip(ours, matrices, strict=True)
            )
            bases = first_bases(own, ours)
            textbook = [TextbookSOAP(*of) for of in zip(matrices, gradients, bases, strict=True)]
            continue
        for of, gradient in zip(textbook, gradients, strict=True):
            of.step(gradient, 1e-2)
    for mine, its in zip(ours, matrices, strict=True):
        torch.testing.assert_close(mine.detach().view_as(its), its, rtol=1e-8, atol=1e-9)


def first_bases(of: SOAP, ours: list[torch.nn.Parameter]) -> list[list[torch.Tensor | None]]:
    """The left and the right basis of each parameter."""
    places = {id(p): (group, k) for group in of.groups for k, p in enumerate(group.parameters)}
    bases = []
    for p in ours:
        group, k = places[id(p)]
        found = {side.is_left: side.basis[k].clone() for side in group.sides}
        bases.append([found.get(True), found.get(False)])
    return bases


def test_soap_solves_a_badly_conditioned_quadratic_that_adamw_does_not() -> None:
    """Curvatures from 1 to 1e6, along no axis: Adam sees the worst of them everywhere."""
    turn = torch.linalg.qr(torch.randn(12, 12, generator=generator(), dtype=torch.float64))[0]
    curvature = turn * torch.logspace(0, 6, 12, dtype=torch.float64) @ turn.T

    def height(w: torch.Tensor) -> float:
        return float((w.detach().T @ curvature @ w.detach()).trace())

    left = {}
    for name, kind in OPTIMIZERS.items():
        (w,) = parameters((12, 8))
        optimizer, begin = kind([w]), height(w)
        for step in range(400):
            w.grad = 2 * curvature @ w.detach()
            optimizer.step(0.03 * 0.5 * (1 + math.cos(math.pi * step / 400)))
        left[name] = height(w) / begin
    assert left["soap"] < 1e-6
    assert left["adamw"] > 1e-3


@pytest.mark.parametrize("name", sorted(OPTIMIZERS))
def test_a_restored_optimizer_goes_on_bit_by_bit(name: str) -> None:
    kind = OPTIMIZERS[name]
    whole, stopped = (parameters((6, 4), (4, 3), (6, 4)) for _ in range(2))
    drawn, again = generator(), generator()
    first, second = kind(whole), kind(stopped)
    for _ in range(REFRESH + 3):
        set_gradients(whole, drawn)
        first.step(1e-2)
        set_gradients(stopped, again)
        second.step(1e-2)
    resumed = kind(stopped)
    resumed.restore({key: tensor.clone() for key, tensor in second.state().items()})
    for _ in range(REFRESH + 3):
        set_gradients(whole, drawn)
        first.step(1e-2)
        set_gradients(stopped, again)
        resumed.step(1e-2)
    assert all(torch.equal(a, b) for a, b in zip(whole, stopped, strict=True))
    for key, tensor in first.state().items():
        assert torch.equal(tensor, resumed.state()[key]), key


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("steps", [0, 1, REFRESH])
def test_soap_skips_a_gradient_that_is_not_finite(bad: float, steps: int) -> None:
    ours, theirs = parameters((6, 4), (4, 3)), parameters((6, 4), (4, 3))
    first, second = SOAP(ours), SOAP(theirs)
    drawn, again = generator(), generator()
    for step in range(2 * REFRESH):
        if step == steps:
            ours[0].grad, ours[1].grad = torch.ones_like(ours[0]), torch.ones_like(ours[1])
            ours[1].grad[2, 1] = bad
            first.step(1e-2)
            assert ours[0].grad is None
        set_gradients(ours, drawn)
        first.step(1e-2)
        set_gradients(theirs, again)
        second.step(1e-2)
    assert all(torch.equal(a, b) for a, b in zip(ours, theirs, strict=True))


@pytest.mark.parametrize("late", [False, True])
def test_a_zero_gradient_moves_nothing(late: bool) -> None:
    """Neither where it comes first, nor as no gradient at all, nor once it is zero for ever."""
    (w,) = parameters((6, 4))
    optimizer = SOAP([w])
    for step in range(1500 if late else 5):
        w.grad = torch.ones_like(w) if late and step < 5 else torch.zeros_like(w)
        before = w.detach().clone()
        optimizer.step(1e-2)
    torch.testing.assert_close(w.detach(), before, rtol=0, atol=1e-9)
    (idle, moved) = parameters((6, 4), (6, 4))
    optimizer, start = SOAP([idle, moved]), idle.detach().clone()
    for _ in range(2 * REFRESH):
        set_gradients([moved], generator())
        optimizer.step(1e-2)
    assert torch.equal(idle, start)
    for _ in range(2 * REFRESH):  # and its first gradient may come late
        set_gradients([idle], generator())
        optimizer.step(1e-2)
    assert idle.isfinite().all()
    assert not torch.equal(idle, start)


def test_wide_sides_are_not_turned() -> None:
    optimizer = SOAP(parameters((3, 5), (5, 7)), widest=5)
    assert {name: tuple(t.shape) for name, t in optimizer.state().items() if "basis" in name} == {
        "left_basis.0": (1, 3, 3),
        "right_basis.0": (1, 5, 5),
        "left_basis.1": (1, 5, 5),
    }
    assert optimizers.WIDEST >= 129  # the paper's layers but for those of 512
