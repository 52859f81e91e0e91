"""Obstacles: what was cut off for a pair, together over the rounds of a stage, kept in the state and written to the manifest."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from certifier.growth.obstacles import Obstacle, in_manifest, joined
from certifier.growth.options import GrowthOptions
from certifier.growth.state import GrowthState
from tests.scenes import slider

OPTIONS = GrowthOptions.from_document({"kind": "grow", "seed": {"q": [0.0]}})


def test_what_rounds_of_one_stage_cut_off_is_known_together_and_the_one_that_lost_most_is_named():
    first = Obstacle.at(1, np.array([0.1]), contact=False, faces=2, lost=0.01)
    second = Obstacle.at(1, np.array([0.2]), contact=True, faces=1, lost=0.05)
    third = Obstacle.at(1, np.array([0.3]), contact=False, faces=1, lost=0.02)
    found = joined(joined(joined({}, {4: first}), {4: second, 5: first}), {4: third})
    assert found[4] == Obstacle(1, 3, 4, pytest.approx(1 - 0.99 * 0.95 * 0.98), (0.2,), contact=True)
    assert found[5] == first


def test_a_later_stage_begins_anew():
    first, second = (Obstacle.at(stage, np.array([0.1]), contact=True, faces=2, lost=0.3) for stage in (1, 2))
    assert joined({0: first}, {0: second}) == {0: second}


def test_times_are_known_where_faces_are_not():
    one = Obstacle.at(1, None, contact=False)
    assert one.further(Obstacle.at(1, np.array([0.5]), contact=True)) == Obstacle(1, 2, s=(0.5,), contact=True)


@given(st.lists(st.floats(0, 1), min_size=1), st.integers(0, 5), st.booleans())
def test_the_state_keeps_obstacles(s, faces, contact):
    kept = {3: Obstacle.at(2, np.array(s), contact=contact, faces=faces, lost=0.25), 0: Obstacle(1, 4)}
    document = json.loads(json.dumps(GrowthState(OPTIONS, obstacles=kept).to_document()))
    assert GrowthState.from_document(document, OPTIONS).obstacles == kept


def test_the_manifest_names_pairs_and_positions_and_begins_with_the_worst():
    scene = replace(slider(posts=3), q_star=np.array([0.5]))
    found = in_manifest(scene, {0: Obstacle(1, 9), 1: Obstacle(1, 1, 1, 0.1, (0.2,), contact=True), 2: Obstacle(1, 2, 3, 0.3, (0.1,))})
    assert [one["b"] for one in found] == ["world/post2", "world/post1", "world/post0"]
    assert found[1] == {
        "a": "model/cart/ball",
        "b": "world/post1",
        "times": 1,
        "faces": 1,
        "lost": 0.1,
        "q": [0.7],
        "contact": True,
    }
    assert (found[2]["q"], found[2]["faces"], found[2]["times"]) == (None, None, 9)
