"""Motions that a child process finds: what is returned is free by Drake, keeps its limits, and has a proof that the verifier takes."""

from __future__ import annotations

import base64
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RollPitchYaw

from certifier.model import WORLD, Pair
from certifier.pair.collisions import in_collision
from certifier.proof.container import with_scene
from certifier.proof.motion import MotionProof, Space
from certifier.scene import load_scene
from certifier.scene.drake_model import build_diagram
from certifier.verify.file import verify_file
from certifier.verify.motion import verify_motion
from planner.sampling.child import planned
from planner.tubes import Tube, follows
from tests.certifier.scenes import ball, box, planar_arm
from tests.oracles.clearance import DrakesClearance

EXAMPLES = Path(__file__).parents[3] / "examples"


def ask(scene, points, goals, seconds=5.0, speed=1.0, acceleration=2.0):
    each = {"speed": np.full(scene.n, speed), "acceleration": np.full(scene.n, acceleration)}
    points, goals = (np.atleast_2d(np.array(given, dtype=float)) for given in (points, goals))
    return planned({"points": points, "goals": goals, "seconds": seconds, **each}, scene)


def check(scene, found, speed=1.0, acceleration=2.0):
    """What holds of every motion that is found."""
    q, t = found["q"], found["t"]
    data = with_scene(base64.b64decode(found["planes"]), scene)
    assert verify_file(data).scene.hash == scene.hash
    statement = verify_motion(MotionProof.from_bytes(data, scene))
    assert (statement.motion.space, statement.end, statement.rho) == (Space.Q, 1.0, found["tube"])
    assert np.array_equal(statement.motion.controls, found["path"])
    assert np.array_equal(found["path"], q) or follows(Tube("", found["path"], found["tube"]), q)
    lower, upper = scene.own_limits
    assert ((lower <= q) & (q <= upper)).all()
    if t[-1] > 0:
        step = np.diff(t)[:, None]
        velocity = np.diff(q, axis=0) / step
        assert (np.abs(velocity) <= speed).all()
        ends = 2 * np.abs(velocity[[0, -1]]) / step[[0, -1]]
        assert (ends <= acceleration).all(), "from rest over half a step"
        between = (step[1:] + step[:-1]) / 2
        assert (np.abs(np.diff(velocity, axis=0) / between) <= acceleration).all()
    dense = np.concatenate([a + np.linspace(0, 1, 20)[:, None] * (b - a) for a, b in pairwise(q)])
    assert not in_collision(scene, scene.to_s(dense)).any()
    clearance = DrakesClearance(scene)
    assert all(clearance.least(x)[0] > 0 for x in dense[:: max(1, len(dense) // 50)])


@pytest.mark.parametrize("name", ["planar_2dof", "arm_3dof", "ur3e_bin", "iiwa_shelf"])
def test_random_questions_have_motions_that_are_proved(name):
    scene = load_scene(EXAMPLES / name / "scene.yaml")
    q = np.random.default_rng(2).uniform(scene.q_lower, scene.q_upper, (60, scene.n))
    free = q[~in_collision(scene, scene.to_s(q))][:16]
    for a, b in zip(free[:8], free[8:], strict=True):
        found = ask(scene, a, b)
        assert "reason" not in found
        assert np.array_equal(found["q"][[0, -1]], [a, b])
        check(scene, found)


def test_the_same_question_has_the_same_answer():
    scene = load_scene(EXAMPLES / "planar_2dof" / "scene.yaml")
    straight = ask(scene, [0, 0], [0.3, 0.2])
    assert np.array_equal(straight["path"], [[0, 0], [0.3, 0.2]])
    assert np.array_equal(ask(scene, [0, 0], [0.3, 0.2])["q"], straight["q"])


@pytest.mark.parametrize(("speed", "acceleration"), [(1e6, 1.0), (1e6, 1e-6), (1e-6, 1e6), (1e4, 2.0), (1e6, 1e6)])
def test_a_limit_that_is_never_reached_costs_nothing(speed, acceleration):
    scene = load_scene(EXAMPLES / "planar_2dof" / "scene.yaml")
    for points in ([[0, 0]], [[0, 0], [-0.2, 0.3]]):  # a straight line, and one with a corner
        found = ask(scene, points, [0.3, 0.2], speed=speed, acceleration=acceleration)
        check(scene, found, speed, acceleration)
        assert len(found["q"]) < 100


def test_the_motion_goes_through_what_it_is_asked_to():
    scene = load_scene(EXAMPLES / "planar_2dof" / "scene.yaml")
    via = [[-0.4, 0.3], [0.2, -0.5]]
    found = ask(scene, [[0, 0], *via], [0.3, -0.2])
    check(scene, found)
    distances = np.abs(found["q"][:, None] - np.array(via)).max(axis=2).min(axis=0)
    assert (distances < 1e-9).all()


def test_of_several_goals_it_takes_the_nearest_that_it_can_reach():
    scene = load_scene(EXAMPLES / "planar_2dof" / "scene.yaml")
    touching = next(x for x in np.random.default_rng(0).uniform(-1, 1, (500, 2)) if in_collision(scene, scene.to_s(x[None]))[0])
    found = ask(scene, [0, 0], [touching, [9.0, 0.0], [-0.5, 0.5], [-0.1, 0.1]])
    assert found["q"][-1].tolist() == [-0.1, 0.1]


def turret(lower=None, upper=None):
    """A bar that can turn for ever, and a post in its way at 180 degrees."""
    post = ball("world/post", WORLD, 0.1, (-0.9, 0.0, 0.0))
    arm = planar_arm(1, post)
    joint = replace(arm.joints[0], lower=-2.9, upper=2.9, own_limits=(lower, upper))
    return replace(arm, joints=(joint,), pairs=(Pair(arm.geometries[0].name, post.name),))


def test_a_joint_goes_around_the_end_of_its_window():
    post = ball("world/post", WORLD, 0.1, (0.9, 0.0, 0.0))
    scene = replace(turret(), geometries=(turret().geometries[0], post))
    found = ask(scene, [2.8], [-2.8])
    check(scene, found)
    assert (found["q"][-1, 0], found["path"].shape) == (pytest.approx(2 * np.pi - 2.8), (2, 1))


def test_a_joint_takes_the_other_way_where_something_is_between():
    scene = turret()
    found = ask(scene, [2.8], [-2.8])
    check(scene, found)
    assert found["q"][-1, 0] == pytest.approx(-2.8)
    walled = turret(-3.0, 3.0)
    assert ask(walled, [2.8], [-2.8])["q"][-1, 0] == pytest.approx(-2.8)


def test_there_is_no_motion_through_a_wall():
    """A bar between two posts, on either side, cannot get out."""
    arm = planar_arm(1, limit=3.0)
    posts = [ball(f"world/post{i}", WORLD, 0.1, (0.9 * np.cos(a), 0.9 * np.sin(a), 0.0)) for i, a in enumerate((1.0, -1.0))]
    bar = arm.geometries[0]
    scene = replace(arm, geometries=(bar, *posts), pairs=tuple(Pair(bar.name, post.name) for post in posts))
    assert ask(scene, [0.0], [2.0], seconds=0.3) == {"reason": "no_motion"}
    check(scene, ask(scene, [0.0], [0.5]))


@pytest.mark.parametrize(
    ("points", "goals", "where"), [([[1.0]], [[0.0]], "start"), ([[0.0], [1.0]], [[0.0]], "via[0]"), ([[0.0]], [[1.0]], "goal[0]")]
)
def test_what_touches_is_named_with_a_free_place_near_by(points, goals, where):
    post = box("world/post", WORLD, (0.2, 0.2, 0.2), (0.9 * np.cos(1.0), 0.9 * np.sin(1.0), 0.0))
    scene = planar_arm(1, post)
    found = ask(scene, points, goals)
    assert (found["reason"], found["where"], {found["a"], found["b"]}) == ("in_collision", where, {"arm/link1/bar", "world/post"})
    depth = -DrakesClearance(scene).least(np.array([1.0]))[0]
    assert found["depth"] == pytest.approx(depth)
    assert DrakesClearance(scene).free(found["free"])
    beyond = ask(scene, *(np.where(np.array(given) == 1.0, 2.5, given) for given in (points, goals)))
    assert (beyond["reason"], beyond["where"], beyond["joint"]) == ("outside_limits", where, "arm/joint1")
    assert (beyond["value"], beyond["lower"], beyond["upper"]) == (2.5, -2.0, 2.0)


def test_a_motion_passes_by_closely():
    """A slot that leaves 2 mm on either side, and one that leaves 0.02 mm."""
    arm = planar_arm(1, limit=2.0)
    for room in (2e-3, 2e-5):
        wall = box("world/wall", WORLD, (1.5, 0.1, 0.2), (0.5, 0.0, 0.15 + room))
        scene = replace(arm, geometries=(arm.geometries[0], wall), pairs=(Pair("arm/link1/bar", "world/wall"),))
        found = ask(scene, [-1.5], [1.5])
        assert "reason" not in found
        check(scene, found)


def pose(q):
    """The pose of the end of the iiwa at q, by Drake, as a goal."""
    scene = load_scene(EXAMPLES / "iiwa_shelf" / "scene.yaml")
    plant = build_diagram(scene).plant()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    X = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName("iiwa/flange"))
    return {"frame": "flange", "position": X.translation(), "rpy": RollPitchYaw(X.rotation()).vector()}


HOME = np.array([0, 0.3, 0, -1.8, 0, 0.9, 0])
EACH = {"speed": np.ones(7), "acceleration": np.full(7, 2.0), "seconds": 5.0}


def test_a_pose_is_reached_where_drake_says_so():
    scene = load_scene(EXAMPLES / "iiwa_shelf" / "scene.yaml")
    there = pose(np.add(HOME, [0.5, 0.2, 0.1, 0.2, 0.1, -0.1, 0.3]))
    found = planned({"points": HOME[None], "pose": there, **EACH}, scene)
    check(scene, found)
    reached = pose(found["q"][-1])
    assert np.allclose(reached["position"], there["position"], atol=1e-8)
    assert np.allclose(reached["rpy"], there["rpy"], atol=1e-7)
    far = planned({"points": HOME[None], "pose": {**there, "position": np.array([3.0, 0, 0])}, **EACH}, scene)
    assert (far["reason"], far["metres"] > 1) == ("unreachable", True)


def test_the_tool_stays_on_a_line_where_drake_looks():
    scene = load_scene(EXAMPLES / "iiwa_shelf" / "scene.yaml")
    begin = pose(HOME)
    end = begin["position"] + [0.02, 0.15, 0.1]
    line = {"metres": 1e-3, "radians": 1e-2}
    found = planned({"points": HOME[None], "pose": {"frame": "flange", "position": end, "rpy": None}, "line": line, **EACH}, scene)
    check(scene, found)
    plant = build_diagram(scene).plant()
    context, body, way = plant.CreateDefaultContext(), plant.GetBodyByName("iiwa/flange"), end - begin["position"]
    upright = RollPitchYaw(begin["rpy"]).ToRotationMatrix()
    for a, b in pairwise(found["q"]):
        for u in np.linspace(0, 1, 20):
            plant.SetPositions(context, a + u * (b - a))
            X = plant.EvalBodyPoseInWorld(context, body)
            along = np.clip((X.translation() - begin["position"]) @ way / (way @ way), 0, 1)
            assert np.linalg.norm(X.translation() - begin["position"] - along * way) <= line["metres"]
            assert (upright.inverse() @ X.rotation()).ToAngleAxis().angle() <= line["radians"]
    blocked = {"frame": "flange", "position": begin["position"] + [0.4, 0.0, 0.0], "rpy": None}
    stop = planned({"points": HOME[None], "pose": blocked, "line": line, **EACH}, scene)
    assert (stop["reason"], stop["how"], 0 < stop["part"] < 1) == ("line", "collision", True)
