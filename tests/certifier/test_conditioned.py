"""Conditions hold where the pairs that stand for them are apart: by kinematics of our own, by Drake, and with forged scenes refused."""

from __future__ import annotations

import json
import math
import re
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.multibody.parsing import LoadModelDirectivesFromString, Parser, ProcessModelDirectives
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
from scipy.spatial import ConvexHull

from certifier.broken import trouble
from certifier.conditioned import AROUND, COVERED, condition_of, tightened, with_conditions, without_conditions
from certifier.conditions import Condition, Cone, Distance, InBall, Inside, Range, SlideRange, called, fails, of_condition
from certifier.errors import ProofError, RegionError, SceneError
from certifier.jobs import local
from certifier.jobs.clearance import clearance
from certifier.jobs.map import grow_map
from certifier.jobs.motion import certify as certify_motion
from certifier.model import WORLD, Array, JointKind, Pair, Scene
from certifier.outcome import Outcome
from certifier.pair.collisions import in_collision
from certifier.proof.motion import Motion, Space
from certifier.proof.negative import WitnessProof
from certifier.scene.file import read_scene_file
from certifier.scene.load import load_scene
from certifier.seeding.free import check_free
from certifier.verify.file import verify_file
from certifier.verify.scene import check_scene
from certifier.verify.witness import check_witness
from tests.certifier.scenes import ball, box, cube, planar_arm, random_tree

EXAMPLE = Path(__file__).parents[2] / "examples/ur3e_cup/scene.yaml"
HAIR = 1e-6
"""Nothing is asked of what is nearer to where a condition begins to fail."""
UP = (0.0, 0.0, 1.0)
POST = box("world/post", WORLD, (0.1, 0.1, 0.1), (0.0, 1.9, 0.0))


def poses(scene: Scene, q: Array) -> dict[str, Array]:
    """The pose of every body in the world, (4, 4): a product of matrices along the tree, with Rodrigues' formula."""
    found = {WORLD: np.eye(4)}
    left = list(scene.joints)
    while left:
        joint = left.pop(0)
        if joint.parent not in found:
            left.append(joint)
            continue
        motion = np.eye(4)
        if joint.kind is JointKind.REVOLUTE:
            x, y, z = joint.axis
            K, angle = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), q[joint.index]
            motion[:3, :3] += math.sin(angle) * K + (1 - math.cos(angle)) * K @ K
        elif joint.kind is JointKind.PRISMATIC:
            motion[:3, 3] = joint.axis * q[joint.index]
        found[joint.child] = found[joint.parent] @ joint.X_PF @ motion @ np.linalg.inv(joint.X_BM)
    return found


def room(scene: Scene, condition: Condition, q: Array) -> float:
    """How far a configuration is from failing a condition, in radians or metres; negative where it fails."""
    X = poses(scene, q)
    match condition:
        case Cone():
            a, b = X[condition.body][:3, :3] @ condition.axis, X[condition.of][:3, :3] @ condition.along
            return condition.angle - math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))
        case Inside() | InBall():
            inverse, least = np.linalg.inv(X[condition.of]), np.inf
            kept = [(geometry.body, geometry.vertices, geometry.radius) for geometry in map(scene.geometry, condition.geometries)]
            for body, vertices, radius in [*kept, *((body, np.array([point]), 0.0) for body, point in condition.points)]:
                pose = inverse @ X[body]
                points = vertices @ pose[:3, :3].T + pose[:3, 3]
                if isinstance(condition, InBall):
                    least = min(least, condition.radius - float(np.linalg.norm(points - condition.center, axis=1).max()) - radius)
                else:
                    least = min([least, *(d - float((points @ (a, b, c)).max()) - radius for a, b, c, d in condition.faces)])
            return least
        case SlideRange():
            index = {joint.name: joint.index for joint in scene.moving}
            total = float(sum(sign * q[index[joint]] for joint, sign in condition.joints))
            return min(condition.upper - total, total - condition.lower)
        case Range():
            index = {joint.name: joint.index for joint in scene.moving}
            total = sum(sign * q[index[joint]] for joint, sign in condition.joints)
            middle, half = (condition.lower + condition.upper) / 2, (condition.upper - condition.lower) / 2
            return half - abs(math.remainder(total - middle, 2 * math.pi))
    raise AssertionError(condition)


