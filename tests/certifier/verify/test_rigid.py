"""The verifier's poses are exactly rigid, and inverse to one another, although the doubles of a model are neither."""

from __future__ import annotations

import itertools
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st

from certifier.errors import ProofError
from certifier.kinematics import rotation
from certifier.model import WORLD, JointKind
from certifier.verify.kinematics import ExactKinematics, rigid, unit
from certifier.verify.scene import RIGID, check_scene
from tests.certifier.scenes import random_tree


def multiply(A, B):
    return [[sum((A[i][k] * B[k][j] for k in range(len(B))), fmpq(0)) for j in range(len(B[0]))] for i in range(len(A))]


def scaled(X):
    """A pose without its denominator."""
    return [[x / X[3][3] for x in row] for row in X]


IDENTITY = [[fmpq(int(i == j)) for j in range(4)] for i in range(4)]


def rough(scene, rng, size):
    """The scene with numbers of frames and axes that are off by this much."""
    joints = []
    for joint in scene.joints:
        frames = [X.copy() for X in (joint.X_PF, joint.X_BM)]
        for X in frames:
            X[:3, :3] += rng.uniform(-size, size, (3, 3))
        axis = joint.axis + (size * rng.uniform(-1, 1, 3) if joint.index is not None else 0)
        joints.append(replace(joint, axis=axis, X_PF=frames[0], X_BM=frames[1]))
    return replace(scene, joints=tuple(joints))


@pytest.mark.parametrize("size", [0.0, RIGID / 10])
@pytest.mark.parametrize("seed", range(3))
def test_every_pose_is_a_rigid_motion_and_the_inverse_of_the_one_back(seed, size):
    """A rotation that is one to rounding, or to the tolerance of the model, stretches nothing, whichever way it is crossed."""
    rng = np.random.default_rng(seed)
    scene = rough(random_tree(seed), rng, size)
    check_scene(scene)
    kinematics = ExactKinematics.at(scene, [fmpq(2 * i - 3, 7) for i in range(scene.n)])
    for a, b in itertools.combinations(scene.bodies, 2):
        there, back = scaled(kinematics.pose(a, b)), scaled(kinematics.pose(b, a))
        assert multiply(there, back) == IDENTITY
        R = [row[:3] for row in there[:3]]
        assert multiply(list(zip(*R, strict=True)), R) == [row[:3] for row in IDENTITY[:3]]


@pytest.mark.parametrize("seed", range(3))
def test_poses_compose_exactly(seed):
    scene = random_tree(seed)
    kinematics = ExactKinematics.at(scene, [fmpq(i + 1, 5) for i in range(scene.n)])
    for a, b in itertools.product(scene.bodies, repeat=2):
        way = multiply(scaled(kinematics.pose(a, WORLD)), scaled(kinematics.pose(WORLD, b)))
        assert way == scaled(kinematics.pose(a, b))


numbers = st.floats(-1, 1)
vectors = st.tuples(numbers, numbers, numbers).map(np.array).filter(lambda v: np.linalg.norm(v) > 1e-3)


@given(vectors, st.floats(-7, 7), st.lists(st.floats(-1, 1), min_size=9, max_size=9), st.sampled_from([0.0, 1e-12, RIGID / 10]))
def test_a_matrix_stands_for_a_rotation_nearby(axis, angle, noise, size):
    R = rotation(axis / np.linalg.norm(axis), angle) + size * np.reshape(noise, (3, 3))
    X = np.eye(4)
    X[:3, :3] = R
    stands_for = np.array([[float(x) for x in row[:3]] for row in scaled(rigid(X.tobytes()))[:3]])
    assert np.abs(stands_for - R).max() <= 10 * np.abs(R.T @ R - np.eye(3)).max() + 1e-15


@given(vectors, st.sampled_from([0.0, 1e-12, RIGID / 2]))
def test_an_axis_stands_for_a_unit_vector_nearby(axis, size):
    axis = axis / np.linalg.norm(axis) * (1 + size)
    found, back = unit(axis.tobytes()), unit((-axis).tobytes())
    assert sum(x * x for x in found) == 1
    assert np.abs([float(x) for x in found] - axis).max() <= 10 * size + 1e-15
    assert max(abs(float(x + y)) for x, y in zip(found, back, strict=True)) <= 2.0**-58


def test_exact_rotations_and_axes_stand_for_themselves():
    """Permutations with signs and unit vectors along an axis; others but for rounding."""
    for order, signs in itertools.product(itertools.permutations(range(3)), itertools.product((1.0, -1.0), repeat=3)):
        X = np.eye(4)
        X[:3, :3] = np.diag(signs)[list(order)]
        X[:3, 3] = (0.1, -2.0, 3e-20)
        if np.linalg.det(X) > 0:
            expected = [[fmpq(*float(x).as_integer_ratio()) for x in row] for row in X]
            assert scaled(rigid(X.tobytes())) == expected
    for axis in (*np.eye(3), *-np.eye(3), np.array([0.6, 0.0, 0.8])):
        found = [Fraction(int(x.p), int(x.q)) for x in unit(axis.tobytes())]
        assert max(abs(a - Fraction(b)) for a, b in zip(found, axis.tolist(), strict=True)) < Fraction(2) ** -52


def test_what_is_no_rotation_at_all_is_refused():
    scene = random_tree(0)
    index = next(i for i, joint in enumerate(scene.joints) if joint.kind is JointKind.REVOLUTE)
    stretched = scene.joints[index].X_PF.copy()
    stretched[:3, :3] *= 1 + RIGID
    joints = (*scene.joints[:index], replace(scene.joints[index], X_PF=stretched), *scene.joints[index + 1 :])
    with pytest.raises(ProofError):
        check_scene(replace(scene, joints=joints))
