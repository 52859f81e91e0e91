"""Configurations and lines that are called free, against Drake's distances at many places, and scenes with joints of every kind."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from certifier.collisions.free import CLOSE, free_along, free_at_all
from certifier.collisions.seen import seen_of
from certifier.motion.bodies import bodies_of
from certifier.pair.collisions import in_collision
from certifier.scene import load_scene
from tests.certifier.mixed import mixed_arm
from tests.oracles.clearance import DrakesClearance

EXAMPLES = Path(__file__).parents[3] / "examples"
ROUNDED = 1e-6
"""Drake's distances of convex bodies are this exact, in metres."""


def example(name):
    return load_scene(EXAMPLES / name / "scene.yaml")


def known(scene, padding=0.0):
    return bodies_of(scene), seen_of(scene, padding)


def order_of(scene):
    return np.arange(len(scene.pairs))


@pytest.mark.parametrize("name", ["planar_2dof", "arm_3dof", "ur3e_bin"])
def test_configurations_are_free_where_drake_says_so(name):
    scene = example(name)
    q = np.random.default_rng(3).uniform(scene.q_lower, scene.q_upper, (60, scene.n))
    free, clearance = free_at_all(*known(scene), q, order_of(scene)), DrakesClearance(scene)
    for i in range(len(q)):
        distance = clearance.least(q[i])[0]
        if abs(distance) > ROUNDED:
            assert free[i] == (distance > 0)
    assert 0 < free.sum() < len(q)


@pytest.mark.parametrize("seed", range(12))
def test_scenes_with_joints_of_every_kind_agree_with_the_other_check(seed):
    scene = mixed_arm(np.random.default_rng(seed), 2 + seed % 5, longest=2.0)
    q = np.random.default_rng(seed).uniform(scene.q_lower, scene.q_upper, (200, scene.n))
    assert (free_at_all(*known(scene), q, order_of(scene)) == ~in_collision(scene, scene.to_s(q))).all()


@pytest.mark.parametrize("name", ["planar_2dof", "arm_3dof", "ur3e_bin", "sphere_arm"])
def test_a_line_that_is_called_free_touches_nothing_and_others_touch_something(name):
    scene, rng = example(name), np.random.default_rng(5)
    bodies, order = known(scene), order_of(scene)
    answers = {True: 0, False: 0}
    for _ in range(20):
        a, b = rng.uniform(scene.q_lower, scene.q_upper, (2, scene.n))
        found = bool(free_along(*bodies, a, b, order, CLOSE))
        q = a + np.linspace(0, 1, 500)[:, None] * (b - a)
        touches = in_collision(scene, scene.to_s(q)).any()
        if found:
            assert not touches
        elif not touches:  # it touches between the samples, or comes as near as CLOSE
            assert not free_at_all(*known(scene, padding=2e-3), q, order).all()
        answers[found] += 1
    assert min(answers.values()) > 0


def test_padding_keeps_bodies_farther_apart():
    scene = example("planar_2dof")
    q = np.random.default_rng(1).uniform(scene.q_lower, scene.q_upper, (400, scene.n))
    free, padded = (free_at_all(*known(scene, padding), q, order_of(scene)) for padding in (0.0, 0.05))
    assert not (padded & ~free).any()
    assert (free & ~padded).any()
    clearance = DrakesClearance(scene)
    assert all(clearance.least(x)[0] > 0.1 - ROUNDED for x in q[padded][:30])


def test_a_pair_that_touches_comes_first_the_next_time():
    scene = example("iiwa_shelf")
    q = np.random.default_rng(0).uniform(scene.q_lower, scene.q_upper, (200, scene.n))
    order = order_of(scene)
    free = free_at_all(*known(scene), q, order)
    assert sorted(order.tolist()) == list(range(len(scene.pairs)))
    assert (free_at_all(*known(scene), q, order) == free).all()
