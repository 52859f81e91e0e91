"""A plane that is found keeps both bodies on their sides all over the polytope; where bodies touch there is none."""

from __future__ import annotations

import numpy as np
import pytest

from certifier.kinematics import Kinematics
from certifier.model import WORLD, Volume
from certifier.partition.hulls import hull, place
from certifier.partition.planes import FOUND, LENGTHS, NO_PLANE, Chart, _slopes, _value, _values_on_the_way, length_bound, look
from tests.certifier.scenes import box, planar_arm

CALM = 0.3


def looked(half, radius):
    """What is found for the tip of an arm of two links and a box, on a cube in s about 0, from its middle alone."""
    scene = planar_arm(2, box("world/box", WORLD, (0.2, 0.2, 0.2), (1.2, 1.2, 0.0)))
    tip = Volume(("tip",), "arm/link2", np.array([[1.0, 0.0, 0.0]]), radius)
    kinematics, other = Kinematics(scene), Volume.of(scene.geometry("world/box"))
    a, b = (hull(kinematics, WORLD, volume, volume.radius, np.zeros(3), 1.0) for volume in (tip, other))
    X = np.zeros((200, 2))
    chart = Chart(np.arange(2), np.zeros(2), np.full(2, CALM / half), CALM)
    C, d = np.concatenate([np.eye(2), -np.eye(2)]), np.full(4, half)
    return a, b, X, look(a, b, chart, C, d, X, 1, 20, 4, 3e-4, 0.8)


@pytest.mark.parametrize("half", [0.05, 0.15, 0.25])
@pytest.mark.parametrize("radius", [0.02, 0.1])
def test_a_plane_that_is_found_holds_at_samples_of_all_of_the_polytope(half, radius):
    a, b, X, (kind, z, _, _, N) = looked(half, radius)
    assert kind == FOUND
    assert (np.abs(X[:N]) <= half + 1e-9).all()
    bound = np.empty(3)
    length_bound(z, 2, CALM, bound)
    for s in np.random.default_rng(0).uniform(-half, half, (500, 2)):
        plane, length = z.reshape(4, 3) @ np.append(1.0, CALM / half * s), bound @ np.append(1.0, CALM / half * s)
        assert np.linalg.norm(plane[:3]) <= length
        for body, sign in ((a, 1.0), (b, -1.0)):
            points = np.empty(body.vertices.shape)
            place(body, s, np.empty((4, 4)), np.empty((4, 4)), points)
            assert (sign * (points @ plane[:3] + plane[3]) >= body.radius * length - 1e-9).all()


def test_there_is_no_plane_where_the_bodies_touch_somewhere():
    """From the middle, where they are apart, the tip is moved to where planes fail, until the points that were found show it."""
    _, _, X, (kind, z, places, weights, N) = looked(0.9, 0.1)
    assert kind == NO_PLANE
    assert np.linalg.norm(z) < 3e-4
    assert weights.sum() == pytest.approx(1)
    assert set(places.tolist()) <= set(range(N))
    assert (np.abs(X[:N]) <= 0.9 + 1e-9).all()


@pytest.mark.parametrize("seed", range(8))
def test_the_slopes_of_a_vertex_and_its_values_on_a_way_are_those_of_its_value(seed):
    rng = np.random.default_rng(seed)
    scene = planar_arm(4, box("world/box", WORLD, (0.2, 0.2, 0.2), (1.2, 1.2, 0.0)))
    tip = Volume(("tip",), "arm/link4", np.array([[1.0, 0.3, 0.1]]), 0.05)
    # The joints are some of the arm's, with one that turns the plane and not the vertex.
    body = hull(Kinematics(scene), "arm/link1", tip, 0.05, rng.normal(size=3), 0.7)
    chart = Chart(np.array([0, 1, 3]), rng.normal(size=3), rng.uniform(0.5, 2, 3), CALM)
    z, bound, s = rng.normal(size=16), rng.normal(size=4), rng.normal(size=4)
    images, plane, slopes = np.ones((len(body.joints) + 1, 4)), np.empty(4), np.empty(4)
    images[-1, :3] = tip.vertices[0]

    def value(at):
        return _value(body, -1.0, z, bound, chart, at, images, np.empty(3), plane)

    differences = [(value(s + 1e-6 * e) - value(s - 1e-6 * e)) / 2e-6 for e in np.eye(4)]
    points = np.empty((1, 3))
    place(body, s, np.empty((4, 4)), np.empty((4, 4)), points)
    u = np.append(1.0, (s[[0, 1, 3]] - chart.shift) * chart.scale)
    at_s = z.reshape(4, 4) @ u
    assert value(s) == pytest.approx(-(points[0] @ at_s[:3] + at_s[3]) - body.radius * (bound @ u))
    _slopes(body, -1.0, z, bound, chart, s, images, plane, slopes)
    assert slopes == pytest.approx(differences, abs=1e-6)
    way, lanes, values = rng.normal(size=4), np.empty((12, len(LENGTHS))), np.empty(len(LENGTHS))
    _values_on_the_way(body, images[-1], -1.0, z, bound, chart, s, way, lanes, values)
    assert values == pytest.approx([value(s + length * way) for length in LENGTHS])