def kept(scene: Scene, condition: Condition, q: Array) -> np.ndarray:
    """Whether the pairs that stand for a condition are apart at joint positions (k, n)."""
    conditioned = with_conditions(scene, [condition])
    pairs = tuple(pair for pair in conditioned.pairs if condition_of(conditioned, pair) == condition)
    assert pairs
    return ~in_collision(replace(conditioned, pairs=pairs), scene.to_s(q))


def agree(scene: Scene, condition: Condition, q: Array) -> int:
    """How many configurations are far enough from failing or keeping a condition to compare; all of these have to be alike."""
    compared = 0
    for at, held in zip(q, kept(scene, condition, q), strict=True):
        left = room(scene, condition, at)
        if abs(left) > HAIR:
            assert held == (left > 0), (condition, at, left)
            compared += 1
        assert not held or left > 0, "a condition that fails is never proved"
    return compared


def direction(rng: np.random.Generator) -> tuple[float, float, float]:
    x, y, z = rng.normal(size=3)
    length = math.hypot(x, y, z)
    return x / length, y / length, z / length


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 10**6), st.sampled_from(["cone", "inside", "points", "range", "slides"]))
def test_pairs_are_apart_where_the_condition_holds(seed: int, kind: str) -> None:
    rng, tree = np.random.default_rng(seed), random_tree(seed)
    held = [body for body in tree.bodies if body != WORLD]
    balls = [ball(f"{body}/ball", body, 0.3, rng.normal(size=3)) for body in held[::2]]
    geometries = balls + [box(f"{body}/box", body, rng.uniform(0.1, 1.0, 3)) for body in held[1::2]]
    scene = replace(tree, geometries=tuple(geometries))
    bodies = [body for body in scene.bodies if body != WORLD]
    one, other = str(rng.choice(bodies)), str(rng.choice(scene.bodies))
    turning = [joint.name for joint in scene.moving if (joint.kind is JointKind.REVOLUTE) == (kind == "range")]
    condition: Condition
    if kind == "cone":
        condition = Cone("c", one, direction(rng), other, direction(rng), rng.uniform(0.01, 3.1))
    elif kind in ("inside", "points"):
        names = [geometry.name for geometry in scene.geometries if geometry.body == one] if kind == "inside" else []
        points = [(one, direction(rng)) for _ in range(rng.integers(1, 3))] if kind == "points" else []
        faces = tuple((*direction(rng), rng.uniform(-1.0, 3.0)) for _ in range(rng.integers(1, 5)))
        condition = Inside("c", tuple(names), other, faces, points=tuple(points))
    elif kind == "slides":
        signs = tuple((name, int(rng.choice([-1, 1]))) for name in turning if rng.random() < 0.7)
        lower = rng.uniform(-1, 0.5)
        condition = SlideRange("c", signs, lower, lower + rng.uniform(0.01, 1.0))
    else:
        signs = tuple((name, int(rng.choice([-1, 1]))) for name in turning if rng.random() < 0.7)
        lower = rng.uniform(-3, 3)
        condition = Range("c", signs, lower, lower + rng.uniform(0.01, 6.2))
    pairs: tuple[Pair, ...] | None = None
    with suppress(SceneError):  # Nothing moves, or a range names no joint.
        pairs = with_conditions(scene, [condition]).pairs
    if pairs is None:
        return
    q = rng.uniform(scene.q_lower, scene.q_upper, (100, scene.n))
    if len(pairs) == len(scene.pairs):
        assert all(room(scene, condition, at) > 0 for at in q), "no geometry reaches a face"
        return
    agree(scene, condition, q)


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 10**6), st.booleans())
def test_the_pairs_of_a_ball_are_apart_inside_of_it_alone(seed: int, of_a_point: bool) -> None:
    """Where all of a body is within COVERED of the radius, they are apart."""
    rng, tree = np.random.default_rng(seed), random_tree(seed)
    moving = [joint.child for joint in tree.moving]
    geometry = ball("c/ball", moving[-1], 0.2, rng.normal(size=3))
    scene = replace(tree, geometries=(geometry,), pairs=())
    names, points = ((), ((moving[-1], direction(rng)),)) if of_a_point else ((geometry.name,), ())
    condition = InBall("c", names, WORLD, tuple(rng.normal(size=3).tolist()), rng.uniform(0.3, 4.0), points=points)
    smaller = replace(condition, radius=COVERED * condition.radius)
    q = rng.uniform(scene.q_lower, scene.q_upper, (200, scene.n))
    conditioned: Scene | None = None
    with suppress(SceneError):  # Nothing moves.
        conditioned = with_conditions(scene, [condition])
    if conditioned is None:
        return
    held = kept(scene, condition, q) if conditioned.pairs else np.ones(len(q), dtype=bool)
    for at, apart in zip(q, held, strict=True):
        assert not apart or room(scene, condition, at) > 0
        assert apart or room(scene, smaller, at) < HAIR


