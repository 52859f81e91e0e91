"""Coarse volumes: those that hold their geometries at all angles are accepted at the least radius of the bound, and no others are."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from certifier.errors import ProofError
from certifier.kinematics import Kinematics
from certifier.model import WORLD, Geometry, Joint, JointKind, Scene, Volume
from certifier.partition.coarse import ball, capsule
from certifier.scene import load_scene
from certifier.verify.coarse import PARALLEL, check_coarse, foot
from certifier.verify.kinematics import ExactKinematics
from certifier.verify.volume import check_volume
from tests.certifier.scene.workshop import EXAMPLES
from tests.certifier.scenes import planar_arm, pose, random_tree

TOLERANCE = 1e-9
SAMPLES = 300


def holds(scene: Scene, volume: Volume) -> bool:
    try:
        check_coarse(scene, ExactKinematics.at(scene, []), volume)
    except ProofError:
        return False
    return True


def refused(scene: Scene, volume: Volume, message: str) -> None:
    with pytest.raises(ProofError, match=message):
        check_coarse(scene, ExactKinematics.at(scene, []), volume)


def excess(scene: Scene, volume: Volume, seed: int = 0) -> float:
    """How far the geometries leave the volume at random angles of all joints, in floating point; negative where they do not."""
    s = np.tan(np.random.default_rng(seed).uniform(-np.pi / 2, np.pi / 2, (SAMPLES, scene.n)))
    worst = -np.inf
    for name in volume.geometries:
        geometry = scene.geometry(name)
        points = Kinematics.of(scene).points(volume.body, geometry.body, geometry.vertices, s)
        start, end = volume.vertices[0], volume.vertices[-1]
        length = float((end - start) @ (end - start))
        t = np.clip((points - start) @ (end - start) / length, 0, 1) if length > 0 else np.zeros(points.shape[:2])
        distance = np.linalg.norm(points - start - t[..., None] * (end - start), axis=2)
        worst = max(worst, float(distance.max()) + geometry.radius - volume.radius)
    return worst


def tree(seed: int, kinds=(JointKind.REVOLUTE, JointKind.REVOLUTE, JointKind.WELD)) -> Scene:
    """A random tree with a geometry of one to five vertices on every body; some axes are parallel, some meet."""
    rng = np.random.default_rng(seed)
    scene = random_tree(seed, kinds, bodies=6)
    joints = []
    for joint in scene.joints:
        X_PF, X_BM = joint.X_PF.copy(), joint.X_BM.copy()
        if rng.random() < 0.3:
            X_PF[:3, 3] = X_BM[:3, 3] = 0.0
        if rng.random() < 0.4:
            X_PF[:3, :3] = X_BM[:3, :3] = np.eye(3)
        axis = np.array([0.0, 0.0, 1.0]) if joint.index is not None and rng.random() < 0.4 else joint.axis
        joints.append(replace(joint, X_PF=X_PF, X_BM=X_BM, axis=axis))
    geometries = tuple(
        Geometry(f"{body}/hull", body, rng.normal(size=(rng.integers(1, 6), 3)), float(rng.choice([0.0, 0.2])), {"kind": "hull"})
        for body in scene.bodies
    )
    return replace(scene, joints=tuple(joints), geometries=geometries)


def made(scene: Scene) -> list[Volume]:
    """All balls, about every body, and all capsules."""
    kinematics = Kinematics.of(scene)
    found = [ball(kinematics, (geometry.name,), body) for geometry in scene.geometries for body in scene.bodies]
    found += [capsule(kinematics, (geometry.name,)) for geometry in scene.geometries]
    return [volume for volume in found if volume is not None]


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000))
def test_what_is_made_holds_and_not_with_a_smaller_radius(seed):
    scene = tree(seed)
    for volume in made(scene):
        assert holds(scene, volume)
        assert excess(scene, volume) <= 0
        if volume.radius > 1e-3:  # a point on the only axis is a ball of the margin alone
            assert not holds(scene, replace(volume, radius=volume.radius * (1 - 1e-6)))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(0, 10_000))
def test_the_ball_of_one_or_two_joints_is_the_least_about_its_axis(seed, place):
    """The oracle turns both joints through a grid of angles, and tries other centres on the axis next to the ball's body."""
    scene = tree(seed)
    kinematics, rng = Kinematics.of(scene), np.random.default_rng(place)
    ways = [(g, body) for g in scene.geometries for body in kinematics.ancestors(g.body) if 1 <= len(kinematics.chain(body, g.body)) <= 2]
    ways = [(g, body) for g, body in ways if ball(kinematics, (g.name,), body) is not None]
    assume(ways)
    geometry, body = ways[rng.integers(len(ways))]
    found, chain = ball(kinematics, (geometry.name,), body), kinematics.chain(body, geometry.body)
    q = np.zeros((180 ** len(chain), scene.n))
    q[:, chain] = np.stack(np.meshgrid(*[np.linspace(-np.pi, np.pi, 180, endpoint=False) + 1e-3] * len(chain)), axis=-1).reshape(len(q), -1)
    points = kinematics.points(body, geometry.body, geometry.vertices, np.tan((q - scene.q_star) / 2)).reshape(-1, 3)
    reached = np.linalg.norm(points - found.vertices[0], axis=1).max() + geometry.radius
    assert found.radius == pytest.approx(reached, rel=2e-3)
    away = rng.normal(size=3) * 10.0 ** rng.uniform(-2, 0)
    assert np.linalg.norm(points - found.vertices[0] - away, axis=1).max() + geometry.radius > found.radius * (1 - 2e-3)


