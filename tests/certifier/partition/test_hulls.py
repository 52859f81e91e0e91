"""Where bodies are, how far apart and where they are nearest, against the kinematics, least squares and dense samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from certifier.kinematics import Kinematics
from certifier.model import WORLD, Volume
from certifier.partition.hulls import approach, gap, gaps, hull, place
from certifier.polytopes.closest import closest
from tests.certifier.scenes import box, planar_arm, random_tree

SEEDS = st.integers(0, 2**32 - 1)


@settings(max_examples=60, deadline=None)
@given(SEEDS, st.integers(1, 8), st.integers(1, 8), st.floats(0.0, 3.0))
def test_the_gap_of_two_hulls_is_their_distance(seed, v, w, away):
    rng = np.random.default_rng(seed)
    A, B = rng.normal(size=(v, 3)), rng.normal(size=(w, 3)) + np.array([away, 0, 0])
    normal, wa, wb = np.empty(3), np.empty(v), np.empty(w)
    found, distance = gap(A, B, normal, wa, wb), closest(A, B).distance
    if distance < 1e-4:
        assert found <= 1e-3
    else:
        assert (1 - 1e-3) * distance - 1e-6 <= found <= distance + 1e-6
        assert np.linalg.norm(normal) == pytest.approx(1)
        assert (A @ normal).min() - (B @ normal).max() == pytest.approx(found, abs=1e-9)
        for weights in (wa, wb):
            assert (weights >= 0).all()
            assert weights.sum() == pytest.approx(1)


@pytest.mark.parametrize("seed", range(6))
def test_places_are_those_of_the_kinematics_in_the_space_of_the_search(seed):
    scene, rng = random_tree(seed), np.random.default_rng(seed)
    kinematics, middle, extent = Kinematics(scene), rng.normal(size=3), 1.7
    frame, body = rng.choice(scene.bodies, 2, replace=False)
    volume = Volume(("none",), str(body), rng.normal(size=(5, 3)), 0.2)
    made = hull(kinematics, str(frame), volume, 0.3, middle, extent)
    assert made.radius == pytest.approx(0.3 / extent)
    for s in rng.normal(size=(10, scene.n)):
        points = np.empty((5, 3))
        place(made, s, np.empty((4, 4)), np.empty((4, 4)), points)
        expected = kinematics.points(str(frame), str(body), volume.vertices, s[None])[0]
        assert points * extent + middle == pytest.approx(expected, rel=1e-9, abs=1e-9)


def reaching(half):
    """An arm of two links on a cube in s about 0, and a box that it cannot reach; both bodies, the faces, and samples of the cube."""
    scene = planar_arm(2, box("world/box", WORLD, (0.2, 0.2, 0.2), (1.2, 1.2, 0.0)))
    tip = Volume(("tip",), "arm/link2", np.array([[1.0, 0.0, 0.0]]), 0.05)
    kinematics, other = Kinematics(scene), Volume.of(scene.geometry("world/box"))
    bodies = [hull(kinematics, WORLD, volume, volume.radius, np.zeros(3), 1.0) for volume in (tip, other)]
    C, d = np.concatenate([np.eye(2), -np.eye(2)]), np.full(4, half)
    grid = np.linspace(-half, half, 201)
    return bodies, C, d, np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)


@pytest.mark.parametrize("half", [0.05, 0.1, 0.2, 0.3])
def test_an_approach_ends_where_bodies_are_nearest_and_does_not_leave_the_polytope(half):
    (a, b), C, d, grid = reaching(half)
    everywhere = gaps(a, b, grid)
    starts = 0.5 * half * np.eye(2)
    found = []
    for start in [np.zeros(2), *starts]:
        s = start.copy()
        found.append(approach(a, b, np.arange(2), np.full(2, half), C, d, s, 8, -1.0))
        assert (C @ s <= d + 1e-9).all()
        assert found[-1] == pytest.approx(gaps(a, b, s[None])[0], abs=1e-9)
        assert found[-1] <= gaps(a, b, start[None])[0]
    # Where the way bends the steps zigzag, so the last part of it is not gone.
    assert everywhere.min() - 2e-3 <= min(found) <= 0.9 * everywhere.min() + 0.1 * gaps(a, b, np.zeros((1, 2)))[0]


def test_an_approach_ends_as_near_as_it_has_to_be():
    (a, b), C, d, _ = reaching(0.3)
    s = np.zeros(2)
    before = gaps(a, b, s[None])[0]
    assert approach(a, b, np.arange(2), np.full(2, 0.3), C, d, s, 8, before) == pytest.approx(before)
    assert (s == 0).all()