def test_the_directions_around_a_ball_leave_no_gap() -> None:
    """Exact fractions: each triangle of their hull is farther from the middle than COVERED, and the middle is inside."""
    exact = [[Fraction(x) for x in row] for row in AROUND.tolist()]
    assert all(abs(sum(x * x for x in row) - 1) < Fraction(1, 10**14) for row in exact)
    triangles = ConvexHull(AROUND).simplices
    assert len(triangles) == 2 * len(AROUND) - 4, "they close a surface"
    for i, j, k in triangles:
        a, b, c = exact[i], exact[j], exact[k]
        u, v = ([y - x for x, y in zip(a, other, strict=True)] for other in (b, c))
        normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
        offset, length = sum(x * y for x, y in zip(normal, a, strict=True)), sum(x * x for x in normal)
        assert offset**2 > Fraction(COVERED) ** 2 * length
        side = [sum(x * y for x, y in zip(normal, row, strict=True)) - offset for row in exact]
        assert all(x * (1 if offset < 0 else -1) >= -Fraction(1, 10**14) for x in side), "all of them are on one side"


def test_drake_says_the_same_of_the_example() -> None:
    file, scene = read_scene_file(EXAMPLE), load_scene(EXAMPLE)
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 0.0)
    ProcessModelDirectives(LoadModelDirectivesFromString(file.resolved_directives), Parser(plant))
    plant.Finalize()
    context, cup = plant.CreateDefaultContext(), plant.GetBodyByName("cup")
    upright, zone = scene.conditions
    assert isinstance(upright, Cone)
    assert isinstance(zone, Inside)
    vertices = scene.geometry("cup/cup/wall").vertices
    rng, seed = np.random.default_rng(0), np.array([0, -1.7, 1.7, -1.57, -1.57, 0])
    q = np.clip(seed + rng.normal(size=(20_000, 6)) * rng.choice([0.05, 0.2, 0.6], (20_000, 1)), scene.q_lower, scene.q_upper)
    base = without_conditions(scene)
    held = [kept(base, condition, q) for condition in (upright, zone)]
    for at, up, inside in zip(q, *held, strict=True):
        plant.SetPositions(context, at)
        X = plant.EvalBodyPoseInWorld(context, cup)
        angle = math.acos(np.clip(X.rotation().matrix()[2, 2], -1, 1))
        points = X.multiply(vertices.T)
        left = min(
            0.65 - points[0].max(), points[0].min() - 0.1, 0.35 - np.abs(points[1]).max(), 0.6 - points[2].max(), points[2].min() - 0.02
        )
        assert up == (angle < math.radians(15)) or abs(angle - math.radians(15)) < HAIR
        assert inside == (left > 0) or abs(left) < HAIR
    assert 0.05 < held[0].mean() < 0.95
    assert 0.05 < held[1].mean() < 0.95


@pytest.fixture(scope="module")
def conditioned() -> Scene:
    """A planar arm whose second link points to within 60 degrees of x and stays below a line, with sums of angles to a range."""
    scene = planar_arm(obstacle=POST)
    tip = scene.geometries[1]
    return with_conditions(
        scene,
        [
            Cone("along-x", tip.body, (1.0, 0.0, 0.0), WORLD, (1.0, 0.0, 0.0), math.radians(60)),
            Inside("below", (tip.name,), WORLD, ((0.0, 1.0, 0.0, 1.2),)),
            Range("sum", tuple((joint.name, 1) for joint in scene.moving), -1.0, 0.9),
        ],
    )


