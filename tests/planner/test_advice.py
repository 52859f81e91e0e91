"""A seed that is advised is free, says Drake, as it is printed; it is in no region and within the limits."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from certifier.model import WORLD, Array, Scene
from certifier.pair.collisions import in_collision
from planner.advice import seed_near
from planner.cover.ground import sees
from planner.library import Library
from planner.membership import locate
from tests.certifier.scenes import box as body
from tests.certifier.scenes import planar_arm
from tests.oracles.clearance import DrakesClearance
from tests.planner.regions import box, library

FAR = library(box("far", (50.0, 50.0), (51.0, 51.0)))


@pytest.fixture(scope="module", params=[0.0, 0.02])
def scene(request: pytest.FixtureRequest) -> Scene:
    return planar_arm(padding=request.param)


def advised(scene: Scene, there: Library, q: Array) -> Array | None:
    return seed_near(scene, there, partial(in_collision, scene), scene.to_s(np.stack([q, q])))


def test_a_seed_is_free_as_it_is_printed_and_near_what_was_wanted(scene: Scene) -> None:
    drake, rng, moved = DrakesClearance(scene), np.random.default_rng(0), 0
    for q in rng.uniform(scene.q_lower, scene.q_upper, (200, scene.n)):
        found = advised(scene, FAR, q)
        assert found is not None
        assert drake.free(np.array([float(f"{x:g}") for x in found]))
        assert ((scene.q_lower <= found) & (found <= scene.q_upper)).all()
        if drake.free(q, 2e-3):
            np.testing.assert_allclose(found, q, atol=1e-12)
        else:
            moved += 1
            assert np.linalg.norm(found - q) < 1.0
    assert moved >= 10


def test_a_seed_that_was_moved_is_in_no_region(scene: Scene) -> None:
    """A region ends in front of the obstacle, with the wanted place behind its end."""
    rng = np.random.default_rng(1)
    colliding = [q for q in rng.uniform(scene.q_lower, scene.q_upper, (2000, scene.n)) if in_collision(scene, scene.to_s(q[None]))[0]]
    for q in colliding[:20]:
        nearest = advised(scene, FAR, q)
        assert nearest is not None
        s = scene.to_s(nearest)
        there = library(box("near", s - 0.1, s + 0.1))
        found = advised(scene, there, q)
        if found is not None:
            assert not len(locate(there, scene.to_s(found[None])).point)


def test_a_place_that_sees_both_ends_comes_first(scene: Scene) -> None:
    """The lines between the ends are blocked in the middle. More seeds see both ends than where only the middle is known."""
    collides, rng, seeing, nearest = partial(in_collision, scene), np.random.default_rng(2), [], []

    def sees_both(seed: Array | None, ends: Array) -> bool:
        assert seed is not None
        return bool(sees(collides, np.repeat(scene.to_s(seed)[None], 2, axis=0), ends).all())

    while len(seeing) < 20:
        ends = scene.to_s(rng.uniform(scene.q_lower, scene.q_upper, scene.n) + np.array([[0.0, -0.4], [0.0, 0.4]]))
        if collides(ends).any() or not collides(ends.mean(axis=0, keepdims=True))[0]:
            continue
        seeing.append(sees_both(seed_near(scene, FAR, collides, ends), ends))
        middle = np.repeat(ends.mean(axis=0, keepdims=True), 2, axis=0)
        nearest.append(sees_both(seed_near(scene, FAR, collides, middle), ends))
    assert np.mean(seeing) > np.mean(nearest)


def test_nothing_is_advised_where_nothing_is_free() -> None:
    scene = planar_arm(obstacle=body("world/obstacle", WORLD, (9.0, 9.0, 9.0)))
    assert advised(scene, FAR, np.zeros(2)) is None
