"""The verifier's polynomials against exact fractions: positions multiplied out point by point, residuals expanded term by term."""

from __future__ import annotations

import itertools
import math
from collections import defaultdict
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from flint import Ordering, fmpq_mpoly_ctx

from certifier.model import WORLD, JointKind, Volume
from certifier.proof.pair import Side
from certifier.verify.kinematics import ExactKinematics, exact, half_tangent
from certifier.verify.residual import POSITION_BITS, Numerators, largest_residual
from tests.certifier.scenes import planar_arm, random_tree


def exact_kinematics(scene, mid, half):
    ring = fmpq_mpoly_ctx.get([f"u{i}" for i in range(scene.n)], Ordering.lex)
    return ExactKinematics.on_box(scene, ring, mid, half)


def fraction(x):
    return Fraction(int(x.p), int(x.q))


def matrix(X):
    return [[Fraction(float(x)) for x in row] for row in X]


def multiply(A, B):
    return [[sum(A[i][k] * B[k][j] for k in range(4)) for j in range(4)] for i in range(4)]


def inverse(X):
    rotation = [[X[j][i] for j in range(3)] for i in range(3)]
    return [[*row, -sum(r * X[k][3] for k, r in enumerate(row))] for row in rotation] + [[Fraction(0)] * 3 + [Fraction(1)]]


