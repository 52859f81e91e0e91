"""Boxes around polytopes are what multipliers prove, by the verifier's exact check, however ill the faces are scaled."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from certifier.model import Array, Box, JointKind, Polytope, Scene
from certifier.partition.area import Area
from certifier.polytopes.proved import CLEAN, ProvedBox, cleaned
from certifier.polytopes.pushed import pushed
from certifier.proof.ground import Ground
from certifier.verify.pair import check_ground
from tests.certifier.scenes import planar_arm

WINDOW = np.radians(170.0)
"""A joint that turns a whole turn has s from -11.43 to 11.43."""


def scene_of(n: int, slide: float) -> Scene:
    """A scene of n joints, every other one a slide to either side as far as ``slide``, whose others turn in a window."""
    scene = planar_arm(n, limit=WINDOW)
    joints = tuple(
        replace(joint, kind=JointKind.PRISMATIC, lower=-slide, upper=slide) if joint.index % 2 else joint for joint in scene.joints
    )
    return replace(scene, joints=joints)


def ill_scaled(rng: np.random.Generator, scene: Scene, size: float) -> Polytope:
    """Faces about a point, joint limits included, of which many have coefficients from 1e-17 to 1e-6."""
    n = scene.n
    C = rng.normal(size=(3 * n, n))
    C = np.where(rng.random(C.shape) < 0.4, C * 10.0 ** rng.uniform(-17, -6, C.shape), C)
    C /= np.linalg.norm(C, axis=1, keepdims=True)
    center = rng.uniform(0.5 * scene.s_lower, 0.5 * scene.s_upper)
    return scene.polytope(C, C @ center + size * rng.uniform(1, 2, 3 * n))


def holds(scene: Scene, polytope: Polytope, box: ProvedBox) -> None:
    """The verifier accepts the box."""
    check_ground(scene, Ground(polytope.C, polytope.d, box.mid, box.half, box.Y_lower, box.Y_upper))


def part(rng: np.random.Generator, scene: Scene, polytope: Polytope) -> Polytope:
    """The polytope with some faces moved in and new ones before the joint limits, as growth makes it."""
    limits = 2 * scene.n
    d = polytope.d.copy()
    d[:-limits] -= rng.uniform(0, 1e-3, len(d) - limits) * (rng.random(len(d) - limits) < 0.5)
    C = rng.normal(size=(3, scene.n))
    new = C @ ((scene.s_lower + scene.s_upper) / 2) + 1.0
    return Polytope(np.concatenate([polytope.C[:-limits], C, polytope.C[-limits:]]), np.concatenate([d[:-limits], new, d[-limits:]]))


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), st.integers(1, 5), st.sampled_from([1e-3, 0.5, 1e3, 1e6]), st.sampled_from([1e-6, 1e-3, 1.0, 30.0]))
def test_the_verifier_accepts_every_box_that_is_claimed(seed, n, slide, size):
    assume(size > 1e-11 * slide)  # a linear program sees no point in a smaller one
    rng, scene = np.random.default_rng(seed), scene_of(n, slide)
    polytope = ill_scaled(rng, scene, size)
    holds(scene, polytope, ProvedBox.of(scene, polytope))
    box = ProvedBox.of_program(scene, polytope)
    holds(scene, polytope, box)
    smaller = part(rng, scene, polytope)
    holds(scene, smaller, box.on(len(smaller.d)))


def test_a_coefficient_that_the_multipliers_leave_out_makes_the_box_larger():
    """The face (2.6e-12, 1) with s_0 up to 11.43 takes its multipliers 3e-11 away from the program's value."""
    scene = scene_of(2, 0.5)
    polytope = scene.polytope([[-2.6e-12, 1.0]], [0.3])
    box = ProvedBox.of_program(scene, polytope)
    holds(scene, polytope, box)
    assert 0.3 < box.upper[1] < 0.3 + 1e-9


def test_the_box_of_the_program_is_kept_where_multipliers_prove_it():
    scene = scene_of(2, 0.5)
    polytope = scene.polytope([[0.6, 0.8], [-1.0, 0.5]], [0.25, 0.5])
    box, smallest = ProvedBox.of_program(scene, polytope), ProvedBox.of(scene, polytope)
    assert np.abs(box.upper - smallest.upper).max() < 1e-11
    holds(scene, polytope, box)


