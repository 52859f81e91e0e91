"""One volume and one plane on one cell: what is proved is so at dense samples, what is refuted is not so at the point named."""

from __future__ import annotations

from functools import reduce
from math import comb

import numpy as np
import pytest

from certifier.kinematics import Kinematics
from certifier.model import Polytope, Volume
from certifier.partition.area import Area
from certifier.partition.multipliers import PROVED, REFUTED
from certifier.partition.sides import Side, control_matrices, ends_of, prove_side, room_for
from certifier.polytopes.polytope import chebyshev_center
from certifier.polytopes.sampling import hit_and_run
from tests.certifier.scenes import cube, random_tree


def far_apart(kinematics, bodies, rng):
    """Two bodies with at least two joints between them."""
    pairs = [(a, b) for a in bodies for b in bodies if len(kinematics.chain(a, b)) >= 2]
    return pairs[rng.integers(len(pairs))]


@pytest.mark.parametrize("seed", range(6))
def test_control_matrices_are_the_pose_on_the_cell(seed):
    """At t, with s = ((1 - t) w l + t v u)/((1 - t) w + t v), they come to a positive multiple of the pose; w, v = cos(q/2) at the ends."""
    scene, rng = random_tree(seed), np.random.default_rng(seed)
    kinematics = Kinematics(scene)
    frame, body = far_apart(kinematics, scene.bodies, rng)
    area = Area.of(scene, cube(scene, 0.0, 0.5), 0)
    side = Side(area, frame, Volume(("none",), body, np.zeros((1, 3)), 0.0), sorted(kinematics.chain(frame, body)), 1.0, 0.0)
    assert side.own == sorted(kinematics.chain(frame, body))
    lower = rng.uniform(-1.0, 0.0, scene.n)
    upper = lower + rng.uniform(0.1, 1.0, scene.n)
    (X, den), points = control_matrices(side.moving, ends_of(side.moving, lower, upper)), rng.normal(size=(4, 3))
    assert X[:, 3, 3] == pytest.approx(reduce(np.multiply.outer, den, np.ones(())).ravel() * X[0, 3, 3] / den[:, 0].prod())
    for _ in range(10):
        s, basis = rng.uniform(lower, upper), np.ones(1)
        for j in side.own:
            w, v = (1 / np.sqrt(1 + end * end) if scene.revolute[j] else 1.0 for end in (lower[j], upper[j]))
            low, high = w * (s[j] - lower[j]), v * (upper[j] - s[j])
            t = low / (low + high)
            basis = np.kron(basis, [comb(2, i) * t**i * (1 - t) ** (2 - i) for i in range(3)])
        pose = np.einsum("a,aij->ij", basis, X)
        assert pose[3, 3] > 0
        placed = points @ (pose[:3, :3] / pose[3, 3]).T + pose[:3, 3] / pose[3, 3]
        assert placed == pytest.approx(kinematics.points(frame, body, points, s[None])[0], rel=1e-9, abs=1e-9)


