"""Where pairs fail is said in documents, and put together from parts."""

from __future__ import annotations

import json

import numpy as np
import pytest

from certifier import stored
from certifier.pair.result import Weakness

HERE, THERE = np.array([[0.1, 0.2, 0.3]]), np.array([[0.4, 0.5, 0.6], [0.7, 0.8, 0.9]])


@pytest.mark.parametrize("joints", [(), (0, 2)])
def test_a_weakness_survives_its_document(joints):
    weakness = Weakness(THERE, np.array([1.0, 0.0, 2.0]), ranges_alone=True, contacts=1, joints=joints)
    read = stored.value(Weakness, json.loads(json.dumps(stored.document(weakness))))
    assert stored.document(read) == stored.document(weakness)
    assert (read.joints, read.contacts, read.ranges_alone) == (joints, 1, True)


@pytest.mark.parametrize(("first", "second", "together"), [((0,), (1,), (0, 1)), ((1, 2), (1,), (1, 2)), ((), (1,), ()), ((), (), ())])
def test_parts_come_to_the_contacts_of_all_then_other_points_in_all_joints_that_matter(first, second, together):
    parts = [Weakness(THERE, np.zeros(3), contacts=1, joints=first), Weakness(HERE, np.zeros(3), contacts=0, joints=second)]
    found = Weakness.of_parts(parts)
    assert found.points.tolist() == [THERE[0].tolist(), THERE[1].tolist(), HERE[0].tolist()]
    assert (found.contacts, found.joints) == (1, together)


def test_a_part_that_names_contacts_alone_says_nothing_about_joints():
    parts = [Weakness(HERE, np.zeros(3), contacts=1), Weakness(THERE, np.zeros(3), joints=(2,))]
    assert Weakness.of_parts(parts).joints == (2,)
