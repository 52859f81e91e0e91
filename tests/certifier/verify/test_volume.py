"""Volumes that contain their geometries are accepted, volumes that miss a corner of one by a hair are not."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from flint import Ordering, fmpq_mpoly_ctx
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from certifier.errors import ProofError
from certifier.model import WORLD, Joint, JointKind, Scene, Volume
from certifier.verify.kinematics import ExactKinematics
from certifier.verify.volume import check_volume
from tests.certifier.scenes import ball, box, pose

CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


def scene_of(*geometries) -> Scene:
    """A link on a joint, and a tool welded to the link half a metre along x, turned by a quarter."""
    turned = pose((0.5, 0.0, 0.0))
    turned[:2, :2] = [[0.0, -1.0], [1.0, 0.0]]
    joints = (
        Joint("arm/joint", JointKind.REVOLUTE, WORLD, "arm/link", np.array([0.0, 0.0, 1.0]), np.eye(4), np.eye(4), 0, -1.0, 1.0),
        Joint("arm/weld", JointKind.WELD, "arm/link", "arm/tool", np.zeros(3), turned, np.eye(4)),
    )
    return Scene("tool", joints, (WORLD, "arm/link", "arm/tool"), geometries, (), (), np.zeros(1))


def contains(volume: Volume, *geometries) -> bool:
    scene = scene_of(*geometries)
    kinematics = ExactKinematics.on_box(scene, fmpq_mpoly_ctx.get(["u0"], Ordering.lex), np.zeros(1), np.ones(1))
    try:
        check_volume(scene, kinematics, volume)
    except ProofError:
        return False
    return True


def test_a_geometry_contains_itself_and_nothing_else():
    link = box("arm/link/box", "arm/link", (0.2, 0.2, 0.2))
    itself = Volume.of(link)
    assert contains(itself, link)
    assert contains(replace(itself, vertices=link.vertices[::-1]), link)
    assert contains(replace(itself, radius=1e-9), link)
    assert not contains(replace(itself, vertices=link.vertices[:-1]), link)
    assert not contains(replace(itself, vertices=link.vertices * np.nextafter(1.0, 0.0)), link)


@pytest.mark.parametrize("body", ["arm/link", "arm/tool"])
def test_a_box_around_bodies_welded_together(body):
    """The tool's box reaches 0.45 to 0.55 along the link's x; in the tool's frame the link lies along -y."""
    link, tool = box("arm/link/box", "arm/link", (0.2, 0.2, 0.2)), box("arm/tool/box", "arm/tool", (0.3, 0.1, 0.1))
    lower, upper = ([-0.1, -0.15, -0.1], [0.55, 0.15, 0.1]) if body == "arm/link" else ([-0.15, -0.05, -0.1], [0.15, 0.6, 0.1])
    hull = np.array(list(itertools.product(*zip(lower, upper, strict=True)))) * (1 + 1e-12)
    around = Volume((link.name, tool.name), body, hull, 0.0)
    assert contains(around, link, tool)
    for axis, end in itertools.product(range(3), (min, max)):
        smaller = hull.copy()
        side = smaller[:, axis] == end(smaller[:, axis])
        smaller[side, axis] *= 0.99
        assert not contains(replace(around, vertices=smaller), link, tool)


def test_a_body_that_moves_against_the_volume_is_not_contained():
    block = box("world/block", WORLD, (0.1, 0.1, 0.1))
    assert not contains(Volume((block.name,), "arm/link", 10 * CORNERS, 0.0), block)


def test_a_volume_names_geometries_of_the_scene():
    block = box("world/block", WORLD, (0.1, 0.1, 0.1))
    for names in ((), ("world/other",), (block.name, "world/other")):
        assert not contains(Volume(names, WORLD, CORNERS, 0.0), block)
    assert not contains(Volume((block.name,), "arm/hand", CORNERS, 0.0), block)


@pytest.mark.parametrize("vertices", [np.zeros((0, 3)), np.zeros((2, 2)), np.zeros(3)])
def test_a_volume_without_vertices_is_malformed(vertices):
    block = box("world/block", WORLD, (0.1, 0.1, 0.1))
    scene = scene_of(block)
    with pytest.raises(ProofError) as refusal:
        check_volume(scene, None, Volume((block.name,), WORLD, vertices, 1.0))
    assert refusal.value.code == "proof_malformed"


numbers = st.floats(-2, 2).map(lambda x: float(np.float32(x)))
points = st.tuples(numbers, numbers, numbers).map(np.array)


@settings(max_examples=200)
@given(st.lists(points, min_size=1, max_size=4), st.floats(0, 2), points, st.floats(0, 1.5))
def test_what_is_accepted_is_contained(corners, radius, center, size):
    """A ball that is accepted reaches nowhere beyond the volume, by support functions; one that clearly fits round a corner is accepted."""
    geometry = ball("world/ball", WORLD, size, center)
    vertices = np.array(corners)
    accepted = contains(Volume((geometry.name,), WORLD, vertices, radius), geometry)
    directions = np.random.default_rng(0).normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    beyond = (directions @ center + size - (directions @ vertices.T).max(axis=1) - radius).max()
    if accepted:
        assert beyond < 1e-9
    nearest = min(np.linalg.norm(center - vertex) for vertex in corners)
    if nearest + size < radius * (1 - 1e-9):
        assert accepted


@given(points, points, st.floats(0.01, 0.99), st.floats(1e-5, 0.5))
def test_a_capsule_contains_the_balls_along_its_axis(start, end, where, size):
    assume(np.linalg.norm(end - start) > 1e-3)
    geometry = ball("world/ball", WORLD, size, start + where * (end - start))
    assert contains(Volume((geometry.name,), WORLD, np.array([start, end]), size + 1e-6), geometry)
    assert not contains(Volume((geometry.name,), WORLD, np.array([start, end]), size - 1e-6), geometry)


@given(points, st.floats(0, 1.5), st.floats(0, 0.5))
def test_a_box_contains_a_ball_that_fits_with_its_radius(center, size, rounding):
    geometry = ball("world/ball", WORLD, size, center)
    accepted = contains(Volume((geometry.name,), WORLD, CORNERS, rounding), geometry)
    if np.abs(center).max() + size < 1 + rounding - 1e-9 and np.abs(center).max() <= 1:
        assert accepted
    if accepted:
        assert np.abs(center).max() + size <= 1 + rounding + 1e-12