@pytest.mark.parametrize("half", [1e-3, 1e-9, 1e-13])
@pytest.mark.parametrize("middle", [0.0, 1.0, 11.43, 1e6])
def test_a_box_contains_its_bounds_wherever_it_is(half, middle):
    lower, upper = np.array([middle - half]), np.array([middle + half])
    box = Box.around(lower, upper)
    assert box.lower < lower
    assert box.upper > upper
    assert Fraction(float(box.mid[0])) - Fraction(float(box.half[0])) <= Fraction(float(lower[0]))


def test_the_multipliers_of_an_area_are_those_of_the_stage(monkeypatch):
    """A part of the polytope has the stage's box, even where its own linear programs fall short of it."""
    rng, scene = np.random.default_rng(0), scene_of(3, 0.5)
    polytope = pushed(ill_scaled(rng, scene, 0.3), (scene.s_lower + scene.s_upper) / 4, 1.0, scene.polytope([], []))
    box = ProvedBox.of_program(scene, polytope)
    smaller = part(rng, scene, polytope)
    monkeypatch.setattr(ProvedBox, "of", lambda *_: pytest.fail("no other box is claimed"))
    ground = Area.of(scene, smaller, 0, box).ground
    check_ground(scene, ground)
    assert (ground.mid == box.mid).all()


def exactly_within(c: Array, d: float, s: Array) -> bool:
    return sum(Fraction(float(x)) * Fraction(float(y)) for x, y in zip(c, s, strict=True)) <= Fraction(float(d))


@settings(deadline=None, max_examples=100)
@given(st.integers(0, 10**6), st.integers(1, 5), st.sampled_from([1e-3, 0.5, 1e3, 1e6]))
def test_a_cleaned_face_contains_no_more_and_keeps_what_has_to_stay(seed, n, slide):
    """In exact arithmetic, at points of the new face, which are the first that would be too many."""
    rng, scene = np.random.default_rng(seed), scene_of(n, slide)
    polytope = ill_scaled(rng, scene, 0.3)
    C, d = polytope.C[: -2 * n], polytope.d[: -2 * n]
    keep = rng.uniform(scene.s_lower, scene.s_upper, (3, n))
    clean, offsets = cleaned(C, d, scene.s_lower, scene.s_upper, keep)
    room, left = (d[:, None] - C @ keep.T).min(axis=1), (offsets[:, None] - clean @ keep.T).min(axis=1)
    assert (left[room > 0] >= room[room > 0] * (1 - 2 * CLEAN)).all()
    changed = (clean != C).any(axis=1)
    assert (offsets[~changed] == d[~changed]).all()
    assert clean.any(axis=1).all()
    assert ((clean == C) | (clean == 0)).all()
    for before, offset, after, moved in zip(C[changed], d[changed], clean[changed], offsets[changed], strict=True):
        for s in rng.uniform(scene.s_lower, scene.s_upper, (5, n)):
            axis = int(np.abs(after).argmax())
            s[axis] += (moved - after @ s) / after[axis]
            s[axis] -= 4 * np.spacing(abs(s[axis]) + np.abs(after * s).sum() / abs(after[axis])) * np.sign(after[axis])
            inside = (scene.s_lower <= s).all() and (s <= scene.s_upper).all()
            if inside and exactly_within(after, moved, s):
                assert exactly_within(before, offset, s)


def test_a_tiny_coefficient_goes_and_others_stay():
    lower, upper = np.array([-11.43, -0.5]), np.array([11.43, 0.5])
    clean, d = cleaned(np.array([[2.6e-12, 1.0], [1e-3, 1.0]]), np.array([0.3, 0.3]), lower, upper, np.zeros((1, 2)))
    assert clean.tolist() == [[0.0, 1.0], [1e-3, 1.0]]
    assert 0.3 - 1e-9 < d[0] < 0.3 == d[1]


def test_a_face_that_lets_a_point_out_stays_as_it_is():
    lower, upper = np.array([-11.43, -0.5]), np.array([11.43, 0.5])
    clean, d = cleaned(np.array([[2.6e-12, 1.0]]), np.array([0.3]), lower, upper, np.array([[0.0, 0.4]]))
    assert (clean.tolist(), d.tolist()) == ([[2.6e-12, 1.0]], [0.3])