def test_a_region_keeps_the_conditions_and_says_so(conditioned: Scene) -> None:
    grown = local.certify(conditioned, cube(conditioned, np.zeros(2), 0.1), assemble=True, cells=200)
    assert grown.outcome is Outcome.CERTIFIED
    assert grown.region is not None
    lines = verify_file(grown.region.proof).lines
    assert [line for line in lines if line.startswith("condition")] == [f"condition '{one.name}': {one}" for one in conditioned.conditions]
    assert any(f"{len(conditioned.body_pairs)} pairs of bodies" in line for line in lines)
    assert not any("conditions/" in line for line in lines)


@pytest.mark.parametrize("condition", ["along-x", "below", "sum"])
def test_a_polytope_in_which_a_condition_fails_is_refused(conditioned: Scene, condition: str) -> None:
    """The infeasible twins: without the condition, the same polytope is certified."""
    half, base = {"along-x": 0.4, "below": 0.45, "sum": 0.3}[condition], without_conditions(conditioned)
    wanted = [one for one in conditioned.conditions if one.name == condition]
    polytope = cube(base, np.zeros(2), half)
    assert local.certify(replace(base, pairs=()), polytope).outcome is Outcome.CERTIFIED
    failing = with_conditions(replace(base, pairs=()), wanted)
    assert local.certify(failing, polytope, cells=2000).outcome is Outcome.REFUTED


def sliding(*conditions: Condition) -> Scene:
    """Two slides along x, one behind the other, with a box."""
    arm = planar_arm(2)
    joints = tuple(replace(joint, kind=JointKind.PRISMATIC, axis=np.array([1.0, 0.0, 0.0])) for joint in arm.joints)
    return with_conditions(replace(arm, joints=joints, pairs=()), conditions)


TOTAL = SlideRange("total", (("arm/joint1", 1), ("arm/joint2", 1)), -0.25, 0.21)
AWAY = SlideRange("away", (("arm/joint1", 1), ("arm/joint2", -1)), -0.21, 0.25)
NEAR = InBall("near", (), WORLD, (2.0, 0.0, 0.0), 0.3, points=(("arm/link2", (1.0, 0.0, 0.0)),))
NOSE = Inside("nose", (), WORLD, ((1.0, 0.0, 0.0, 2.21),), points=(("arm/link2", (1.0, 0.0, 0.0)),))


@pytest.mark.parametrize("condition", [TOTAL, AWAY, NEAR, NOSE], ids=lambda one: one.name)
def test_a_region_of_slides_keeps_sums_and_points_stay_in_zones(condition: Condition) -> None:
    """With its infeasible twin: the cube goes to 0.2 in sum, and a larger one to 0.24 or 0.32."""
    scene = sliding(condition)
    grown = local.certify(scene, cube(scene, np.zeros(2), 0.1), assemble=True, cells=200)
    assert grown.region is not None
    assert f"condition '{condition.name}': {condition}" in verify_file(grown.region.proof).lines
    failing = local.certify(scene, cube(scene, np.zeros(2), 0.16 if condition is NEAR else 0.12), cells=2000)
    assert failing.outcome is (Outcome.TOO_CLOSE if condition is NEAR else Outcome.REFUTED)
    outside = np.array([0.3, -0.1] if condition is AWAY else [0.2, 0.2])
    with pytest.raises(RegionError, match=f"the condition '{condition.name}' is not kept: .* mm beyond"):
        check_free(scene, outside, "seed.q")


def test_motions_are_proved_to_keep_the_conditions_or_stop(conditioned: Scene) -> None:
    inside = certify_motion(conditioned, Motion(Space.Q, np.array([[-0.3, 0.2], [0.3, 0.1]])))
    assert inside.statement is not None
    assert [line for line in inside.statement.lines() if "condition 'along-x'" in line]
    leaves = certify_motion(conditioned, Motion(Space.Q, np.array([[0.0, 0.0], [0.9, 0.2]])))
    assert leaves.statement is not None
    assert leaves.statement.end < 0.9 / 1.1
    assert leaves.stop is not None
    assert condition_of(conditioned, leaves.stop.pair) is not None


