"""IRIS: Drake's own s is the scene's, a small epsilon only cuts from what a coarse one gives, and threads change nothing."""

import contextlib
import math
import os
import signal
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff
from pydrake.multibody.rational import RationalForwardKinematics
from pydrake.planning import IrisParameterizationFunction

from certifier.model import Geometry, Joint, JointKind, Pair, Scene
from certifier.outcome import Guarantee
from certifier.scene.drake_model import build_diagram
from certifier.seeding.iris import _listening, checker, iris
from certifier.seeding.options import Method, SeedOptions


def ball(name, body, center, radius):
    return Geometry(name, body, np.array([center], dtype=float), radius, {"kind": "sphere", "radius": radius})


@st.composite
def chains(draw):
    """Chains of revolute and prismatic joints whose bodies come in any order, with a ball at the end and one far away."""
    kinds = draw(st.lists(st.sampled_from([JointKind.REVOLUTE, JointKind.PRISMATIC]), min_size=1, max_size=4))
    bodies = ["world", *(f"b{i}" for i in range(len(kinds)))]
    joints = tuple(
        Joint(f"j{i}", kind, bodies[i], bodies[i + 1], np.eye(3)[draw(st.integers(0, 2))], np.eye(4), np.eye(4), i, -2.0, 2.0)
        for i, kind in enumerate(kinds)
    )
    balls = ball("hand", bodies[-1], (0.5, 0, 0), 0.1), ball("far", "world", (99, 0, 0), 0.1)
    q_star = np.array(draw(st.lists(st.floats(-0.5, 0.5), min_size=len(kinds), max_size=len(kinds))))
    return Scene("chain", joints, tuple(draw(st.permutations(bodies))), balls, (Pair("hand", "far"),), (), q_star, 0.0)


@settings(max_examples=60, deadline=None)
@given(chains(), st.data())
def test_drakes_s_is_the_scenes(scene, data):
    """The scene's own formulas are the oracle, for the positions and for their derivatives."""
    s = np.array([data.draw(st.floats(lower, upper)) for lower, upper in zip(scene.s_lower, scene.s_upper, strict=True)])
    robot = checker(scene)
    kinematics = RationalForwardKinematics(robot.plant())
    parameterization = IrisParameterizationFunction(kinematics, scene.q_star)
    assert np.allclose(parameterization.get_parameterization_double()(s), scene.to_q(s), rtol=0, atol=1e-12)
    assert np.allclose(kinematics.ComputeSValue(scene.to_q(s), scene.q_star), s, rtol=1e-9, atol=1e-9)
    gradient = ExtractGradient(parameterization.get_parameterization_autodiff()(InitializeAutoDiff(s)[:, 0]))
    assert np.allclose(gradient, np.diag(np.where(scene.revolute, 2 / (1 + s * s), 1)), rtol=0, atol=1e-12)


def test_drake_numbers_s_by_bodies():
    """This is why the checker's bodies are sorted: with the scene's own order Drake takes one joint's s for the other's."""
    scene = posts(1)
    assert scene.bodies.index("cart") > scene.bodies.index("arm")
    s = np.array([0.5, 0.3])
    diagram, robot = build_diagram(scene), checker(scene)
    assert not np.allclose(RationalForwardKinematics(diagram.plant()).ComputeQValue(s, scene.q_star), scene.to_q(s), atol=0.1)
    assert np.allclose(RationalForwardKinematics(robot.plant()).ComputeQValue(s, scene.q_star), scene.to_q(s))


def posts(count):
    """A cart on rails along x with an arm of length 1 and a ball at its end, with this number of posts around the rails."""
    eye = np.eye(4)
    slide = Joint("slide", JointKind.PRISMATIC, "world", "cart", np.array([1.0, 0, 0]), eye, eye, 0, -2.0, 2.0)
    turn = Joint("turn", JointKind.REVOLUTE, "cart", "arm", np.array([0, 0, 1.0]), eye, eye, 1, -2.5, 2.5)
    hook = ball("hook", "arm", (1, 0, 0), 0.1)
    places = [(2.8 * math.cos(angle), 0.9 * math.sin(angle), 0) for angle in np.linspace(0.4, 2 * math.pi - 0.4, count)]
    balls = [ball(f"post{i}", "world", place, 0.1) for i, place in enumerate(places)]
    pairs = tuple(Pair("hook", post.name) for post in balls)
    return Scene("posts", (slide, turn), ("world", "arm", "cart"), (hook, *balls), pairs, (), np.zeros(2), 0.0)