def turn(axis, tangent):
    """Rotation about the axis by twice the arc tangent (Rodrigues)."""
    x, y, z = axis
    skew = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    square = [[sum(skew[i][k] * skew[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
    sine, versine = 2 * tangent / (1 + tangent**2), 2 * tangent**2 / (1 + tangent**2)
    rows = [[Fraction(int(i == j)) + sine * skew[i][j] + versine * square[i][j] for j in range(3)] + [Fraction(0)] for i in range(3)]
    return [*rows, [Fraction(0)] * 3 + [Fraction(1)]]


def position(scene, kinematics, frame, body, s):
    """X_FB at the rational point s, and its denominator: joint after joint, first to q*, then by s."""
    X, den = matrix(np.eye(4)), Fraction(1)
    for joint, upwards in kinematics.path(frame, body):
        step = matrix(joint.X_PF)
        if joint.index is not None:
            axis, tau = [Fraction(float(x)) for x in joint.axis], fraction(half_tangent(float(scene.q_star[joint.index])))
            if joint.kind is JointKind.PRISMATIC:
                slide = matrix(np.eye(4))
                for i in range(3):
                    slide[i][3] = axis[i] * (s[joint.index] + Fraction(float(scene.q_star[joint.index])))
                step = multiply(step, slide)
            else:
                step = multiply(multiply(step, turn(axis, tau)), turn(axis, s[joint.index]))
                den *= (1 + tau**2) * (1 + s[joint.index] ** 2)
        step = multiply(step, inverse(matrix(joint.X_BM)))
        X = multiply(X, inverse(step) if upwards else step)
    return X, den


def chains():
    """Scenes whose fixed frames are exact rotations and whose axes are exact unit vectors."""
    quarter = np.array([[0.0, -1, 0, 0.25], [1, 0, 0, -0.5], [0, 0, 1, 2.0], [0, 0, 0, 1]])
    for seed in range(3):
        tree = random_tree(seed)
        rng = np.random.default_rng(seed)
        joints = []
        for joint in tree.joints:
            frames = [np.linalg.matrix_power(quarter, int(rng.integers(4))) for _ in range(2)]
            axis = joint.axis if joint.index is None else np.roll([0.0, 0.0, -1.0], rng.integers(3))
            joints.append(replace(joint, axis=axis, X_PF=frames[0], X_BM=frames[1]))
        yield replace(tree, joints=tuple(joints))


def value(polynomial, u):
    """A polynomial at the point u."""
    terms = polynomial.to_dict().items()
    return sum(fraction(c) * math.prod(x ** int(e) for x, e in zip(u, powers, strict=True)) for powers, c in terms)


@pytest.mark.parametrize("scene", list(chains()))
def test_positions_are_those_of_exact_fractions(scene):
    mid, half = np.linspace(-0.3, 0.4, scene.n), np.linspace(0.1, 0.7, scene.n)
    kinematics = exact_kinematics(scene, mid, half)
    u = [Fraction(2 * i - 3, 7) for i in range(scene.n)]
    s = [Fraction(m) + Fraction(h) * x for m, h, x in zip(mid.tolist(), half.tolist(), u, strict=True)]
    for frame, body in itertools.product(scene.bodies, repeat=2):
        X, den = position(scene, kinematics, frame, body, s)
        _, least = position(scene, kinematics, frame, body, [Fraction(0)] * scene.n)
        numerators = [[value(entry, u) for entry in row] for row in kinematics.pose(frame, body)]
        for i, j in itertools.product(range(4), repeat=2):
            assert numerators[i][j] == X[i][j] * numerators[3][3]
        assert numerators[3][3] * least == den * fraction(kinematics.scale(frame, body))


def expanded(scene, volume, side, frame, mid, half, plane, weights):
    """sum of |coefficients| of e_v, for every vertex: polynomials as dictionaries of fractions."""
    n = scene.n
    kinematics = exact_kinematics(scene, mid, half)
    sigma = fraction(kinematics.scale(frame, volume.body))
    X = [[{p: fraction(c) / sigma for p, c in entry.to_dict().items()} for entry in row] for row in kinematics.pose(frame, volume.body)]

    def times(p, q):
        product = defaultdict(Fraction)
        for (a, x), (b, y) in itertools.product(p.items(), q.items()):
            product[tuple(i + j for i, j in zip(a, b, strict=True))] += x * y
        return product

    def affine(coefficients):
        return {tuple(int(i == j - 1) for i in range(n)): fraction(c) for j, c in enumerate(coefficients)}

    subsets = list(itertools.product(range(2), repeat=len(side.chain)))
    sums = []
    for v, vertex in enumerate(volume.vertices):
        e = defaultdict(Fraction)
        for i in range(4):
            for c, x in enumerate([*vertex, 1.0]):
                for powers, value in times(affine(plane[i]), X[i][c]).items():
                    e[powers] += Fraction(float(x)) * value
        for j, weight in enumerate(weights):
            factor = np.zeros((len(subsets), len(subsets)), dtype=object)
            factor[np.tril_indices(len(subsets))] = [int(x) for x in side.mantissa[v, j]]
            for column in factor.T:
                linear = {}
                for subset, x in zip(subsets, column, strict=True):
                    powers = [0] * n
                    for joint, member in zip(side.chain, subset, strict=True):
                        powers[joint] = member
                    linear[tuple(powers)] = x * Fraction(2) ** int(side.exponent[j])
                for powers, value in times(affine(weight), times(linear, linear)).items():
                    e[powers] -= value
        sums.append(sum(map(abs, e.values())))
    return sums


@pytest.mark.parametrize("kind", ["int32", "int64"])
@pytest.mark.parametrize("links", [1, 2, 3])
def test_the_bound_of_the_residual_is_the_sum_of_its_coefficients(links, kind):
    """For factors and planes that prove nothing: the bound is mere arithmetic. It exceeds the sum by the rounding of positions only."""
    rng = np.random.default_rng(links)
    scene = planar_arm(links, q_star=rng.uniform(-1, 1, links))
    chain = tuple(range(links))
    volume = Volume.of(scene.geometries[links - 1])
    volume = replace(volume, vertices=volume.vertices[:2] + rng.normal(size=(2, 3)))
    L, f = 2**links, 3
    factor = np.tril(rng.normal(size=(2, f + 1, L, L))) * 10.0 ** rng.integers(-3, 3, (1, f + 1, 1, 1))
    side = Side.rounded(chain, factor, kind)
    mid, half = rng.uniform(-0.5, 0.5, links), rng.uniform(0.1, 1, links)
    plane = [[exact(x) for x in row] for row in rng.normal(size=(4, links + 1))]
    weights = [[exact(x) for x in row] for row in rng.normal(size=(f + 1, links + 1))]
    numerators = Numerators.between(exact_kinematics(scene, mid, half), WORLD, volume.body)
    bound = fraction(largest_residual(numerators, volume, side, plane, weights))
    exactly = max(expanded(scene, volume, side, WORLD, mid, half, plane, weights))
    assert exactly <= bound
    assert bound - exactly < 1e4 * Fraction(2) ** -POSITION_BITS
