"""The picture of docs/introduction.md shows what it says: a certified region, and configurations that collide."""

from __future__ import annotations

import json

import numpy as np

from benchmarks import catalogue, pictures
from benchmarks.outline import outlines
from certifier.kinematics import Kinematics
from certifier.model import WORLD
from certifier.outcome import Outcome
from certifier.pair.certification import Certification
from certifier.pair.closest import closest

REGION = json.loads(pictures.REGION.read_text(encoding="utf-8"))


def test_the_picture_is_that_of_its_region() -> None:
    assert pictures.picture(REGION) == pictures.PICTURE.read_text(encoding="utf-8")


def test_the_region_is_certified() -> None:
    scene = catalogue.scene(pictures.EXAMPLE)
    certification = Certification(scene, pictures.polytope(REGION))
    assert {certification.certify(index).outcome for index in range(len(scene.pairs))} == {Outcome.CERTIFIED}


def test_what_is_drawn_as_colliding_collides() -> None:
    scene = catalogue.scene(pictures.EXAMPLE)
    kinematics = Kinematics.of(scene)
    s = np.random.default_rng(0).uniform(scene.s_lower, scene.s_upper, (300, scene.n))
    for name in pictures.OBSTACLES:
        obstacle = scene.geometry(f"obstacles/body/{name}")
        (fixed,) = kinematics.points(WORLD, obstacle.body, obstacle.vertices, s[:1])
        distances = [
            [closest(points, fixed).distance - obstacle.radius for points in kinematics.points(WORLD, link.body, link.vertices, s)]
            for link in scene.geometries
            if link.name.startswith("arm/")
        ]
        expected, found = np.min(distances, axis=0), pictures.clearance(kinematics, name, s)
        apart = expected > 1e-6
        np.testing.assert_allclose(found[apart], expected[apart], atol=1e-6)
        assert (found[~apart] < 1e-6).all()
        assert 0 < apart.sum() < len(s)


def test_outlines_go_around_a_ring_and_its_hole() -> None:
    x, y = np.meshgrid(np.arange(41), np.arange(31), indexing="ij")
    radius = np.hypot(x - 20, y - 15)
    inner, outer = sorted((np.hypot(*(loop - [20, 15]).T) for loop in outlines(np.maximum(5 - radius, radius - 12))), key=np.max)
    np.testing.assert_allclose(inner, 5, atol=0.1)
    np.testing.assert_allclose(outer, 12, atol=0.1)


def test_outlines_end_where_the_grid_does() -> None:
    (loop,) = outlines(np.full((4, 3), -1.0))
    assert loop.min() == 0
    assert (loop.max(axis=0) == [3, 2]).all()