@pytest.mark.parametrize("name", sorted(path.parent.name for path in EXAMPLES.glob("*/scene.yaml")))
def test_what_is_made_of_the_examples_holds(name):
    scene = load_scene(EXAMPLES / name / "scene.yaml")
    roots = {Kinematics.of(scene).rigid_root(body) for body in scene.bodies}
    volumes = [volume for volume in made(scene) if volume.body in roots]
    assert {len(volume.vertices) for volume in volumes} == {1, 2}
    for volume in volumes:
        assert holds(scene, volume)
        assert excess(scene, volume) <= 0
        assert not holds(scene, replace(volume, radius=volume.radius * (1 - 1e-6)))


def changed(scene: Scene, volume: Volume, rng: np.random.Generator) -> Volume:
    """The volume with another radius, body or geometry, or with a vertex moved."""
    way = rng.integers(5)
    if way == 0:
        return replace(volume, radius=volume.radius * rng.uniform(0.3, 1.3))
    if way == 1:
        return replace(volume, body=str(rng.choice(scene.bodies)))
    if way == 2:
        return replace(volume, geometries=(str(rng.choice([g.name for g in scene.geometries])),))
    if way == 3:
        return replace(volume, vertices=volume.vertices + rng.normal(size=volume.vertices.shape) * 10.0 ** rng.uniform(-3, 0))
    return replace(volume, vertices=rng.permutation(volume.vertices)[:1], radius=volume.radius * rng.uniform(1, 2))


def test_changed_volumes_are_refused_or_true():
    rng, found = np.random.default_rng(1), Counter()
    for seed in range(25):
        scene = tree(seed)
        for volume in made(scene):
            other = changed(scene, volume, rng)
            accepted = holds(scene, other)
            found[accepted] += 1
            assert not accepted or excess(scene, other) <= TOLERANCE
    assert found[True] > 50
    assert found[False] > 200


@cache
def arm() -> Scene:
    return planar_arm(2)


def bar(vertices, body: str, radius: float) -> Volume:
    return Volume(("arm/link2/bar",), body, np.array(vertices), radius)