class Problem:
    """A body of a random tree with a plane before it, a polytope, and a cell about 0 that the polytope's faces cut."""

    def __init__(self, seed: int) -> None:
        scene, rng = random_tree(seed), np.random.default_rng(seed)
        kinematics = Kinematics(scene)
        frame, body = far_apart(kinematics, scene.bodies, rng)
        Q = np.linalg.qr(rng.normal(size=(scene.n, scene.n)))[0]
        self.polytope = scene.polytope(np.concatenate([Q, -Q]), rng.uniform(0.05, 0.2, 2 * scene.n))
        self.lower, self.upper = -rng.uniform(0.1, 0.4, scene.n), rng.uniform(0.1, 0.4, scene.n)
        # One joint more than those of the body moves the plane, where the scene has one.
        own = kinematics.chain(frame, body)
        self.joints = sorted({*own, int(rng.integers(scene.n))})
        self.radius, self.sign = 0.05, rng.choice([-1.0, 1.0])
        self.vertices = rng.normal(size=(4, 3)) * 0.2
        self.plane = np.zeros((5, 1 + len(self.joints)))
        self.plane[:3, 0] = rng.normal(size=3)
        self.plane[:3, 0] /= np.linalg.norm(self.plane[:3, 0])
        self.plane[:3, 1:] = rng.normal(size=(3, len(self.joints))) * 0.1
        reach = np.maximum(-self.lower, self.upper)[self.joints]
        self.plane[4, 0] = 1 + np.linalg.norm(self.plane[:3, 1:], axis=0) @ reach
        self.points = lambda s: kinematics.points(frame, body, self.vertices, s)
        self.plane[3, 0] = -self.sign * (self.sides(np.zeros((1, scene.n))).min() - rng.uniform(0.0, 0.5))
        area = Area.of(scene, self.polytope, 0)
        self.side = Side(area, frame, Volume(("none",), body, self.vertices, 0.05), self.joints, self.sign, self.radius)

    def sides(self, s):
        """How far the vertices with their balls are on their side, (S, V), in the plane's unit; by einsum on poses."""
        at = np.column_stack([np.ones(len(s)), s[:, self.joints]]) @ self.plane.T
        value = np.einsum("svc,sc->sv", self.points(s), at[:, :3]) + at[:, 3, None]
        return self.sign * value - self.radius * at[:, 4, None]

    def within(self, s):
        """Whether the points (S, n) lie in the polytope and the cell."""
        return self.polytope.contains(s, 1e-9) & (s >= self.lower - 1e-9).all(axis=1) & (s <= self.upper + 1e-9).all(axis=1)

    def samples(self, count):
        eye = np.eye(len(self.lower))
        rows = np.concatenate([self.polytope.C, eye, -eye]), np.concatenate([self.polytope.d, self.upper, -self.lower])
        cell = Polytope(*rows)
        return hit_and_run(cell, chebyshev_center(cell)[0], count, 1)

    def result(self, most, faces=slice(None)):
        """What becomes of the proof, the point where it is refuted, and the multipliers."""
        C, d = self.polytope.C[faces], self.polytope.d[faces]
        proofs, point = room_for(len(self.vertices), most), np.zeros(len(self.lower))
        kind = prove_side(self.side.moving, self.plane, self.lower, self.upper, C, d, np.arange(len(d)), most, proofs, point)
        return kind, point, proofs.multipliers[: proofs.lengths[2]]


def test_what_is_proved_holds_at_samples_and_what_is_refuted_does_not_hold_at_the_point():
    proved = refuted = 0
    for seed in range(40):
        problem = Problem(seed)
        (kind, point, multipliers), samples = problem.result(200), problem.samples(1000)
        if kind == PROVED:
            proved += 1
            assert (problem.sides(samples) > 0).all()
            assert (multipliers > 0).all()
        elif kind == REFUTED:
            refuted += 1
            assert problem.within(point[None]).all()
            assert problem.sides(point[None]).min() < 0
        else:
            assert -1 - kind in problem.joints
    assert proved >= 10
    assert refuted >= 10
    assert proved + refuted >= 37


def test_faces_of_the_polytope_are_what_proves_where_the_cell_alone_is_too_large():
    """Without the faces the same planes are crossed in the cell."""
    needed = 0
    for seed in range(40):
        problem = Problem(seed)
        kind, _, multipliers = problem.result(200)
        if kind == PROVED and len(multipliers):
            needed += problem.result(200, faces=slice(0))[0] != PROVED
    assert needed >= 3


@pytest.mark.slow
def test_with_too_few_pieces_the_answer_is_a_joint():
    few = [Problem(seed).result(1)[0] for seed in range(40)]
    many = [Problem(seed).result(200)[0] for seed in range(40)]
    assert sum(kind < 0 for kind in few) > sum(kind < 0 for kind in many)
    assert not any(a == PROVED and b == REFUTED for a, b in zip(few, many, strict=True))