def test_clearances_are_about_bodies(conditioned: Scene) -> None:
    grown = local.certify(conditioned, cube(conditioned, np.zeros(2), 0.1), assemble=True, cells=200)
    assert grown.region is not None
    found = clearance(grown.region.proof)
    assert not of_condition(found.nearest.pair.a)
    assert not of_condition(found.nearest.pair.b)
    assert 0 < found.distance <= found.nearest.distance
    motion = Motion(Space.Q, np.array([[-0.3, 0.2], [0.3, 0.1]]))
    for field, asked in (("clearance", {"clearance": True}), ("padding", {"padding": 0.01})):
        with pytest.raises(RegionError, match="is about bodies, and this scene has conditions") as error:
            certify_motion(conditioned, motion, **asked)
        assert (error.value.code, error.value.field) == ("has_conditions", field)


def test_a_map_names_its_conditions(conditioned: Scene) -> None:
    found = grow_map(conditioned, 0.5, 60.0)
    lines = verify_file(found.proof.to_bytes()).lines
    assert sum(line.startswith("there, condition") for line in lines) == 3


def test_near_the_surface_of_a_ball_it_is_not_said_that_the_condition_fails() -> None:
    """The tip of the first slide's box is 2 m from the world's origin at 0, and 3 m minus a millimetre are allowed."""
    scene = sliding(InBall("near", (), WORLD, (0.0, 0.0, 0.0), 3.0, points=(("arm/link2", (1.0, 0.0, 0.0)),)))
    pair = next(pair for pair in scene.pairs if in_collision(replace(scene, pairs=(pair,)), scene.to_s(np.array([[0.5, 0.499]])))[0])
    said = trouble(scene, pair, np.array([0.5, 0.499]))
    assert said == "the condition 'near' cannot be proved: a point of arm/link2 is 1 mm from the surface of the ball, which is too near"
    beyond = trouble(scene, pair, np.array([0.5, 0.501]))
    assert beyond == "the condition 'near' is not kept: a point of arm/link2 reaches 1 mm beyond the zone"


@pytest.mark.parametrize("end", [0.149, 0.151], ids=["inside", "outside"])
def test_a_contact_with_what_stands_for_a_ball_refutes_nothing(end: float) -> None:
    """The point is 0.298 or 0.302 m from the middle, and 0.3 are allowed."""
    scene = sliding(NEAR)
    found = certify_motion(scene, Motion(Space.Q, np.array([[0.0, 0.0], [end, end]])))
    assert found.stop is not None
    assert found.outcome is Outcome.TOO_CLOSE
    (pair, *_) = (pair for pair in scene.pairs if in_collision(replace(scene, pairs=(pair,)), scene.to_s(np.array([[end, end]])))[0])
    s = scene.to_s(np.array([end, end]))
    limits = scene.polytope([], [])
    weights = tuple(np.ones(len(scene.geometry(name).vertices)) for name in (pair.a, pair.b))
    with pytest.raises(ProofError, match="stands for a ball"):
        check_witness(WitnessProof(scene, pair, limits.C, limits.d, s, weights))


def test_a_seed_is_refused_with_the_angle_or_the_distance(conditioned: Scene) -> None:
    for name, q, words in (
        ("along-x", [1.5, 1.4], "the angle is 166.2 degrees, and 60 at most"),
        ("along-x", [0.6, 0.6], "the angle is 68.75 degrees, and 60 at most"),
        ("below", [1.0, 0.4], "mm beyond the zone"),
        ("sum", [-0.6, -0.6], "11.46 degrees beyond its range"),
    ):
        condition = next(one for one in conditioned.conditions if one.name == name)
        scene = with_conditions(replace(without_conditions(conditioned), pairs=()), [condition])
        with pytest.raises(RegionError, match=f"the condition '{name}' is not kept: .*{words}") as error:
            check_free(scene, np.array(q), "seed.q")
        assert error.value.code == "seed_in_collision"


