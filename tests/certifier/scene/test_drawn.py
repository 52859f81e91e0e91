"""Meshes are made ready to be drawn within limits, and say how far from their files they are drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from certifier.scene.drawn import MOST_DRAWN, MOST_MESHES, MOST_READ, Placed, document
from certifier.scene.meshes.mesh import Mesh


def ball(rings: int) -> Mesh:
    """A ball of the radius 0.3 m around (10, 0, 0), of about 4 rings² triangles."""
    round_, along = 2 * rings, np.arange(rings)
    polar, turn = np.meshgrid(np.pi * (along + 0.5) / rings, np.pi * np.arange(round_) / rings, indexing="ij")
    points = 0.3 * np.stack([np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)], axis=-1).reshape(-1, 3)
    a = (along[:-1, None] * round_ + np.arange(round_)).ravel()
    b = (along[:-1, None] * round_ + (np.arange(round_) + 1) % round_).ravel()
    triangles = np.concatenate([np.column_stack([a, a + round_, b]), np.column_stack([b, a + round_, b + round_])])
    return Mesh(points + np.array([10, 0, 0]), triangles)


def placed(mesh: Mesh) -> Placed:
    return Placed("arm/tip/mesh", "arm/tip", mesh, np.ones(3), np.eye(4))


def test_few_triangles_are_drawn_as_they_are() -> None:
    mesh = ball(20)
    found = document([placed(mesh)])
    assert found is not None
    assert (found["triangles"], found["moved"]) == (len(mesh.triangles), 0.0)
    (drawn,) = found["meshes"]
    assert np.array(drawn["vertices"])[drawn["triangles"]] == pytest.approx(mesh.points[mesh.triangles], abs=1e-6)


def test_many_triangles_become_few_whose_points_are_as_near_as_is_said() -> None:
    mesh = ball(250)
    found = document([placed(mesh), placed(mesh)])
    assert found is not None
    drawn = sum(len(one["triangles"]) for one in found["meshes"])
    assert found["triangles"] == 2 * len(mesh.triangles) > MOST_DRAWN
    assert MOST_DRAWN / 4 < drawn <= MOST_DRAWN
    assert 0 < found["moved"] < 0.02
    points = np.array(found["meshes"][0]["vertices"])
    assert cKDTree(mesh.points).query(points)[0].max() < 1e-6, "each is a point of the file"
    assert cKDTree(points).query(mesh.points)[0].max() <= found["moved"] + 1e-6


def test_points_that_no_triangle_has_are_left_out() -> None:
    found = document([placed(Mesh(np.array([[9.0, 9, 9], [0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[1, 2, 3]])))])
    assert found is not None
    assert found["meshes"][0]["vertices"] == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def test_more_than_can_be_looked_at_is_only_counted() -> None:
    one = Mesh(np.eye(3), np.tile([0, 1, 2], (MOST_READ + 1, 1)))
    assert document([placed(one)]) == {"meshes": [], "triangles": MOST_READ + 1, "moved": 0.0}
    several = [placed(replace(one, triangles=one.triangles[:1]))] * (MOST_MESHES + 1)
    assert document(several) == {"meshes": [], "triangles": MOST_MESHES + 1, "moved": 0.0}


def test_triangles_without_an_area_end() -> None:
    """No cell is large enough for them, and all of them go."""
    nowhere = Mesh(np.zeros((3, 3)), np.tile([0, 1, 2], (MOST_DRAWN + 1, 1)))
    found = document([placed(nowhere)])
    assert found is not None
    assert found["meshes"] == []


def test_without_meshes_there_is_nothing_to_keep() -> None:
    assert document([]) is None
