"""Control values stand for the polynomials that they are said to, to the bound of their rounding: against exact fractions."""

from __future__ import annotations

from fractions import Fraction
from math import comb

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given, settings
from hypothesis import strategies as st

from certifier.model import JointKind, Volume
from certifier.verify.control_points import Box, Side, rounding
from certifier.verify.kinematics import ExactKinematics
from certifier.verify.streams import Sums
from tests.certifier.scenes import random_tree

KINDS = (JointKind.REVOLUTE, JointKind.PRISMATIC, JointKind.WELD, JointKind.REVOLUTE)


def fraction(x) -> Fraction:
    return Fraction(int(x.p), int(x.q)) if isinstance(x, fmpq) else Fraction(float(x))


def exact_pose(scene, frame: str, body: str, s: list[Fraction]):
    """X_FB, (4, 4), in fractions."""
    X = ExactKinematics.at(scene, [fmpq(x.numerator, x.denominator) for x in s]).pose(frame, body)
    return [[fraction(x / X[3][3]) for x in row] for row in X]


def bernstein(values: np.ndarray, t: list[Fraction]) -> Fraction:
    """The polynomial of degree 3 in each t with these control values, (4^k,)."""
    weights = [Fraction(1)]
    for x in t:
        weights = [w * comb(3, i) * x**i * (1 - x) ** (3 - i) for w in weights for i in range(4)]
    return sum((w * Fraction(float(v)) for w, v in zip(weights, values, strict=True)), Fraction(0))


