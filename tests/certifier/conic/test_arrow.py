"""The barrier method for coupled programs, against Clarabel on dense forms of small ones."""

from __future__ import annotations

import tracemalloc
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.solvers import ClarabelSolver, MathematicalProgram

import certifier.conic.arrow
from certifier.conic.arrow import Arrow, Group
from certifier.conic.basis import basis
from certifier.conic.cone import Centre, Cone, conjugate
from certifier.step.face_terms import face_barrier, objective_term
from tests.certifier.conic.clarabel import add_rationals


def box_cone(k, n):
    """The cone over the box [-1, 1]^n with k chain joints, and its centre for 1."""
    space, axes = basis(k, tuple(range(k))), np.concatenate([np.eye(n), -np.eye(n)])
    cone = Cone.of_faces(space, np.ones(2 * n), axes[:, :k], axes[:, k:])
    one = np.zeros(cone.N)
    one[: len(space.points)] = 1.0
    u = np.random.default_rng(0).uniform(-1, 1, (200, n))
    first, grid = space.functional(u[:, :k])
    start = np.concatenate([first.mean(axis=0), *((u[:, [i]] * grid).mean(axis=0) for i in range(k, n))])
    return cone, one, Centre(cone, one, start)


@dataclass
class Made:
    """Rationals made from a seed whenever they are asked for: 1 + a little of z and y."""

    cone: Cone
    one: np.ndarray
    start: np.ndarray
    coupled: np.ndarray
    seed: int
    count: int = 2
    local: int = 3
    sign: float = 1.0

    def __len__(self):
        return self.count

    def columns(self):
        rng = np.random.default_rng(self.seed)
        shape = (self.count, self.cone.N)
        constant = np.tile(self.sign * self.one, (self.count, 1))
        return constant, rng.normal(size=(*shape, self.local)), rng.normal(size=(*shape, len(self.coupled)))


def quadratic(z):
    """A barrier of |z| < 1."""
    slack = 1 - z @ z
    if slack <= 0:
        return np.inf, z, np.eye(len(z))
    return -np.log(slack), 2 * z / slack, 2 * np.eye(len(z)) / slack + 4 * np.outer(z, z) / slack**2


def linear(weight, c):
    return lambda y: (weight * c @ y, weight * c, np.zeros((len(y), len(y))))


def made(groups, cone, one, centre, coupled, count=2, sign=1.0):
    return [Group([Made(cone, one, centre.x, coupled, seed, count, sign=sign)], np.zeros(3), quadratic) for seed in range(groups)]


def optimum(groups, k, c):
    """The least c'y by Clarabel, with every Gram matrix a variable of its own."""
    program = MathematicalProgram()
    y = program.NewContinuousVariables(k)
    for group in groups:
        z = program.NewContinuousVariables(len(group.start))
        program.AddLorentzConeConstraint(np.concatenate([[1.0], z]))
        add_rationals(program, group, z, y)
    program.AddLinearCost(c, y)
    result = ClarabelSolver().Solve(program)
    assert result.is_success()
    return result.get_optimal_cost()


@pytest.mark.parametrize(("k", "n"), [(1, 1), (1, 2), (2, 2)])
def test_the_minimum_is_clarabels(k, n):
    groups = made(3, *box_cone(k, n), np.array([0, 2]))
    groups[0].blocks[0].coupled = np.array([1, 2])
    c = np.array([1.0, -2.0, 0.5])
    weight = 1e4
    method = Arrow(groups, np.zeros(3), lambda _: None)
    assert method.minimise(linear(weight, c), 1e-4) < 0.02
    best = optimum(groups, 3, c)
    degree = sum(len(b) * b.cone.degree for g in groups for b in g.blocks) + 2 * len(groups)
    assert best < -1e-2
    assert best - 1e-6 * abs(best) <= c @ method.y <= best + 1.01 * degree / weight


def test_a_start_outside_a_cone_is_refused():
    with pytest.raises(np.linalg.LinAlgError):
        Arrow(made(1, *box_cone(1, 2), np.array([0]), sign=-1.0), np.zeros(1), lambda _: None)


def test_steps_up_to_the_reach_are_feasible():
    groups = made(2, *box_cone(2, 3), np.array([0, 1]))
    method = Arrow(groups, np.zeros(2), lambda _: None)
    direction = np.array([1.0, -0.3])
    reach = method.reach(direction)
    method.shift(0.99 * reach * direction)
    with pytest.raises(np.linalg.LinAlgError):
        method.shift(1e3 * reach * direction)


