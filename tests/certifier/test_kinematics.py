import numpy as np
import pytest
from flint import Ordering, fmpq, fmpq_mpoly_ctx

from certifier.kinematics import Kinematics, rigid_inverse, rotation
from certifier.model import WORLD, JointKind
from certifier.verify.kinematics import ExactKinematics, exact, half_tangent
from tests.certifier.scenes import random_tree


def world_pose(scene, body, q):
    X = np.eye(4)
    above = {joint.child: joint for joint in scene.joints}
    while body != WORLD:
        joint = above[body]
        X_FM = np.eye(4)
        if joint.kind is JointKind.REVOLUTE:
            X_FM[:3, :3] = rotation(joint.axis, q[joint.index])
        elif joint.kind is JointKind.PRISMATIC:
            X_FM[:3, 3] = joint.axis * q[joint.index]
        X = joint.X_PF @ X_FM @ rigid_inverse(joint.X_BM) @ X
        body = joint.parent
    return X


@pytest.mark.parametrize("seed", range(5))
def test_numerators_are_the_pose_times_the_denominator(seed):
    scene = random_tree(seed)
    kinematics = Kinematics(scene)
    rng = np.random.default_rng(seed)
    q = rng.uniform(-1.4, 1.4, (4, scene.n))
    s = scene.to_s(q)
    for frame in scene.bodies:
        for body in scene.bodies:
            X = kinematics.numerators(frame, body, s)
            chain = kinematics.chain(frame, body)
            denominator = np.prod(np.where(scene.revolute, 1 + s**2, 1.0)[:, chain], axis=1)
            np.testing.assert_allclose(X[:, 3, 3], denominator, rtol=1e-13)
            for i in range(len(q)):
                expected = rigid_inverse(world_pose(scene, frame, q[i])) @ world_pose(scene, body, q[i])
                np.testing.assert_allclose(X[i] / X[i, 3, 3], expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("seed", range(3))
def test_the_verifiers_polynomials_agree_with_the_numerators(seed):
    scene = random_tree(seed, bodies=5)
    rng = np.random.default_rng(seed)
    mid, half = rng.uniform(-0.5, 0.5, scene.n), rng.uniform(0.1, 0.5, scene.n)
    ring = fmpq_mpoly_ctx.get([f"u{i}" for i in range(scene.n)], Ordering.lex)
    kinematics = ExactKinematics.on_box(scene, ring, mid, half)
    u = rng.uniform(-1, 1, scene.n)
    for frame in scene.bodies:
        for body in scene.bodies:
            X = kinematics.pose(frame, body)
            values = np.array([[float(entry(*(exact(x) for x in u))) for entry in row] for row in X])
            expected = Kinematics(scene).numerators(frame, body, (mid + half * u)[None])[0]
            np.testing.assert_allclose(values / float(kinematics.scale(frame, body)), expected, atol=1e-12 * np.abs(expected).max())


@pytest.mark.parametrize("angle", [0.0, 1e-12, 0.3, -2.5, 3.1])
def test_half_tangent_is_accurate_beyond_doubles(angle):
    tau = half_tangent(angle)
    assert abs(2 * np.arctan(float(tau)) - angle) < 1e-15
    assert tau == 0 or tau.q & (tau.q - 1) == 0, "a dyadic number"
    assert isinstance(tau, fmpq)