@pytest.mark.parametrize(
    ("vertices", "body", "radius"),
    [
        ([[1.0, 0.0, 0.0]], "arm/link1", np.sqrt(1.005)),
        ([[1.0, 0.0, 0.05]], "arm/link1", np.sqrt(1.0125)),
        ([[1.0, 0.3, 0.0]], "arm/link1", np.hypot(np.sqrt(1.0025) + 0.3, 0.05)),
        ([[0.0, 0.0, 0.0]], WORLD, np.hypot(np.sqrt(1.0025) + 1.0, 0.05)),
        ([[0.0, 0.0, 0.4]], WORLD, np.hypot(np.sqrt(1.0025) + 1.0, 0.45)),
        ([[1.0, 0.0, -0.05], [1.0, 0.0, 0.05]], "arm/link1", np.sqrt(1.0025)),
        ([[1.0, 0.0, 0.05], [1.0, 0.0, -0.05]], "arm/link1", np.sqrt(1.0025)),
        ([[1.0, 0.0, 0.0], [1.0, 0.0, 0.05]], "arm/link1", np.sqrt(1.005)),
        ([[1.1, 0.0, -0.05], [1.0, 0.05, 0.05]], "arm/link1", np.sqrt(1.0025) + 0.1),
    ],
)
def test_the_least_radius_is_the_one_by_hand(vertices, body, radius):
    """A bar of 1 x 0.1 x 0.1 m from the second joint on; both joints turn about z and are 1 m apart."""
    assert holds(arm(), bar(vertices, body, radius * (1 + 1e-12)))
    refused(arm(), bar(vertices, body, radius * (1 - 1e-12)), "may leave")


@pytest.mark.parametrize(("vertex", "least"), [((3, 4, 0), 5.0), ((1, 1, 0), float(np.sqrt(2))), ((1, 2**-45, 0), 1 + 2**-52)])
@pytest.mark.parametrize("ends", [[[0.0, 0.0, 0.0]], [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]]])
def test_the_check_is_exact_to_the_last_bit(vertex, least, ends):
    """5 is the root of 25, the double nearest to the root of 2 is larger than it, and the last vertex is 2^-91 m farther away than 1 m."""
    point = Geometry("arm/link1/point", "arm/link1", np.array([vertex], dtype=float), 0.0, {})
    scene = replace(planar_arm(1), geometries=(point,))
    assert holds(scene, Volume((point.name,), WORLD, np.array(ends), least))
    assert not holds(scene, Volume((point.name,), WORLD, np.array(ends), float(np.nextafter(least, 0.0))))


def wrist(kind: JointKind = JointKind.REVOLUTE) -> Scene:
    """Three joints whose axes z, y and z meet at a point, 0.5 m above the world; a hand on the last; a finger on a weld."""
    axes, kinds = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), (JointKind.REVOLUTE, kind, JointKind.REVOLUTE)
    names = (WORLD, "arm/a", "arm/b", "arm/hand")
    joints = [
        Joint(f"arm/j{i}", kinds[i], names[i], names[i + 1], np.array(axes[i]), pose((0, 0, 0 if i else 0.5)), np.eye(4), i, -1.0, 1.0)
        for i in range(3)
    ]
    joints.append(Joint("arm/weld", JointKind.WELD, "arm/hand", "arm/finger", np.zeros(3), pose((0.0, 0.0, 0.3)), np.eye(4)))
    hand = Geometry("arm/hand/ball", "arm/hand", np.array([[0.0, 0.4, 0.0]]), 0.1, {})
    finger = Geometry("arm/finger/tip", "arm/finger", np.array([[0.0, 0.0, 0.1]]), 0.05, {})
    return Scene("wrist", tuple(joints), (*names, "arm/finger"), (hand, finger), (), (), np.zeros(3))


@pytest.mark.parametrize("body", [WORLD, "arm/a", "arm/b"])
def test_axes_that_meet_cost_nothing(body):
    """However many joints: the hand reaches 0.4 m and 0.1 m from where the axes meet, and the finger 0.4 m and 0.05 m."""
    scene = wrist()
    names = tuple(geometry.name for geometry in scene.geometries)
    center = np.array([[0.0, 0.0, 0.5 if body == WORLD else 0.0]])
    assert holds(scene, Volume(names, body, center, 0.5 + 1e-12))
    refused(scene, Volume(names, body, center, 0.5 - 1e-9), "arm/hand/ball may leave")
    assert holds(scene, Volume(names[1:], body, center, 0.45 + 1e-12))
    found = ball(Kinematics.of(scene), tuple(geometry.name for geometry in scene.geometries), body)
    assert found is not None
    assert found.radius == pytest.approx(0.5, abs=1e-8)
    np.testing.assert_allclose(found.vertices, center, atol=1e-8)