def test_an_exception_of_the_tick_ends_the_method():
    class Cancelled(Exception):
        pass

    def tick(iteration):
        if iteration == 2:
            raise Cancelled

    method = Arrow(made(2, *box_cone(1, 2), np.array([0])), np.zeros(1), tick)
    with pytest.raises(Cancelled):
        method.minimise(linear(1e6, np.ones(1)), 1e-9)
    assert method.iterations == 2


def test_factors_that_do_not_fit_are_formed_again(monkeypatch):
    found = []
    for kept in (0, certifier.conic.arrow.FACTOR_BYTES):
        monkeypatch.setattr(certifier.conic.arrow, "FACTOR_BYTES", kept)
        method = Arrow(made(2, *box_cone(2, 2), np.array([0])), np.zeros(1), lambda _: None)
        method.minimise(linear(1e3, np.ones(1)), 1e-6)
        found.append(method.y[0])
    assert found[0] < -0.1
    assert found[0] == pytest.approx(found[1], abs=1e-4)


def test_memory_does_not_grow_with_the_groups(monkeypatch):
    monkeypatch.setattr(certifier.conic.arrow, "FACTOR_BYTES", 0)
    cone, one, centre = box_cone(3, 6)
    peaks = []
    for groups in (2, 16):
        program = made(groups, cone, one, centre, np.array([0, 1]), count=1)
        tracemalloc.start()
        Arrow(program, np.zeros(2), lambda _: None).minimise(linear(10.0, np.ones(2)), 1.0)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[0] > 8 * cone.N**2
    assert peaks[1] < 1.2 * peaks[0]


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_the_conjugate_barrier_has_the_gradient_that_it_states(seed):
    cone, _, centre = box_cone(1, 2)
    rng = np.random.default_rng(seed)
    ((K, L, _),) = (part.shape for part in cone.parts)
    Q = rng.normal(size=(1, K, L, L))
    s = cone.values([Q @ np.swapaxes(Q, -1, -2) + 0.05 * np.eye(L)])
    ds = 1e-5 * rng.normal(size=s.shape) * np.abs(s).max()
    at = conjugate(cone, s, centre.x[None], 1e-8, 100)
    assert np.abs(cone.values(at.Q) - s).max() < 1e-6 * np.abs(s).max()
    change = conjugate(cone, s + ds, at.x, 1e-8, 100).value - conjugate(cone, s - ds, at.x, 1e-8, 100).value
    assert change == pytest.approx(-2 * np.einsum("rn,rn->r", at.x, ds), rel=1e-3, abs=1e-8)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), barrier=st.booleans())
def test_the_terms_of_the_faces_have_the_derivatives_that_they_state(seed, barrier):
    rng, n = np.random.default_rng(seed), 3
    v = np.concatenate([rng.uniform(-0.4, 0.4, (2, n)), rng.uniform(1.5, 2.0, (2, 1)), rng.uniform(0.1, 0.4, (2, 1))], axis=1)
    term = face_barrier(n, 3.0, rng.uniform(-0.5, 0.5, (2, n))) if barrier else objective_term(n)
    y, dy = v.ravel(), 1e-5 * rng.normal(size=v.size)
    _, gradient, hessian = term(y)
    assert term(y + dy)[0] - term(y - dy)[0] == pytest.approx(2 * gradient @ dy, rel=1e-5, abs=1e-12)
    assert term(y + dy)[1] - term(y - dy)[1] == pytest.approx(2 * hessian @ dy, rel=1e-4, abs=1e-8)


@pytest.mark.parametrize(
    "change",
    [{"d": 0.9}, {"d": 3.1}, {"delta": -0.1}, {"delta": 1.5}, {"c": [1.1, 0.0]}],
    ids=["cone", "cap", "negative margin", "margin", "normal"],
)
def test_outside_their_domain_the_faces_barrier_is_infinite(change):
    face = {"c": [0.5, 0.0], "d": 2.0, "delta": 0.5} | change
    y = np.array([*face["c"], face["d"], face["delta"]])
    assert np.isinf(face_barrier(2, 3.0, np.zeros((0, 2)))(y)[0])
    assert np.isfinite(face_barrier(2, 3.0, np.array([[3.0, 0.0]]))(np.array([0.5, 0.0, 2.0, 0.5]))[0])
    assert np.isinf(face_barrier(2, 3.0, np.array([[5.0, 0.0]]))(np.array([0.5, 0.0, 2.0, 0.5]))[0])
