"""Drake's IRIS: Drake's own s is the scene's, it keeps its promise, and threads and interrupts change nothing."""

import contextlib
import os
import signal
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff
from pydrake.multibody.rational import RationalForwardKinematics
from pydrake.planning import IrisParameterizationFunction

from certifier.model import Joint, JointKind, Pair, Scene
from certifier.outcome import Guarantee
from certifier.scene.drake_model import build_diagram
from certifier.seeding.drake_iris import _listening, checker, drake_iris
from certifier.seeding.options import Method, SeedOptions
from tests.certifier.seeding.posts import ball, collisions, posts


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


@pytest.mark.parametrize("method", [Method.IRIS_NP2, Method.IRIS_ZO])
def test_drake_keeps_its_promise(method):
    scene, seed = posts(7), np.zeros((1, 2))
    options = SeedOptions(method, max_iterations=1, max_iterations_separating_planes=20, margin=1e-4, epsilon=0.003)
    C, d, account = drake_iris(scene, seed, options)
    left, volume = collisions(scene, C, d)
    assert account["guarantee"] == Guarantee.SAMPLED
    assert left <= 0.01
    assert volume > 0.5
    assert (d > C @ seed[0]).all()


def test_one_round_of_faces_claims_nothing():
    options = SeedOptions(Method.IRIS_NP2, max_iterations=1, max_iterations_separating_planes=1, epsilon=0.002)
    account = drake_iris(posts(7), np.zeros((1, 2)), options)[2]
    assert account["guarantee"] == Guarantee.NONE
    assert any("voids the probabilistic guarantees" in warning for warning in account["warnings"])


@pytest.mark.slow
def test_the_number_of_threads_changes_nothing():
    """The service seeds on one thread and ``--local`` on all cores."""
    code = "from tests.certifier.seeding.test_drake_iris import printed; printed()"
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

    C, d, _ = drake_iris(posts(5), np.zeros((1, 2)), SeedOptions(Method.IRIS_NP2, max_iterations=1, epsilon=0.005))
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
