"""What growth parts by faces joins a scene for IRIS: balls that hold the hand, where they have room, and the geometries stay."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from benchmarks import catalogue
from certifier.model import Volume
from certifier.pair.collisions import in_collision
from certifier.partition import search
from certifier.partition.hulls import gaps
from certifier.partition.parted import parted
from certifier.polytopes.gibbs import uniform_in_q
from certifier.seeding import iris, trim
from certifier.seeding.coarse_pairs import Shape, coarse_pairs_of, with_coarse_pairs
from certifier.seeding.drake_iris import checker
from certifier.seeding.options import SeedOptions
from certifier.seeding.rating import rated


@pytest.fixture(scope="module")
def hand():
    """A scene in which balls stand for a hand, a cube in s about its seed, the seed, and samples of the cube."""
    scene = catalogue.scene("iiwa_shelf")
    seed = scene.to_s(catalogue.seed("iiwa_shelf"))[None]
    polytope = scene.polytope(*catalogue.cube(seed[0], 0.3))
    return scene, polytope, seed, uniform_in_q(polytope, scene, 40, 25, 1).reshape(-1, scene.n)


def test_drake_sees_the_volumes_that_faces_part(hand):
    """The gaps that growth goes by are the oracle. Every ball holds a hand, so what collides without the balls collides with them."""
    scene, polytope, seed, samples = hand
    found = coarse_pairs_of(scene, polytope, seed)
    wider = with_coarse_pairs(scene, found)
    assert len(found) == len(wider.pairs) - len(scene.pairs) > 0
    assert wider.pairs[: len(scene.pairs)] == scene.pairs
    assert wider.geometries[: len(scene.geometries)] == scene.geometries
    near = np.full(len(samples), np.inf)
    for bodies in parted(scene, polytope, samples, seed):
        near = np.minimum(near, bodies.extent * gaps(*bodies.hulls, samples))
    clear = np.abs(near) > 1e-6
    added = replace(wider, pairs=tuple(pair for pair in wider.pairs if pair not in scene.pairs))
    touching = ~np.array(checker(added).CheckConfigsCollisionFree(list(scene.to_q(samples))), dtype=bool)
    assert (touching == in_collision(added, samples))[clear].all()
    assert ((near <= 0) == touching)[clear & ~in_collision(scene, samples)].all()
    assert (touching & ~in_collision(scene, samples)).any()
    assert (in_collision(scene, samples) <= in_collision(wider, samples)).all()


def test_a_volume_without_room_at_a_point_that_stays_inside_is_left_out(hand, monkeypatch):
    scene, polytope, seed, samples = hand
    monkeypatch.setattr(search, "ROOM", -1e9)
    bodies = [one for one in parted(scene, polytope, samples, seed) if not all(v.is_geometry_of(scene) for v in one.volumes)]
    room = [one.extent * gaps(*one.hulls, seed)[0] / max(v.radius for v in one.volumes) for one in bodies]
    assert 0 < min(room) < max(room)
    ways = sorted(room)
    for limit in (0.0, *((a + b) / 2 for a, b in itertools.pairwise(ways) if b - a > 1e-3), 1 + ways[-1]):
        monkeypatch.setattr(search, "ROOM", limit)
        kept = {volumes[1].geometries for volumes in coarse_pairs_of(scene, polytope, seed).values()}
        assert kept == {one.volumes[1].geometries for one, has in zip(bodies, room, strict=True) if has > limit}


@pytest.mark.parametrize("name", ["planar_2dof", "arm_3dof", "ur3e_bin"])
def test_nothing_joins_where_growth_parts_the_geometries_themselves(name):
    scene = catalogue.scene(name)
    seed = scene.to_s(catalogue.seed(name))
    assert coarse_pairs_of(scene, scene.polytope(*catalogue.cube(seed, 0.2)), seed[None]) == {}


@pytest.mark.slow
def test_a_proposal_keeps_clear_of_what_growth_will_part(monkeypatch):
    """Where IRIS knows the balls, they touch in less of its polytope, and of what is likely to be kept there is no less."""
    scene, q = catalogue.scene("iiwa_shelf"), tuple(catalogue.seed("iiwa_shelf"))
    points, options = scene.to_s(q)[None], SeedOptions(q=q)

    def rating():
        C, d, _ = iris.iris(scene, points, options)
        assert (d[:, None] > C @ points.T).all()
        return rated(scene, scene.polytope(C, d), points)

    knowing = rating()
    for module in (iris, trim):
        monkeypatch.setattr(module, "coarse_pairs_of", lambda *_: {})
    unknowing = rating()
    assert knowing.touched < unknowing.touched
    assert knowing.kept > unknowing.kept


def test_a_capsule_without_length_is_a_ball_to_drake(hand):
    """The capsule about the axis of the joint before a single ball on this axis has two ends in one point."""
    scene, _, _, samples = hand
    point, other = np.array([[0.0, 0.0, 0.1]]), scene.geometry("shelf/boards/lower")
    ball = Volume(tuple(geometry.name for geometry in scene.geometries[:2]), scene.moving[-1].child, np.repeat(point, 2, axis=0), 0.2)
    wide = Volume((other.name,), other.body, other.vertices, other.radius)
    keys = tuple(Shape(volume.body, volume.vertices.tobytes(), volume.radius) for volume in (ball, wide))
    wider = with_coarse_pairs(scene, {keys: (ball, wide)})
    alone = replace(wider, pairs=wider.pairs[-1:])
    touching = ~np.array(checker(alone).CheckConfigsCollisionFree(list(scene.to_q(samples))), dtype=bool)
    assert (touching == in_collision(alone, samples)).all()
    assert 0 < touching.sum() < len(touching)
