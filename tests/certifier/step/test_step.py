"""The polytope step (12): against Clarabel, on the region it proposes, and with its proofs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.solvers import ClarabelSolver, MathematicalProgram

import certifier.conic.arrow
import certifier.step.step as polytope_step
from certifier.conic.basis import basis
from certifier.errors import RegionError
from certifier.kinematics import Kinematics
from certifier.model import WORLD, Box, JointKind, Polytope
from certifier.outcome import Outcome
from certifier.pair.certification import Certification
from certifier.polytopes.ellipsoid import inscribed_ellipsoid
from certifier.proof.pair import PairProof
from certifier.step.face_terms import EPSILON
from certifier.step.identities import IdentityGroups, face_multipliers
from certifier.step.step import step, trust_box
from certifier.verify.pair import verify_pair
from tests.certifier.conic.clarabel import add_rationals
from tests.certifier.scenes import ball, box, cube, planar_arm

SCENES = {
    "revolute": planar_arm(),
    "prismatic": planar_arm(kind=JointKind.PRISMATIC, obstacle=box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (2.9, 0.0, 0.0))),
    "ball": planar_arm(obstacle=ball("world/obstacle", WORLD, 0.2, (1.5, 0.6, 0.0)), padding=0.01),
    "three joints": planar_arm(3),
}
PADDED = SCENES["ball"]
SCENES["pairs padded"] = replace(PADDED, padding=0.5, pairs=tuple(replace(pair, padding=0.01) for pair in PADDED.pairs))


def certified(scene, polytope, box=None):
    shared = Certification(scene, polytope, box=box)
    results = {i: shared.certify(i) for i in range(len(scene.pairs))}
    assert all(result.outcome is Outcome.CERTIFIED for result in results.values())
    return {i: result.proof for i, result in results.items()}


def crosscut(scene, half):
    """A cube with its corners cut off, and the joint limits."""
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * scene.n)).reshape(scene.n, -1).T
    small = cube(scene, 0.0, half)
    rows = len(small.d) - 2 * scene.n
    return scene.polytope(
        np.concatenate([small.C[:rows], signs]), np.concatenate([small.d[:rows], np.full(len(signs), 0.8 * half * scene.n)])
    )


@pytest.mark.parametrize("name", SCENES)
def test_what_the_step_proposes_is_larger_and_certifies(name):
    scene = SCENES[name]
    region = crosscut(scene, 0.05)
    for _ in range(3):
        moved = step(scene, region, certified(scene, region))
        assert moved.growth > 0.05
        before, region = inscribed_ellipsoid(region), moved.polytope
        after = inscribed_ellipsoid(region)
        assert after.volume >= before.volume * (1 + moved.growth) * (1 - 1e-6)
        assert (np.linalg.norm(region.C @ before.shape, axis=1) <= region.d - region.C @ before.center + 1e-9).all()
    final = Certification(scene, region)
    assert all(final.certify(i).outcome is Outcome.CERTIFIED for i in range(len(scene.pairs)))


@settings(max_examples=10, deadline=None)
@given(
    half=st.floats(0.02, 0.12),
    trust=st.floats(1.0, 2.0),
    seed=st.integers(0, 99),
)
def test_the_ellipsoid_and_the_points_to_contain_stay_inside(half, trust, seed):
    scene = SCENES["revolute"]
    region = crosscut(scene, half)
    points = np.random.default_rng(seed).uniform(-half, half, (50, scene.n))
    points = points[region.contains(points)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(polytope_step, "TRUST", trust)
        moved = step(scene, region, certified(scene, region), contain=points)
    ellipsoid = inscribed_ellipsoid(region)
    assert moved.growth > -1e-6
    for share in (0.5, 1.0):
        C, d = (1 - share) * moved.base.C + share * moved.polytope.C, (1 - share) * moved.base.d + share * moved.polytope.d
        assert (points @ C.T <= d + 1e-9).all()
        assert (np.linalg.norm(C @ ellipsoid.shape, axis=1) <= d - C @ ellipsoid.center + 1e-9).all()


def test_a_point_to_contain_that_is_outside_is_refused():
    scene, region = SCENES["revolute"], crosscut(SCENES["revolute"], 0.05)
    with pytest.raises(RegionError) as refusal:
        step(scene, region, certified(scene, region), contain=np.array([[1.0, 1.0]]))
    assert refusal.value.code == "point_outside"


def test_proofs_that_hold_on_the_trust_box_hold_on_the_moved_polytope():
    scene, region = SCENES["revolute"], crosscut(SCENES["revolute"], 0.05)
    box = trust_box(scene, region, inscribed_ellipsoid(region))
    proofs = certified(scene, region, box)
    moved = step(scene, region, proofs)
    assert moved.info["coupled_pairs"] == 0
    corner = np.concatenate([box.upper[:1], box.lower[1:]])
    assert moved.polytope.contains(corner)
    for data in proofs.values():
        proof = PairProof.from_bytes(data, scene)
        verify_pair(proof)
        assert (proof.ground.C @ corner <= proof.ground.d).all()


@pytest.mark.parametrize(
    ("constant", "value", "code", "words"),
    [
        pytest.param(
            "MARGIN_SHARE", 50.0, "step_failed", "no proof holds with room to spare", id="no certificate is feasible on the trust box"
        ),
        pytest.param("MOST_TERMS", 4, "step_too_large", "arm/link2/bar and world/obstacle", id="a pair is too large, and named"),
    ],
)
def test_what_cannot_be_stepped_is_refused(monkeypatch, constant, value, code, words):
    scene, region = SCENES["revolute"], crosscut(SCENES["revolute"], 0.15)
    monkeypatch.setattr(polytope_step, constant, value)
    with pytest.raises(RegionError) as refusal:
        step(scene, region, certified(scene, region))
    assert refusal.value.code == code
    assert words in refusal.value.message


def test_from_where_hardly_any_margin_is_left_it_steps_back_first():
    scene = SCENES["ball"]
    holds, fails = 0.05, 1.0
    while fails - holds > 1e-5:
        half = (holds + fails) / 2
        shared = Certification(scene, crosscut(scene, half))
        if all(shared.certify(i).outcome is Outcome.CERTIFIED for i in range(len(scene.pairs))):
            holds = half
        else:
            fails = half
    region = crosscut(scene, holds)
    moved = step(scene, region, certified(scene, region))
    assert moved.info["from"] < 1.0
    assert moved.growth > 0.1
    assert inscribed_ellipsoid(moved.polytope).volume > inscribed_ellipsoid(region).volume * 1.1


def test_an_exception_of_the_progress_ends_the_step():
    scene, region, said = SCENES["revolute"], crosscut(SCENES["revolute"], 0.15), []

    class Cancelled(Exception):
        pass

    def progress(text):
        said.append(text)
        if "iteration 2" in text:
            raise Cancelled

    with pytest.raises(Cancelled):
        step(scene, region, certified(scene, region), progress=progress)
    assert any("on the trust box" in text for text in said)


def groups_of(scene, region, proofs, box):
    """The groups of all proofs, every face of the region a face of the step."""
    rows = len(region.d) - 2 * scene.n
    eye = np.eye(scene.n)
    faces = Polytope(np.concatenate([region.C[:rows], eye, -eye]), np.concatenate([region.d[:rows], box.upper, -box.lower]))
    ellipsoid = inscribed_ellipsoid(region)
    scale = 0.9 / np.linalg.norm(region.C[:rows] @ ellipsoid.shape, axis=1)
    groups = IdentityGroups(scene, box, ellipsoid, scale, polytope_step.MARGIN_SHARE)
    return [groups.group(proof, face_multipliers(proof, faces, box)) for proof in proofs], ellipsoid, scale


@pytest.mark.parametrize("name", ["revolute", "ball", "pairs padded"])
def test_identities_are_the_polynomials_of_the_proofs(name):
    """alpha_v - r kappa den - t' den - sum_j lambda_j g_j at the points of the chain, from the proof's own numbers."""
    scene, region = SCENES[name], crosscut(SCENES[name], 0.08)
    n, box = scene.n, Box(np.full(scene.n, 0.01), np.full(scene.n, 0.2))
    kinematics, rng = Kinematics(scene), np.random.default_rng(0)
    for data in certified(scene, region).values():
        proof = PairProof.from_bytes(data, scene)
        ((group,), ellipsoid, scale) = groups_of(scene, region, [proof], box)
        v = rng.normal(size=(len(scale), n + 2))
        blocks = iter(group.blocks)
        Y = face_multipliers(proof, Polytope(region.C, region.d), box)
        assert Y.any()
        for body, side, sign in zip(proof.volumes, proof.sides, (1.0, -1.0), strict=True):
            block, chain = next(blocks), list(side.chain)
            constant, local, coupled = block.columns()
            values = constant + local @ group.start + coupled @ v.ravel()[block.coupled]
            space = basis(len(chain), tuple(range(len(chain))))
            u = np.zeros((len(space.points), n))
            u[:, chain] = space.points
            s = box.mid + box.half * u
            X = kinematics.numerators(proof.frame, body.body, s)
            ab = np.column_stack([np.ones(len(u)), (s - proof.ground.mid) / proof.ground.half]) @ proof.plane.T
            g = v[:, n] - (s - ellipsoid.center) @ np.linalg.inv(ellipsoid.shape).T @ v[:, :n].T
            kappa = group.start[-1] if len(group.start) > 4 * (n + 1) else 0.0
            own = ((s - proof.ground.mid) / proof.ground.half)[:, chain]
            rho = np.array([[np.prod(p[np.array(e, dtype=bool)]) for e in np.ndindex(*[2] * len(chain))] for p in own])
            assert len(block) == len(body.vertices)
            for vertex, factors, found in zip(body.vertices, side.factors, values, strict=True):
                expected = sign * np.einsum("ni,ni->n", ab, X @ np.append(vertex, 1.0))
                expected -= ((body.radius + (0.0 if name == "revolute" else 0.01)) * kappa + polytope_step.MARGIN_SHARE * proof.t) * X[
                    :, 3, 3
                ]
                for used, L in zip(Y, factors[1:], strict=True):
                    expected -= np.square(rho @ L).sum(axis=1) * (g @ (used / scale))
                assert found[: len(u)] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("reach", [0.03, 0.09, 0.3])
def test_faces_handed_on_lie_below_those_of_the_proof(reach):
    """g_i >= sum_k Y_ik g_k on the trust box, for faces of a larger polytope and of its box."""
    scene = SCENES["three joints"]
    n, small = scene.n, crosscut(SCENES["three joints"], 0.04)
    box = Box(np.zeros(n), np.full(n, reach))
    proof = PairProof.from_bytes(certified(scene, crosscut(scene, 0.05))[0], scene)
    proof = replace(proof, faces=tuple(range(len(proof.ground.d) + 2 * n)))
    Y = face_multipliers(proof, small, box)
    s = np.random.default_rng(0).uniform(-min(reach, 0.04), min(reach, 0.04), (2000, n))
    u = (s - proof.ground.mid) / proof.ground.half
    own = np.concatenate([(proof.ground.d - s @ proof.ground.C.T), 1 + u, 1 - u], axis=1)
    m = len(small.d) - 2 * n
    assert (Y >= 0).all()
    assert Y.any() == (reach > 0.03)
    # On the polytope within the box; its limits and the box's own faces take what is left over.
    inside = small.contains(s)
    assert inside.sum() > 100
    assert (own[inside] - (small.d[:m] - s[inside] @ small.C[:m].T) @ Y.T > -1e-9).all()


def clarabel(scene, groups, m, cap):
    """The optimum of (12) by Clarabel, every Gram matrix a variable: the sum of the logarithms of the margins."""
    n = scene.n
    program = MathematicalProgram()
    y = program.NewContinuousVariables(m * (n + 2))
    for group in groups:
        z = program.NewContinuousVariables(len(group.start))
        add_rationals(program, group, z, y)
    v = y.reshape(m, n + 2)
    for c, d, delta in zip(v[:, :n], v[:, n], v[:, n + 1], strict=True):
        program.AddLorentzConeConstraint(np.concatenate([[1.0], c]))
        program.AddLorentzConeConstraint(np.concatenate([[d - delta], c]))
    program.AddBoundingBoxConstraint(0, np.inf, v[:, n + 1])
    program.AddBoundingBoxConstraint(-np.inf, cap, v[:, n])
    program.AddMaximizeGeometricMeanCost(np.eye(m), np.full(m, EPSILON), v[:, n + 1])
    result = ClarabelSolver().Solve(program)
    assert result.is_success()
    delta = result.GetSolution(v)[:, n + 1]
    return np.log(delta + EPSILON).sum()


def test_the_optimum_is_clarabels(monkeypatch):
    """Both from the same identities, which another test checks; a barrier of degree nu and weight w ends within nu/w of the optimum."""
    scene, region = SCENES["revolute"], crosscut(SCENES["revolute"], 0.15)
    proofs = certified(scene, region, trust_box(scene, region, inscribed_ellipsoid(region)))
    coupled = {i: data for i, data in proofs.items() if not PairProof.from_bytes(data, scene).needs_box_alone}
    assert coupled
    original, terms, found = polytope_step.Arrow.minimise, polytope_step.face_barrier, {}

    def barrier(n, cap, points):
        found["cap"] = cap
        return terms(n, cap, points)

    def value(delta):
        return np.log(delta + EPSILON).sum()

    def minimise(self, f, tolerance):
        faces = self.y.reshape(-1, scene.n + 2)
        found["start"], found["best"] = value(faces[:, -1]), clarabel(scene, self.groups, len(faces), found["cap"])
        original(self, f, tolerance)
        found["reached"] = value(self.y.reshape(-1, scene.n + 2)[:, -1])
        found["degree"] = sum(len(b) * b.cone.degree for g in self.groups for b in g.blocks) + 6 * len(faces) + len(self.groups)

    monkeypatch.setattr(polytope_step, "face_barrier", barrier)
    monkeypatch.setattr(polytope_step.Arrow, "minimise", minimise)
    monkeypatch.setattr(polytope_step, "WEIGHT", 1e3)
    monkeypatch.setattr(polytope_step, "TOLERANCE", 1e-6)
    monkeypatch.setattr(certifier.conic.arrow, "MAX_ITERATIONS", 500)
    step(scene, region, coupled)
    allowed = found["degree"] / 1e3 + 0.01
    assert found["best"] - found["start"] > 10 * allowed
    assert found["best"] - allowed < found["reached"] < found["best"] + 1e-3
