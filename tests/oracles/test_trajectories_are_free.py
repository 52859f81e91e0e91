"""A trajectory through grown regions holds no configuration that Drake, reading the original files, finds in collision."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from certifier.growth.options import GrowthOptions
from certifier.jobs.local import grow
from certifier.model import StoredRegion
from certifier.scene import load_scene
from planner.trajectory.curve import optimised
from planner.trajectory.plan import Trajectory, plan
from tests.oracles.original import collision_at
from tests.planner.regions import library
from tests.planner.test_trajectory import assert_sound, limits, links_of

PLANAR = Path(__file__).parents[2] / "examples" / "planar_2dof" / "scene.yaml"
START, GOAL = np.array([0.0, 0.0]), np.array([1.72, -2.1])
"""Before the obstacles, and folded between them; the straight line between the two touches."""


def test_no_point_of_a_trajectory_collides() -> None:
    scene = load_scene(PLANAR)
    grown = [grow(scene, GrowthOptions(seed={"q": q.tolist()})).manifest for q in (START, GOAL)]
    stored = library(
        *(
            StoredRegion(
                str(i),
                manifest["guarantee"],
                np.array(manifest["halfspace_normals"]),
                np.array(manifest["halfspace_offsets"]),
                *(np.array(manifest["bounding_box"][side]) for side in ("lower", "upper")),
            )
            for i, manifest in enumerate(grown)
        )
    )
    found = plan(stored, scene, links_of(stored, scene), START, GOAL, limits(2), optimised)
    assert isinstance(found, Trajectory)
    assert_sound(stored, scene, found, limits(2))
    times = np.linspace(0, found.t[-1], 20_000)
    assert collision_at(PLANAR, scene, np.column_stack([np.interp(times, found.t, joint) for joint in found.q.T])) is None
    part = np.linspace(0, 1, 20_000)[:, None]
    assert collision_at(PLANAR, scene, START + part * (GOAL - START)) is not None
