"""Messages say by at least how much a hull reaches beyond its mesh, and where it is in the way."""

from __future__ import annotations

import itertools
import time
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from certifier.errors import RegionError
from certifier.scene import hollow
from certifier.scene.hollow import beyond, beyond_mesh
from certifier.seeding.free import check_free
from tests.certifier.scene.workshop import SCENE, parsed, write

CORNERS = np.array([*itertools.product((-0.5, 0.5), repeat=3)])
CUBE = ConvexHull(CORNERS).simplices
BIN = [((0, 0.9, 0), (2, 0.2, 1)), ((0, -0.9, 0), (2, 0.2, 1)), ((0.9, 0, 0), (0.2, 2, 1))]
"""The middles and the sizes of three plates that make a U, which is open on three sides."""


def plates(boxes) -> tuple[np.ndarray, np.ndarray]:
    points = np.concatenate([np.array(middle) + np.array(size) * CORNERS for middle, size in boxes])
    return points, np.concatenate([CUBE + 8 * k for k in range(len(boxes))])


def obj(points, triangles) -> str:
    return "".join(f"v {x} {y} {z}\n" for x, y, z in points.tolist()) + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in triangles)


@pytest.mark.parametrize("gap", [0.1, 1.0, 7.0])
def test_the_way_across_a_gap_is_half_of_it(gap):
    """Two cubes are ``gap`` apart, and the faces of their hull are at most half as far from the nearer cube."""
    points, triangles = plates([((0, 0, 0), (1, 1, 1)), ((1 + gap, 0, 0), (1, 1, 1))])
    rotation = Rotation.random(random_state=1).as_matrix()
    found = beyond_mesh(3 * points @ rotation.T + 5, triangles)
    assert 0.97 * 3 * gap / 2 <= found <= 3 * gap / 2 + 1e-9


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_a_convex_mesh_has_none(scale):
    directions = np.random.default_rng(0).normal(size=(500, 3))
    ball = scale * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    for points, triangles in ((ball, ConvexHull(ball).simplices), (scale * CORNERS, CUBE)):
        assert beyond_mesh(points, triangles) == 0


def test_a_flat_mesh_is_measured_without_the_thickness_that_its_hull_gets():
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    for turned in (square, square @ Rotation.random(random_state=1).as_matrix().T + 5):
        assert beyond_mesh(turned, np.array([[0, 1, 2], [0, 2, 3]])) == 0
        assert 0.65 < beyond_mesh(turned, np.array([[0, 1, 2]])) <= np.sqrt(0.5) + 1e-9


def test_a_mesh_on_a_line_is_measured_along_it():
    line = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 0, 0]])
    assert beyond_mesh(line, np.array([[0, 2, 1]])) == 0
    assert beyond_mesh(line, np.array([[0, 2, 2]])) > 0.1


@pytest.mark.parametrize("corners", [3, 4])
def test_a_flat_mesh_is_read(tmp_path, corners):
    square = np.array([[0.0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]])[:corners]
    text = obj(square, np.array([[0, k, k + 1] for k in range(1, corners - 1)]))
    scene = parsed(write(tmp_path, shape='<mesh filename="m.obj"/>', files={"m.obj": text}))
    assert len(scene.geometry("arm/hand/palm").vertices) == corners
    two = '<mesh filename="m.obj"/></geometry></collision><collision name="b"><geometry><mesh filename="m.obj"/>'
    hulls = parsed(write(tmp_path, shape=two, files={"m.obj": text}, extra="hulls: [arm/hand]\n"))
    assert hulls.geometry("arm/hand/hull").radius == 0


def test_a_mesh_without_faces_has_no_estimate():
    assert beyond_mesh(CORNERS, np.zeros((0, 3), dtype=np.int64)) == 0


def test_twenty_thousand_faces_take_a_moment():
    directions = np.random.default_rng(0).normal(size=(10_002, 3))
    bowl = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    triangles = ConvexHull(bowl).simplices
    bowl[:, 2] = np.where(bowl[:, 2] > 0, -0.6 * bowl[:, 2], bowl[:, 2])
    begun = time.process_time()
    assert 0.59 < beyond_mesh(bowl, triangles) < 0.6001
    assert time.process_time() - begun < 5


def in_a_bin(directory: Path, **change):
    """The arm's palm is in the middle of a bin at 0."""
    points, triangles = plates([(np.array(middle) * 0.2 + [0.3, 0, 0.3], np.array(size) * 0.2) for middle, size in BIN])
    room = """<sdf version="1.9"><model name="room"><link name="walls"><collision name="bin"><geometry><mesh><uri>bin.obj</uri>{}</mesh>
      </geometry></collision></link></model></sdf>"""
    files = {"bin.obj": obj(points, triangles), "room.sdf": room.format(change.pop("declared", ""))}
    return parsed(write(directory, **change, files=files))


def test_the_warning_says_how_far_and_what_helps(tmp_path):
    scene = in_a_bin(tmp_path)
    (said,) = [warning for warning in scene.warnings if "beyond" in warning]
    assert 0.155 < beyond(scene, "room/walls/bin") <= 0.16
    assert said.startswith("room/walls/bin: the hull reaches at least 1")
    assert "decompose in the scene file" in said


def test_an_overlap_with_the_hull_says_that_it_may_be_one_with_the_hull_only(tmp_path):
    scene = in_a_bin(tmp_path)
    with pytest.raises(RegionError, match=r"overlap by .*; the hull of room/walls/bin reaches at least 1.* may overlap in the hull only"):
        check_free(scene, np.array([0.0]), "seed")


def test_an_overlap_with_what_is_convex_says_nothing_of_hulls(tmp_path):
    scene = parsed(write(tmp_path, files={"room.sdf": (write(tmp_path).parent / "room.sdf").read_text().replace("0.6 0 0.3", "0.3 0 0.3")}))
    with pytest.raises(RegionError, match=r"overlap by [0-9.e-]+ m \(") as caught:
        check_free(scene, np.array([0.0]), "seed")
    assert "hull" not in caught.value.message


def test_what_is_declared_convex_is_taken_at_its_word(tmp_path):
    scene = in_a_bin(tmp_path, declared="<drake:declare_convex/>")
    assert not [warning for warning in scene.warnings if "beyond" in warning]


def test_the_hull_of_parts_is_measured_from_the_parts(tmp_path):
    claw = "".join(
        f'<collision name="{name}"><origin xyz="0 {y} 0"/><geometry><box size="0.02 0.02 0.1"/></geometry></collision>'
        for name, y in (("a", 0.1), ("b", -0.1))
    )
    more = f'<link name="claw">{claw}</link><joint name="on" type="fixed"><parent link="hand"/><child link="claw"/></joint>'
    scene = parsed(write(tmp_path, SCENE, more=more, extra="hulls: [arm/claw]\n"))
    assert 0.087 < beyond(scene, "arm/claw/hull") <= 0.09
    assert any("arm/claw/hull: the hull reaches at least" in warning and "beyond its parts" in warning for warning in scene.warnings)


@pytest.mark.parametrize("seed", range(5))
def test_no_point_that_is_spread_over_the_hull_is_farther(seed: int) -> None:
    """Points that cannot be the farthest are left out, by their distances from the middles of triangles."""
    random = np.random.default_rng(seed)
    points, triangles = random.normal(size=(40, 3)), random.integers(0, 40, (60, 3))
    corners = points[triangles]
    distances = hollow._Distances(corners)
    farthest = max(distances.of(weights @ triangle) for weights, triangle in hollow._spread(hollow._faces(points), hollow._POINTS))
    assert farthest > 0.1
    assert beyond_mesh(points, triangles) >= farthest