@pytest.mark.parametrize(
    ("condition", "words", "unit"),
    [
        (Cone("c", "arm/link2", (1.0, 0.0, 0.0), WORLD, (0.0, 0.6, 0.8), 0.7), r"the angle is (\S+) degrees, and 40.1070457 at most$", 0.0),
        (Range("c", (("arm/joint1", 1), ("arm/joint2", -1)), 0.2, 0.5), r"the sum of the angles is (\S+) degrees beyond its range$", 0.0),
        (Inside("c", ("arm/link2/bar",), "arm/link1", ((0.0, 0.6, 0.8, 0.2),)), r"arm/link2/bar reaches (\S+) mm beyond the zone$", 1e-3),
    ],
    ids=lambda value: getattr(value, "kind", None),
)
def test_words_say_by_how_much_a_condition_is_not_kept(condition: Condition, words: str, unit: float) -> None:
    scene = with_conditions(planar_arm(), [condition])
    pair, failed = scene.pairs[-1], 0
    for q in np.random.default_rng(0).uniform(-1.2, 1.2, (50, 2)):
        beyond = -room(scene, condition, q)
        if beyond > HAIR:
            said = re.search(words, trouble(scene, pair, q))
            assert said, trouble(scene, pair, q)
            told = float(said[1]) * unit if unit else math.radians(float(said[1]))
            assert told == pytest.approx(beyond + (condition.angle if isinstance(condition, Cone) else 0.0), rel=1e-3)
            failed += 1
    assert failed > 10


def test_words_of_a_distance_say_how_far_the_bodies_are_apart_unless_they_touch() -> None:
    arm, post = planar_arm(), ball("world/post", WORLD, 0.1, (1.0, 1.5, 0.0))
    tip = ball("arm/link2/tip", "arm/link2", 0.05, (1.0, 0.0, 0.0))
    alone = replace(arm, geometries=(tip, post), pairs=(Pair(tip.name, post.name),))
    scene = with_conditions(alone, [Distance("away", tip.name, post.name, 0.5), Distance("far", tip.name, post.name, 0.75)])
    (pair,), found = scene.pairs, set()
    for q in np.random.default_rng(0).uniform(-1.2, 1.2, (300, 2)):
        end = np.array([math.cos(q[0]) + math.cos(q.sum()), math.sin(q[0]) + math.sin(q.sum())])
        apart = float(np.linalg.norm(end - (1.0, 1.5))) - 0.15
        if apart < 0.75:
            far = f"the condition 'far' is not kept: {pair.a} and {pair.b} are {apart:.4g} m apart, and 0.75 at least"
            assert trouble(scene, pair, q) == (far if apart > 0 else f"{pair.a} and {pair.b} touch")
            found.add(apart > 0)
    assert found == {True, False}


def test_a_distance_is_kept_as_padding() -> None:
    scene = planar_arm(obstacle=POST)
    pair = scene.pairs[0]
    apart = with_conditions(scene, [Distance("away", pair.a, pair.b, 0.1)])
    assert apart.padding_of(pair) >= 0.05
    assert [other for other in apart.pairs if other != pair] == [other for other in scene.pairs if other != pair]
    check_scene(apart)
    with pytest.raises(SceneError, match="does not certify"):
        with_conditions(replace(scene, pairs=scene.pairs[1:]), [Distance("away", pair.a, pair.b, 0.1)])


def test_a_distance_is_refuted_where_it_is_not_kept() -> None:
    """The infeasible twin of a distance, and 2000 configurations for which the distance of two balls is known without any solver."""
    arm, post = planar_arm(), ball("world/post", WORLD, 0.1, (1.0, 1.5, 0.0))
    tip = ball("arm/link2/tip", "arm/link2", 0.05, (1.0, 0.0, 0.0))
    scene = replace(arm, geometries=(tip, post), pairs=(Pair(tip.name, post.name),))
    q = np.random.default_rng(0).uniform(-0.4, 0.4, (2000, 2))
    ends = np.cumsum([np.stack([np.cos(a), np.sin(a)], axis=1) for a in (q[:, 0], q.sum(axis=1))], axis=0)[-1]
    apart = np.linalg.norm(ends - (1.0, 1.5), axis=1) - 0.15
    polytope = cube(scene, np.zeros(2), 0.2)
    for metres, outcome in ((0.5, Outcome.CERTIFIED), (1.2, Outcome.REFUTED)):
        away = with_conditions(scene, [Distance("away", tip.name, post.name, metres)])
        compared = abs(apart - metres) > HAIR
        assert (~in_collision(away, away.to_s(q)) == (apart > metres))[compared].all()
        assert local.certify(away, polytope, cells=2000).outcome is outcome


