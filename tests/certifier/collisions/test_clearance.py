"""Distances and depths where they are known exactly, in scenes for which Drake's signed distances do not end or are too large.

A child with a time limit computes the former, so that a call that does not end fails the test. Random scenes are compared with exact
fractions and with another of Drake's queries.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from certifier.collisions.clearance import Clearance
from certifier.errors import RegionError
from certifier.growth.options import GrowthOptions
from certifier.isolation.child import run_in_child
from certifier.jobs.local import grow
from certifier.kinematics import rotation
from certifier.model import WORLD, Array, Geometry, Joint, JointKind, Pair, Scene
from certifier.pair.collisions import contacts
from certifier.polytopes.closest import closest
from certifier.scene.contacts import overlaps, touching
from certifier.seeding.free import check_free
from tests.certifier.scenes import ball, box

SECONDS = 20.0
PAIR = Pair("arm/b", "world/a")
CORNER, OUT = np.full(3, 0.5), np.ones(3) / np.sqrt(3)
"""A corner of the cube, and the direction out of the cube there."""


def cube(center: Any = (0.0, 0.0, 0.0)) -> Geometry:
    return box("", "", (1.0, 1.0, 1.0), center)


def sphere(radius: float, center: Any) -> Geometry:
    return ball("", "", radius, center)


def capsule(radius: float, *ends: Any) -> Geometry:
    return Geometry("", "", np.array(ends, dtype=float), radius, {"kind": "capsule"})


def hull(vertices: Any) -> Geometry:
    return Geometry("", "", np.array(vertices, dtype=float), 0.0, {"kind": "mesh"})


def tetrahedron(at: Any = (0.0, 0.0, 0.0), turned: float = 0.0, size: float = 1.0) -> Geometry:
    corners = size * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    return hull(corners @ rotation(np.array([0.0, 0.0, 1.0]), turned).T + np.array(at))


def two(a: Geometry, b: Geometry, padding: float = 0.0) -> Scene:
    """A body that slides along x, and one that stands."""
    slide = Joint("arm/slide", JointKind.PRISMATIC, WORLD, "arm", np.array([1.0, 0.0, 0.0]), np.eye(4), np.eye(4), 0, -2.0, 2.0)
    bodies = replace(b, name="arm/b", body="arm"), replace(a, name="world/a", body=WORLD)
    return Scene("two", (slide,), (WORLD, "arm"), bodies, (PAIR,), (), np.zeros(1), padding=padding)


ROUND = hull([[np.cos(t) * np.sin(p), np.sin(t) * np.sin(p), np.cos(p)] for p in (0.6, 1.3, 2.0) for t in np.arange(7) + p])
EXACTLY = {
    "a ball on a corner": (cube(), sphere(0.1, CORNER), -0.1),
    "a large ball on a corner": (cube(), sphere(0.5, CORNER), -0.5),
    **{
        f"a ball {hair:g} m out of a corner": (cube(), sphere(0.1, CORNER + hair * OUT), hair - 0.1)
        for hair in (1e-15, 1e-12, 1e-9, 1e-6, 1e-4)
    },
    **{f"a ball {hair:g} m within a corner": (cube(), sphere(0.1, CORNER - hair), -hair - 0.1) for hair in (1e-12, 1e-9, 1e-6)},
    "a ball on the sharp corner of a tetrahedron": (tetrahedron(), sphere(0.1, (0, 0, 1)), -0.1),
    "a ball on a vertex of a mesh": (ROUND, sphere(0.3, ROUND.vertices[9]), -0.3),
    "a ball on an edge": (cube(), sphere(0.1, (0.5, 0.5, 0.1)), -0.1),
    "a ball on a face": (cube(), sphere(0.1, (0.5, 0.1, 0.2)), -0.1),
    "a ball in the middle": (cube(), sphere(0.1, (0, 0, 0)), -0.6),
    "a ball in the middle of a ball": (sphere(0.2, (0, 0, 0)), sphere(0.1, (0, 0, 0)), -0.3),
    "the end of a capsule on a corner": (cube(), capsule(0.1, CORNER, (0.5, 0.5, 1.5)), -0.1),
    "a capsule along an edge": (cube(), capsule(0.1, CORNER, (0.5, 0.5, -0.5)), -0.1),
    "a capsule through the cube": (cube(), capsule(0.1, (0.25, 0, -1), (0.25, 0, 1)), -0.35),
    "two capsules, end on end": (capsule(0.1, (0, 0, 0), (0, 0, 1)), capsule(0.2, (0, 0, 1), (0, 1, 1)), -0.3),
    "a capsule with its end on another one": (capsule(0.1, (0, 0, 0), (0, 0, 1)), capsule(0.2, (0, 0, 0.5), (0, 1, 0.5)), -0.3),
    "a capsule in its place again": (capsule(0.1, (0, 0, 0), (0, 0, 1)), capsule(0.1, (0, 0, 0), (0, 0, 1)), -0.2),
    "a ball on the end of a capsule": (capsule(0.1, (0, 0, 0), (0, 0, 1)), sphere(0.2, (0, 0, 1)), -0.3),
    "a cube in its place again": (cube(), cube(), -1.0),
    "a cube that reaches into a cube": (cube(), cube((0.75, 0.1, 0.2)), -0.25),
    "cubes, face on face": (cube(), cube((1, 0, 0)), 0.0),
    "cubes, edge on edge": (cube(), cube((1, 1, 0)), 0.0),
    "cubes, corner on corner": (cube(), cube((1, 1, 1)), 0.0),
    "tetrahedra, corner on corner": (tetrahedron(), tetrahedron((1, 0, 0)), 0.0),
    "tetrahedra, edge on edge": (tetrahedron(), tetrahedron(turned=-np.pi / 2), 0.0),
    "a ball that touches a face": (cube(), sphere(0.5, (1, 0, 0)), 0.0),
    "a ball before a face": (cube(), sphere(0.25, (1, 0, 0)), 0.25),
    "a ball before a corner": (cube(), sphere(0.1, CORNER + 0.2 * OUT), 0.1),
}


def answered(payload: dict[str, Any]) -> dict[str, Any]:
    """What is said of the pair at q = 0; a child runs this."""
    scene, padded, q = Scene.from_document(payload["scene"]), Scene.from_document(payload["padded"]), np.zeros(1)
    return {
        "least": Clearance(scene).least(q)[0],
        "free": Clearance(scene).free(q),
        "padded": Clearance(padded).least(q)[0],
        "depths": list(next(overlaps(scene, [q])).values()),
        "touching": [len(next(touching(one, [q]))) for one in (scene, padded)],
        "contacts": [len(contacts(one, one.to_s(q)[None])[0]) for one in (scene, padded)],
    }


@pytest.mark.parametrize("name", EXACTLY)
def test_where_bodies_touch_in_a_point_each_answer_comes_and_is_right(name: str) -> None:
    a, b, exactly = EXACTLY[name]
    payload = {"scene": two(a, b).to_document(), "padded": two(a, b, 0.01).to_document()}
    said = run_in_child(f"{__name__}:answered", payload, timeout_s=SECONDS, memory_bytes=2**34)
    assert said["least"] == pytest.approx(exactly, abs=1e-9)
    assert said["padded"] == pytest.approx(exactly - 0.02, abs=1e-9)
    if exactly:
        assert said["free"] is (exactly > 0)
        assert said["touching"] == said["contacts"] == [exactly < 0, exactly < 0.02]
        assert all(depth >= -exactly - 1e-6 for depth in said["depths"])
    else:
        assert said["touching"][1] == said["contacts"][1] == 1


@pytest.mark.parametrize("name", [name for name in EXACTLY if EXACTLY[name][2] < 0])
def test_growing_from_where_bodies_overlap_ends_with_the_depth_and_a_free_configuration(name: str) -> None:
    a, b, exactly = EXACTLY[name]
    with pytest.raises(RegionError) as error:
        grow(two(a, b), GrowthOptions(seed={"q": [0.0]}), deadline_s=SECONDS)
    assert (error.value.code, error.value.field) == ("seed_in_collision", "seed.q")
    assert f"arm/b and world/a overlap by {-exactly:.3g} m" in error.value.message
    assert "the nearest free configuration found is q = " in error.value.hint


def test_bodies_that_overlap_by_a_rounding_error_are_said_to_touch() -> None:
    for depth, how in ((1e-12, "touch"), (1e-6, "overlap by 1e-06 m")):
        with pytest.raises(RegionError, match=f"arm/b and world/a {how}"):
            check_free(two(cube(), cube((1 - depth, 0, 0))), np.zeros(1), "seed.q")


def test_a_hair_decides_whether_bodies_are_free() -> None:
    """One cube slides up to another one; a hair before contact it is free, and with a hair of room it is not."""
    clearance = Clearance(two(cube(), cube((1.5, 0, 0))))
    assert clearance.free(np.array([-0.5 + 1e-9]))
    assert not clearance.free(np.array([-0.5 + 1e-9]), 2e-9)
    assert not clearance.free(np.array([-0.5]))
    assert not clearance.free(np.array([-0.5 - 1e-9]))


def test_bodies_nearer_than_their_padding_touch_where_drakes_distance_is_too_large() -> None:
    """The end of a bar, turned by 30 degrees, is 309 mm from an edge of a block; Drake says 368 mm."""
    bar = box("", "", (1.0, 0.1, 0.1), (0.5, 0, 0)).vertices @ rotation(np.array([0.0, 0.0, 1.0]), np.pi / 6).T
    block, q = box("", "", (0.4, 0.3, 0.3), (0.6, 1.0, 0)), np.zeros(1)
    apart = np.linalg.norm(bar[bar[:, 1].argmax(), :2] - [0.8, 0.85])
    assert Clearance(two(block, hull(bar))).least(q)[0] == pytest.approx(apart, abs=1e-9)
    for padding, touches in ((0.154, False), (0.155, True), (0.18, True)):
        scene = two(block, hull(bar), padding)
        assert Clearance(scene).free(q) is not touches
        assert next(touching(scene, [q])) == ({PAIR} if touches else set())
        assert len(contacts(scene, scene.to_s(q)[None])[0]) == touches


def body(rng: np.random.Generator) -> Geometry:
    """A ball, a capsule or a hull of random points."""
    count, center = int(rng.choice([1, 2, rng.integers(4, 13)])), rng.uniform(-0.6, 0.6, 3)
    points = center + rng.normal(size=(count, 3)) * rng.uniform(0.05, 0.5)
    return Geometry("", "", points, float(rng.uniform(0.01, 0.5)) if count < 3 else 0.0, {"kind": "mesh"})


def exact(rows: Array) -> list[list[Fraction]]:
    return [[Fraction(float(x)) for x in row] for row in rows]


def inner(u: Any, v: Any) -> Fraction:
    return sum((x * y for x, y in zip(u, v, strict=True)), Fraction(0))


def bracket(A: Array, B: Array) -> tuple[float, float]:
    """Bounds of the distance of two hulls in fractions, by a plane and by a point of each. They hold however these were found."""
    found = closest(A, B)
    (normal,), left, right = exact(found.normal[None]), exact(A), exact(B)
    gap = min(inner(normal, v) for v in left) - max(inner(normal, v) for v in right)
    (wa, wb) = ([Fraction(float(w)) for w in weights] for weights in found.weights)
    apart = [
        sum((w * v[i] for w, v in zip(wa, left, strict=True)), Fraction(0)) / sum(wa)
        - sum((w * v[i] for w, v in zip(wb, right, strict=True)), Fraction(0)) / sum(wb)
        for i in range(3)
    ]
    length = float(inner(normal, normal)) ** 0.5
    return (float(gap) / length if length else 0.0), float(inner(apart, apart)) ** 0.5


def least_move(A: Array, B: Array) -> float:
    """How far one of two hulls that overlap has to move at least: the best of all directions that a face of their difference can have."""
    first, second = (np.array([v - u for u, v in itertools.combinations(X, 2)]).reshape(-1, 3) for X in (A, B))
    edges = np.concatenate([first, second])
    normals = np.concatenate([np.cross(edges[i], edges[i + 1 :]) for i in range(len(edges) - 1)])
    normals = np.concatenate([normals, -normals])[np.tile(np.linalg.norm(normals, axis=1) > 1e-9, 2)]
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return float(((normals @ A.T).max(axis=1) - (normals @ B.T).min(axis=1)).min())


@settings(max_examples=200)
@given(st.integers(0, 2**32 - 1))
def test_random_bodies_are_as_far_apart_and_as_deep_as_other_ways_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = body(rng), body(rng)
    scene, q = two(a, b), rng.uniform(-0.5, 0.5, 1)
    found, _ = Clearance(scene).least(q)
    B, reach = b.vertices + np.array([q[0], 0.0, 0.0]), a.radius + b.radius
    lower, upper = bracket(a.vertices, B)
    if lower > 1e-6:
        assert upper - lower < 1e-6
        assert lower - 1e-9 <= found + reach <= upper + 1e-9
    else:
        assert found + reach == pytest.approx(-least_move(a.vertices, B), abs=1e-6)
    if abs(found) > 1e-6:
        depths = next(overlaps(scene, [q]))
        assert Clearance(scene).free(q) is (found > 0) is (not depths)
        assert all(depth > -found - 1e-5 for depth in depths.values())