def test_a_volume_below_its_geometry_holds_it_as_well():
    """A rotation is one from either side: the world's ball about the hand's place, seen from the hand."""
    scene = wrist()
    rock = Geometry("world/rock", WORLD, np.array([[0.0, 0.0, 0.0]]), 0.1, {})
    scene = replace(scene, geometries=(*scene.geometries, rock))
    assert holds(scene, Volume((rock.name,), "arm/finger", np.array([[0.0, 0.0, -0.3]]), 0.6 + 1e-12))
    assert not holds(scene, Volume((rock.name,), "arm/finger", np.array([[0.0, 0.0, -0.3]]), 0.6 - 1e-9))


def test_what_slides_or_is_fixed_or_is_on_another_branch_has_no_coarse_volume():
    scene = wrist(JointKind.PRISMATIC)
    hand = scene.geometry("arm/hand/ball")
    for body in (WORLD, "arm/a"):
        refused(scene, Volume((hand.name,), body, np.zeros((1, 3)), 100.0), "revolute")
        assert ball(Kinematics.of(scene), (hand.name,), body) is None
    for body in ("arm/hand", "arm/finger"):
        fixed = Volume((hand.name,), body, np.zeros((1, 3)), 100.0)
        check_volume(scene, ExactKinematics.at(scene, []), fixed)
        refused(scene, fixed, "revolute")
        assert ball(Kinematics.of(scene), (hand.name,), body) is None
    assert ball(Kinematics.of(scene), (hand.name,), "arm/b") is not None
    slides = planar_arm(1, kind=JointKind.PRISMATIC)
    assert capsule(Kinematics.of(slides), ("arm/link1/bar",)) is None
    assert capsule(Kinematics.of(arm()), ("world/obstacle",)) is None
    joints = [replace(joint, parent=WORLD) for joint in arm().joints]
    branches = replace(arm(), joints=tuple(joints))
    refused(branches, bar([[0.0, 0.0, 0.0]], "arm/link1", 100.0), "revolute")
    assert ball(Kinematics.of(branches), ("arm/link2/bar",), "arm/link1") is None


def test_a_coarse_volume_makes_sense():
    refused(arm(), bar([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0]], WORLD, 100.0), "2 joints")
    refused(arm(), bar([[1.0, 0.0, 0.0]] * 3, "arm/link1", 100.0), "neither a ball nor a capsule")
    refused(arm(), bar(np.zeros((0, 3)), "arm/link1", 100.0), "no vertices")
    for radius in (-1.0, np.inf, np.nan):
        refused(arm(), bar([[1.0, 0.0, 0.0]], "arm/link1", radius), "numbers that are no lengths")
    refused(arm(), bar([[1.0, np.nan, 0.0]], "arm/link1", 1.0), "numbers that are no lengths")
    refused(arm(), bar([[1.0, 0.0, 0.0]], "arm/link3", 100.0), "no body")
    refused(arm(), replace(bar([[1.0, 0.0, 0.0]], "arm/link1", 100.0), geometries=()), "stands for nothing")
    refused(arm(), replace(bar([[1.0, 0.0, 0.0]], "arm/link1", 100.0), geometries=("arm/link2/rod",)), "no geometry of the scene")


@given(st.integers(0, 10_000))
def test_the_foot_is_where_the_lines_are_nearest(seed):
    """The oracle is a least-squares problem in both lines' parameters."""
    rng = np.random.default_rng(seed)
    axis, direction = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
    point = rng.normal(size=3)
    t = foot(axis.tolist(), point.tolist(), direction.tolist())
    if np.linalg.norm(np.cross(axis, direction)) ** 2 < PARALLEL * (1 - 1e-6):
        assert t is None
    elif t is not None:
        expected = np.linalg.lstsq(np.column_stack([axis, -direction]), point, rcond=None)[0][0]
        assert t == pytest.approx(expected, rel=1e-7, abs=1e-7)
    assert foot(axis.tolist(), point.tolist(), (-axis).tolist()) is None