def test_a_scene_with_conditions_is_stored_whole(conditioned: Scene) -> None:
    document = json.loads(json.dumps(conditioned.to_document()))
    again = Scene.from_document(document)
    assert (again.hash, again.conditions) == (conditioned.hash, conditioned.conditions)
    assert with_conditions(without_conditions(again), again.conditions).hash == again.hash
    assert without_conditions(again).hash == planar_arm(obstacle=POST).hash
    assert "conditions" not in planar_arm().to_document()


def test_proposals_are_made_for_narrower_conditions(conditioned: Scene) -> None:
    cone, zone, total = tightened(conditioned).conditions
    assert isinstance(cone, Cone)
    assert isinstance(total, Range)
    assert math.degrees(cone.angle) == pytest.approx(56)
    assert zone == conditioned.conditions[1]
    assert (total.lower, total.upper) == (pytest.approx(-0.05 - 0.95 * 14 / 15), pytest.approx(-0.05 + 0.95 * 14 / 15))
    plain = planar_arm()
    assert tightened(plain) is plain


def forged(document: dict[str, Any], **changes: Any) -> Scene:
    """The scene of a changed document, with the hash that fits it."""
    return Scene.from_document({name: value for name, value in {**document, **changes}.items() if name != "hash"})


def test_forged_conditions_are_refused(conditioned: Scene) -> None:
    document = json.loads(json.dumps(conditioned.to_document()))
    check_scene(forged(document))
    geometries, pairs, joints = (document[name] for name in ("geometries", "pairs", "joints"))
    place = next(i for i, one in enumerate(geometries) if one["name"].endswith("/beyond"))

    def with_geometry(**changes: Any) -> list[Any]:
        return [*geometries[:place], {**geometries[place], **changes}, *geometries[place + 1 :]]

    smaller = (0.9 * np.array(geometries[place]["vertices"])).tolist()
    wider = [{**one, "angle": 1.2} if one["kind"] == "cone" else one for one in document["conditions"]]
    hidden = {**geometries[0], "name": "conditions/hidden/ball"}
    frozen = [{**one, "index": 0} if of_condition(one["name"]) and one["index"] == 1 else one for one in joints]
    forgeries: list[dict[str, Any]] = [
        {"geometries": with_geometry(vertices=smaller)},
        {"geometries": [{**one, "radius": 0.0} if one["name"].endswith("/direction") else one for one in geometries]},
        {"conditions": wider},
        {"conditions": document["conditions"][1:]},
        {"conditions": []},
        {"conditions": [*document["conditions"], document["conditions"][0]]},
        {"pairs": [pair for pair in pairs if "conditions/along-x/beyond" not in pair]},
        {"geometries": [*geometries, hidden]},
        {"joints": frozen},
        {"ignored": [{"pair": ["arm/link1/bar", "conditions/along-x/beyond"], "reason": "x"}]},
        {"joints": [{**joints[0], "name": "conditions/joint1"}, *joints[1:]]},
    ]
    for changes in forgeries:
        with pytest.raises(ProofError) as error:
            check_scene(forged(document, **changes))
        assert error.value.code == "proof_model", changes
    without = {name: value for name, value in document.items() if name != "conditions"}
    with pytest.raises(ProofError, match="what stands for its conditions"):
        check_scene(forged(without))


@pytest.mark.parametrize("kind", [["cone"], {"cone": 1}, None, "sphere", 3])
def test_a_condition_of_no_kind_is_no_document(conditioned: Scene, kind: object) -> None:
    with pytest.raises(SceneError, match="a condition, whose kind is one of"):
        forged(conditioned.to_document(), conditions=[{"kind": kind, "name": "c"}])


def test_numbers_of_statements_are_rounded_to_the_safe_side() -> None:
    cone = Cone("c", "a", UP, "b", (0.6, 0.0, 0.8), math.radians(123.4567894))
    assert str(cone) == "the direction (0, 0, 1) of 'a' stays within 123.45679 degrees of (0.6, 0, 0.8) of 'b'"
    assert str(Distance("d", "a", "b", 0.1000000005001)) == "'a' and 'b' stay at least 0.1 m apart"
    assert "x <= 0.12345679 m" in str(Inside("i", ("a",), "b", ((0.6, 0.8, 0.0, 0.1234567891),)))
    assert "from -1 to 0.0572957796 degrees" in str(Range("r", (("a", 1),), math.radians(-1), 0.001))