class Setting:
    """A random body of a random tree seen from a random frame, a cell, a plane, and a point of one of the pieces."""

    def __init__(self, seed: int, reach: float) -> None:
        self.rng = rng = np.random.default_rng(seed)
        self.scene = random_tree(seed, kinds=KINDS, bodies=5)
        self.frame, self.body, other = (str(x) for x in rng.choice(self.scene.bodies, 3))
        kinematics = ExactKinematics.by_joint(self.scene)
        chains = [[j.index for j, _ in kinematics.path(self.frame, b) if j.index is not None] for b in (self.body, other)]
        self.play = sorted({*chains[0], *chains[1]})
        n, k = self.scene.n, len(self.play)
        ends = np.sort(rng.uniform(-reach, reach, (2, n)), axis=0)
        self.lower, self.upper = ends[0] - 0.01, ends[1] + 0.01
        self.plane, self.sign = rng.normal(size=(5, 1 + k)), float(rng.choice([-1.0, 1.0]))
        self.volume = Volume((), self.body, rng.normal(size=(3, 3)), 0.0)
        self.radius = float(rng.choice([0.0, 0.2]))
        self.side = Side(kinematics, self.frame, self.volume, self.radius, self.sign, self.play)
        cell = self.lower[None, self.play], self.upper[None, self.play]
        self.cell = self.side.control(*cell, self.plane[None], slice(0, 3))

    def point(self, control, spans):
        """Random t of the own joints and tau of the others within a piece, and the s that they stand for; den's factor of the weights."""
        t, taus, s = [], [], [Fraction(float(x)) for x in self.rng.uniform(self.lower, self.upper)]
        weights = Fraction(1)
        for number, i in enumerate(self.side.own):
            joint = self.play[i]
            x = Fraction(int(self.rng.integers(0, 9)), 8)
            a, b = spans[number]
            whole = a + (b - a) * x
            l, u = (Fraction(float(end[joint])) for end in (self.lower, self.upper))
            w = [1 / np.sqrt(1 + end[joint] ** 2) if self.scene.revolute[joint] else 1.0 for end in (self.lower, self.upper)]
            w0, w1 = (Fraction(float(x)) for x in w)
            weight = (1 - whole) * w0 + whole * w1
            s[joint] = ((1 - whole) * w0 * l + whole * w1 * u) / weight
            t.append(x)
            weights *= weight**3 * (1 + s[joint] ** 2 if self.scene.revolute[joint] else 1)
        for number, o in enumerate(self.side.outside):
            tau = Fraction(int(self.rng.integers(-4, 5)), 4)
            s[self.play[o]] = Fraction(float(control.mid[0, number])) + Fraction(float(control.half[0, number])) * tau
            taus.append(tau)
        return t, taus, s, weights

    def distance(self, v: int, s: list[Fraction]) -> Fraction:
        """+-(a'p + b) - r kappa of a vertex."""
        X = exact_pose(self.scene, self.frame, self.body, s)
        p = [sum((x * Fraction(float(y)) for x, y in zip(row, [*self.volume.vertices[v], 1.0], strict=True)), Fraction(0)) for row in X]
        h = [Fraction(1), *(s[j] for j in self.play)]
        *plane, kappa = [sum((Fraction(float(z)) * x for z, x in zip(row, h, strict=True)), Fraction(0)) for row in self.plane]
        signed = sum((x * y for x, y in zip(plane, p, strict=True)), Fraction(0))
        return Fraction(self.sign) * signed - Fraction(self.radius) * kappa


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.3, 2.0, 11.0]), st.data())
def test_control_values_are_those_of_the_polynomials(seed, reach, data):
    here = Setting(seed, reach)
    control, spans = here.cell, [(Fraction(0), Fraction(1)) for _ in here.side.own]
    axes = len(here.play)
    for axis in data.draw(st.lists(st.integers(0, axes - 1), max_size=4)) if axes else []:
        upper = data.draw(st.booleans())
        control = control.halves(axis)[upper]
        if axis < len(spans):
            a, b = spans[axis]
            spans[axis] = ((a + b) / 2, b) if upper else (a, (a + b) / 2)
    bound = [[Fraction(float(x)) for x in row] for row in rounding(control.c_size[0], np.zeros(1))]
    dt_bound = [Fraction(float(x)) for x in rounding(control.dt_size[0], np.zeros(1))]
    for _ in range(3):
        t, taus, s, den = here.point(control, spans)
        assert abs(bernstein(control.dt[0, 0], t) - den) <= dt_bound[0]
        for number, i in enumerate(here.side.own):
            assert abs(bernstein(control.dt[0, 1 + number], t) - den * s[here.play[i]]) <= dt_bound[1 + number]
        for v in range(3):
            found = [bernstein(values, t) for values in control.c[0, v]]
            value = found[0] + sum((x * tau for x, tau in zip(found[1:], taus, strict=True)), Fraction(0))
            assert abs(value - den * here.distance(v, s)) <= sum(bound[v])
    assert max(map(max, bound)) < 1e-7 * max(1.0, reach) ** 6, "the bound is worth something"


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from([0.3, 2.0, 11.0]), st.booleans())
def test_no_point_of_a_piece_is_below_its_control_values(seed, reach, z0):
    """den (z0 f - lambda'g) at points of the cell, in fractions, is no less than the least control value less its bound."""
    here = Setting(seed, reach)
    n, m = here.scene.n, 4
    C, d, weights = here.rng.normal(size=(m, n)), here.rng.normal(size=m), here.rng.uniform(0, 2, m)
    sums = Sums(
        np.full((1, 3), weights @ d),
        np.tile(weights @ C, (1, 3, 1)),
        np.full((1, 3), weights @ np.abs(d)),
        np.tile(weights @ np.abs(C), (1, 3, 1)),
        np.full((1, 3), m),
    )
    F, error = here.side.values(here.cell, np.full((1, 3), float(z0)), sums, Box.of(here.lower, here.upper))
    spans = [(Fraction(0), Fraction(1)) for _ in here.side.own]
    for _ in range(3):
        _, _, s, den = here.point(here.cell, spans)
        faces = sum(
            (
                Fraction(float(y)) * (Fraction(float(b)) - sum((Fraction(float(x)) * z for x, z in zip(c, s, strict=True)), Fraction(0)))
                for y, c, b in zip(weights, C, d, strict=True)
            ),
            Fraction(0),
        )
        for v in range(3):
            value = den * (z0 * here.distance(v, s) - faces)
            assert value >= Fraction(float(F[0, v].min())) - Fraction(float(error[0, v]))


@pytest.mark.parametrize("reach", [1e3, 1e8, 1e15])
def test_denominators_of_wide_ranges_have_negative_control_values_and_are_positive(reach):
    here = next(h for h in (Setting(seed, 1.0) for seed in range(50)) if any(here_turns(h)))
    i = next(i for i, turns in enumerate(here_turns(here)) if turns)
    joint = here.play[here.side.own[i]]
    here.lower[joint], here.upper[joint] = -reach, reach
    here.cell = here.side.control(here.lower[None, here.play], here.upper[None, here.play], here.plane[None], slice(0, 3))
    assert here.cell.dt[0, 0].min() < 0
    assert np.isfinite(here.cell.c).all()
    spans = [(Fraction(0), Fraction(1)) for _ in here.side.own]
    bound = Fraction(float(rounding(here.cell.dt_size[:, 0], np.zeros(1))[0]))
    for _ in range(5):
        t, _, _, den = here.point(here.cell, spans)
        assert den > 0
        assert abs(bernstein(here.cell.dt[0, 0], t) - den) <= bound


def here_turns(here: Setting) -> list[bool]:
    return [bool(here.scene.revolute[here.play[i]]) for i in here.side.own]
