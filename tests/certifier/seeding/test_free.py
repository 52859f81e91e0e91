"""The free configuration that is named near one in collision is the nearest one. Drake on dense grids says what is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from certifier.collisions.clearance import Clearance
from certifier.scene import load_scene
from certifier.seeding.free import nearest_free
from tests.oracles.clearance import DrakesClearance

EXAMPLES = Path(__file__).parents[3] / "examples"
ROOM = 1e-3


@pytest.mark.parametrize("q", [(-0.53, 0.0, 1.26, -1.83, -0.84, 1.85, -0.54), (-0.69, -1.97, 0.73, -1.54, -0.28, 1.90, 0.81)])
def test_only_joints_that_have_to_move_do(q: tuple[float, ...]) -> None:
    """Links 5 and 7 of the iiwa touch. Nothing but its last two joints can part them, so a grid of these says how far they have to turn."""
    scene = load_scene(EXAMPLES / "iiwa_shelf/scene.yaml")
    clearance, drake, start = Clearance(scene), DrakesClearance(scene), np.array(q)
    _, pair = drake.least(start)
    assert (pair.a, pair.b) == ("iiwa/link_5/box", "iiwa/link_7/box")
    found = nearest_free(scene, clearance, start, ROOM)
    assert found is not None
    assert drake.least(found)[0] > ROOM
    assert np.flatnonzero(found - start).tolist() in ([5], [6], [5, 6])
    half = (scene.q_upper - scene.q_lower) / 2
    steps = np.radians(np.arange(-30, 30.1, 0.5))
    turned = [start + np.array([0, 0, 0, 0, 0, sixth, seventh]) for sixth in steps for seventh in steps]
    nearest = min(np.linalg.norm((x - start) / half) for x in turned if (x <= scene.q_upper).all() and drake.free(x, ROOM))
    assert np.linalg.norm((found - start) / half) < 1.05 * nearest


def test_no_configuration_of_a_grid_is_much_nearer() -> None:
    scene = load_scene(EXAMPLES / "planar_2dof/scene.yaml")
    clearance, drake, half, rng = Clearance(scene), DrakesClearance(scene), (scene.q_upper - scene.q_lower) / 2, np.random.default_rng(1)
    grid = np.stack(np.meshgrid(*np.linspace(scene.q_lower, scene.q_upper, 300).T), axis=-1).reshape(-1, 2)
    free = np.array([x for x in grid if drake.free(x, ROOM)])
    cell = np.linalg.norm((grid[1] - grid[0]) / half)
    starts = [q for q in scene.q_lower + 2 * half * rng.random((200, 2)) if not drake.free(q, ROOM)]
    assert len(starts) > 20
    for start in starts:
        found = nearest_free(scene, clearance, start, ROOM)
        assert found is not None
        nearest = np.linalg.norm((free - start) / half, axis=1).min()
        assert np.linalg.norm((found - start) / half) < 1.05 * nearest + cell, start
