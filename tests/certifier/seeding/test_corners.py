"""Contacts in corners that no sample shows are found by descents and cut off, and next to nothing else is lost."""

import numpy as np
import pytest

from certifier.polytopes.cutting import samples_of
from certifier.seeding.contacts import Contacts
from certifier.seeding.corners import _found, without_contacts
from certifier.seeding.drake_iris import checker
from tests.certifier.scenes import box, cube, planar_arm

TIP = 4
"""The pair that all joints move."""


def beside(y):
    """An arm of five links of 1 m, along x at its seed, beside an obstacle that it reaches in one corner of a cube in s."""
    scene = planar_arm(5, box("world/obstacle", "world", (0.3, 0.3, 0.3), (1.0, y, 0.0)))
    return scene, cube(scene, 0.0, 0.25)


def looked_for(scene, polytope, seed):
    return np.array([s for _, _, contacts in _found(scene, polytope, {TIP: (TIP,)}, seed) for s in contacts]).reshape(-1, scene.n)


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
