"""Contacts in corners that no sample shows are found by descents and cut off, and next to nothing else is lost."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import catalogue
from certifier.kinematics import Kinematics
from certifier.partition.coarse import slim_volumes
from certifier.partition.together import gaps_between, volumes_of
from certifier.polytopes.cutting import samples_of
from certifier.seeding.contacts import Contacts
from certifier.seeding.corners import SLIM_DISTANCE, TOUCHING, _found, _to_keep_apart, without_contacts
from certifier.seeding.drake_iris import checker
from tests.certifier.scenes import box, cube, planar_arm

TIP = 4
"""The pair that all joints move."""


def beside(y):
    """An arm of five links of 1 m, along x at its seed, beside an obstacle that it reaches in one corner of a cube in s."""
    scene = planar_arm(5, box("world/obstacle", "world", (0.3, 0.3, 0.3), (1.0, y, 0.0)))
    return scene, cube(scene, 0.0, 0.25)


def looked_for(scene, polytope, seed):
    pieces = [[volumes_of(scene, [scene.pairs[TIP]])]]
    return np.array([s for _, _, contacts in _found(scene, polytope, pieces, seed) for s in contacts]).reshape(-1, scene.n)


@pytest.mark.parametrize("y", [3.4, 3.8, 4.4])
def test_contacts_in_a_corner_are_cut_off(y):
    scene, polytope = beside(y)
    samples = samples_of(scene, polytope)
    assert Contacts(scene).free(samples).all(), "no sample shows the contacts"
    contacts = looked_for(scene, polytope, 0)
    assert len(contacts) > 0
    assert polytope.contains(contacts, 1e-9).all()
    touching = ~np.array(checker(scene).CheckConfigsCollisionFree(list(scene.to_q(contacts))), dtype=bool)
    assert touching.all(), "Drake sees what descents have found"
    smaller = without_contacts(scene, polytope, np.zeros((1, scene.n)))
    assert not smaller.contains(contacts).any()
    assert all(not len(looked_for(scene, smaller, seed)) for seed in range(100, 104))
    assert smaller.contains(np.zeros((1, scene.n))).all()
    assert smaller.contains(samples).mean() > 0.99
    np.testing.assert_array_equal(smaller.C[-2 * scene.n :], polytope.C[-2 * scene.n :])


def test_a_polytope_without_contacts_stays_as_it_is():
    scene, polytope = beside(6.0)
    assert not len(looked_for(scene, polytope, 0))
    assert without_contacts(scene, polytope, np.zeros((1, scene.n))) is polytope


FINGER, CENTER = ("gripper/right/finger", "shelf/boards/upper"), (0.51, 0.77, 0.71, 1.01, 1.46, -1.19, 6.46)
"""Two geometries of iiwa_gripper, and a configuration in s, beside which the capsule about the finger reaches the board in one corner."""


def finger(half):
    """The finger and the board alone, a cube about the configuration, and the capsule about the finger with the board."""
    scene = catalogue.scene("iiwa_gripper")
    scene = replace(scene, pairs=tuple(pair for pair in scene.pairs if (pair.a, pair.b) == FINGER))
    own, board = volumes_of(scene, scene.pairs)
    return scene, cube(scene, CENTER, half), (slim_volumes(Kinematics.of(scene), own, board)[0], board)


def test_slim_volumes_keep_a_distance_where_they_touch_in_corners_alone():
    scene, polytope, (capsule, board) = finger(0.15)
    samples, looks = samples_of(scene, polytope), range(100, 104)
    larger = replace(capsule, radius=capsule.radius + SLIM_DISTANCE), board
    assert any(list(_found(scene, polytope, [[(capsule, board)]], look)) for look in looks)
    smaller = without_contacts(scene, polytope, np.array([CENTER]))
    assert not any(list(_found(scene, smaller, [[larger]], look)) for look in looks)
    assert smaller.contains(samples).mean() > 0.95


@pytest.mark.parametrize(("half", "number"), [(0.15, 2), (0.5, 1)])
def test_slim_volumes_that_touch_elsewhere_are_left_to_growth(half, number):
    scene, polytope, volumes = finger(half)
    samples = samples_of(scene, polytope)
    assert ((gaps_between(scene, *volumes, samples) <= 0).mean() > TOUCHING) == (number == 1)
    assert len(list(_to_keep_apart(scene, (0,), np.array([CENTER]), samples))) == number