def collisions(scene, C, d, count=200_000):
    """Returns the share of the region's volume in q, between 0 and 1, that is in collision, by trigonometry, and that volume."""
    rng = np.random.default_rng(0)
    q = rng.uniform((-2.0, -2.5), (2.0, 2.5), (count, 2))
    inside = (scene.to_s(q) @ C.T <= d).all(axis=1)
    hook = np.stack([q[:, 0] + np.cos(q[:, 1]), np.sin(q[:, 1])], axis=1)
    centers = np.array([scene.geometry(pair.b).vertices[0][:2] for pair in scene.pairs])
    touching = (np.linalg.norm(hook[:, None] - centers, axis=2) < 0.2).any(axis=1)
    return (touching & inside).sum() / inside.sum(), 20 * inside.mean()


@pytest.mark.parametrize("method", [Method.IRIS_NP2, Method.IRIS_ZO])
def test_a_small_epsilon_cuts_from_what_a_coarse_one_gives(method, monkeypatch):
    """The coarse region is one that collides, so that there is something to cut. Most of it is kept."""
    monkeypatch.setattr("certifier.seeding.iris._COARSE", 0.3)
    scene, seed = posts(7), np.zeros((1, 2))
    options = SeedOptions(method, max_iterations=1, max_iterations_separating_planes=3, margin=1e-4)
    coarse, fine = (iris(scene, seed, replace(options, epsilon=epsilon)) for epsilon in (0.3, 0.001))
    (colliding, large), (left, small) = collisions(scene, *coarse[:2]), collisions(scene, *fine[:2])
    assert fine[2]["guarantee"] == Guarantee.SAMPLED
    assert left <= 0.001 < colliding
    assert 0.5 * large < small < large
    points = np.random.default_rng(1).uniform(scene.s_lower, scene.s_upper, (50_000, 2))
    assert not (scene.polytope(*fine[:2]).contains(points) & ~scene.polytope(*coarse[:2]).contains(points)).any()


def test_a_refinement_that_gave_up_claims_nothing(monkeypatch):
    """The coarse region passes its test, which says nothing of the small epsilon; one round cannot pass the second test."""
    monkeypatch.setattr("certifier.seeding.iris._COARSE", 0.3)
    options = SeedOptions(Method.IRIS_NP2, max_iterations=1, max_iterations_separating_planes=1)
    coarse, fine = (iris(posts(7), np.zeros((1, 2)), replace(options, epsilon=epsilon))[2] for epsilon in (0.3, 0.002))
    assert coarse["guarantee"] == Guarantee.SAMPLED
    assert fine["guarantee"] == Guarantee.NONE
    assert any("voids the probabilistic guarantees" in warning for warning in fine["warnings"])


def test_a_refinement_that_would_lose_a_point_is_left_out(monkeypatch):
    """A post lies between the two points, so what contains both collides. The coarse test lets that pass."""
    monkeypatch.setattr("certifier.seeding.iris._COARSE", 0.9)
    scene = posts(1)
    points = scene.to_s(np.array([(0.0, -0.3), (1.95, 0.65)]))
    options = SeedOptions(Method.IRIS_NP2, epsilon=0.002, max_iterations=1)
    C, d, account = iris(scene, points, options)
    assert account["epsilon"] == 0.9
    assert (d[:, None] > C @ points.T).all()
    assert collisions(scene, C, d)[0] > 0.002


@pytest.mark.slow
def test_the_number_of_threads_changes_nothing():
    """The service seeds on one thread and ``--local`` on all cores."""
    code = "from tests.certifier.seeding.test_iris import printed; printed()"
    one, more = (
        subprocess.run(
            [sys.executable, "-c", code], env=os.environ | {"OMP_NUM_THREADS": threads}, check=True, capture_output=True, text=True
        ).stdout
        for threads in ("1", "8")
    )
    assert one.startswith("1 threads")
    assert one.partition("\n")[2] == more.partition("\n")[2] != ""


def printed():
    """Prints the number of Drake's threads, then the region in hexadecimal digits."""
    from pydrake.common import Parallelism

    C, d, _ = iris(posts(5), np.zeros((1, 2)), SeedOptions(Method.IRIS_NP2, max_iterations=1, epsilon=0.005))
    print(Parallelism.Max().num_threads(), "threads")
    print([value.hex() for value in [*C.ravel().tolist(), *d.tolist()]])


def interrupted_within_the_log(heard):
    with _listening():
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        heard.append("the call of Drake went on")


def test_an_interrupt_that_drakes_log_swallows_is_raised_in_the_end():
    """Python raises it in whatever runs, and Drake's log forgets what is raised in it."""
    heard = []
    with pytest.raises(KeyboardInterrupt):
        interrupted_within_the_log(heard)
    assert heard
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