def test_a_half_space_is_in_no_zone_and_joints_that_move_together_are_refused() -> None:
    arm = planar_arm()
    floor = replace(arm.geometries[0], shape={"kind": "half_space"})
    zone = Inside("c", (floor.name,), WORLD, ((1.0, 0.0, 0.0, 0.5),))
    with pytest.raises(SceneError, match="a half-space has no end"):
        with_conditions(replace(arm, geometries=(floor, *arm.geometries[1:])), [zone])
    follower = replace(arm.joints[1], index=0, follows=True)
    led = replace(arm, joints=(arm.joints[0], follower), q_star=np.zeros(1))
    with pytest.raises(SceneError, match="joints that move together are between"):
        with_conditions(led, [Cone("c", "arm/link2", (1.0, 0.0, 0.0), WORLD, (1.0, 0.0, 0.0), 0.5)])


def test_what_other_machines_round_does_not_matter(conditioned: Scene) -> None:
    def moved(by: float) -> Scene:
        rng = np.random.default_rng(0)
        return replace(
            conditioned,
            geometries=tuple(
                replace(one, vertices=one.vertices + by * rng.choice([-1, 1], one.vertices.shape)) if of_condition(one.name) else one
                for one in conditioned.geometries
            ),
        )

    check_scene(moved(1e-13))
    with pytest.raises(ProofError, match="what stands for its conditions"):
        check_scene(moved(1e-9))


@pytest.mark.parametrize(
    "condition",
    [
        Cone("c", "nobody", UP, WORLD, UP, 0.5),
        Cone("c", "arm/link1", UP, "nobody", UP, 0.5),
        Cone("c", WORLD, UP, WORLD, UP, 0.5),
        Cone("c", "arm/link1", (0.0, 0.0, 2.0), WORLD, UP, 0.5),
        Cone("c", "arm/link1", (math.nan, 0.0, 1.0), WORLD, UP, 0.5),
        Cone("c", "arm/link1", UP, WORLD, UP, 0.0),
        Cone("c", "arm/link1", UP, WORLD, UP, 3.15),
        Cone("c/d", "arm/link1", UP, WORLD, UP, 0.5),
        Cone("turning", "arm/link1", UP, WORLD, UP, 0.5),
        Inside("c", (), WORLD, ((1.0, 0.0, 0.0, 1.0),)),
        Inside("c", ("nobody",), WORLD, ((1.0, 0.0, 0.0, 1.0),)),
        Range("c", (), -1.0, 1.0),
        Range("c", (("nobody", 1),), -1.0, 1.0),
        Range("c", (("arm/joint1", 1), ("arm/joint1", 1)), -1.0, 1.0),
        Range("c", (("arm/joint1", 1),), 1.0, 1.0),
        Range("c", (("arm/joint1", 1),), -4.0, 4.0),
        Range("c", (("arm/joint1", 1),), 1e9, 1e9 + 1),
        Cone("c", "arm/link1", (0.0, 0.0, 1.0 + 1e-10), WORLD, UP, 0.5),
        Distance("c", "nobody", "arm/link1", 0.1),
        Distance("c", "nobody", "arm/link1", 0.0),
    ],
)
def test_conditions_that_make_no_sense_are_refused(condition: Condition) -> None:
    with pytest.raises(SceneError) as error:
        with_conditions(planar_arm(), [condition])
    assert error.value.code == "condition"


def test_no_model_is_called_as_what_stands_for_conditions() -> None:
    arm = planar_arm()
    own = replace(arm, geometries=(*arm.geometries, ball("conditions/box/ball", WORLD, 0.1)))
    with pytest.raises(SceneError, match="no model may be called conditions") as error:
        with_conditions(own, [])
    assert (error.value.code, error.value.field) == ("condition", "directives")


def test_words_of_a_pair_name_both_bodies_or_the_condition(conditioned: Scene) -> None:
    first, last = conditioned.pairs[0], conditioned.pairs[-1]
    assert called(first.a, first.b) == f"{first.a} and {first.b}"
    assert called(last.a, last.b) == "the condition 'sum'"
    assert [fails(pair.a, pair.b) for pair in (first, last)] == [f"{first.a} and {first.b} touch", "the condition 'sum' is not kept"]
    assert trouble(planar_arm(), Pair("a", "b")) == "a and b touch"
