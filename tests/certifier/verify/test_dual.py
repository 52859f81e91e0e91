"""What a dual proof may state, and dual proofs by a dishonest hand."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
from flint import arb, fmpq
from hypothesis import assume, example, given
from hypothesis import strategies as st

from certifier.conic.cone import Centre, Cone, Weights
from certifier.conic.interior_point import Block, Status, solve
from certifier.errors import ProofError
from certifier.kinematics import Kinematics
from certifier.model import WORLD, Array, Box, Joint, JointKind, Pair, Scene, Volume
from certifier.outcome import Outcome
from certifier.pair import program
from certifier.pair.certification import Certification
from certifier.pair.frames import choose_frame
from certifier.pair.primal import pair_proof
from certifier.polytopes.sampling import hit_and_run
from certifier.proof.container import with_scene
from certifier.proof.ground import Ground
from certifier.proof.negative import DualProof
from certifier.proof.pair import PairProof
from certifier.verify.dual import _enclosed, _near_one, verify_dual
from certifier.verify.file import verify_file
from certifier.verify.moments import table
from certifier.verify.pair import verify_pair
from tests.certifier.proofs import dual
from tests.certifier.scenes import ball, box, cube, planar_arm, pose

LOWER, UPPER = np.array([-0.8, -0.6]), np.array([1.25, 0.9])


def rejected(proof: DualProof, code: str) -> None:
    with pytest.raises(ProofError) as refusal:
        verify_dual(proof)
    assert refusal.value.code == code, refusal.value


# Two checks that bound the normal differently.


@cache
def spheres() -> Scene:
    """Two joints, one ball in the world and one on the second link."""
    base, axis = planar_arm(2), np.array([0.4, 0.3, -0.9])
    block, tip = ball("world/ball", WORLD, 0.51, (-1.5, -1.1, 0.25)), ball("arm/link2/ball", "arm/link2", 0.51, (-0.45, 1.15, 0.4))
    joints = (base.joints[0], replace(base.joints[1], axis=axis / np.linalg.norm(axis)))
    return replace(base, joints=joints, geometries=(block, tip), pairs=(Pair(tip.name, block.name),))


@cache
def whole() -> tuple[DualProof, Ground]:
    """No certificate with the norm bounded by the matrix inequality between the spheres."""
    eye = np.eye(2)
    shared = Certification(spheres(), spheres().polytope(np.concatenate([eye, -eye]), np.concatenate([UPPER, -LOWER])))
    result = shared.certify(0)
    assert result.outcome is Outcome.NOT_CERTIFIABLE
    return DualProof.from_bytes(result.proof, spheres()), shared.ground


def corner_blocks(n: int, u_c: Array) -> list[Block]:
    """|a| <= kappa at the corners of the box instead of the matrix inequality: [[kappa I, a], [a', kappa]] psd at each."""
    columns = program._columns(n, rounded=True)
    matrices = np.zeros((2**n, columns, 4, 4))
    for matrix, corner in zip(matrices, itertools.product((-1.0, 1.0), repeat=n), strict=True):
        for component, e in itertools.product(range(3), range(n + 1)):
            value = 1.0 if e == 0 else corner[e - 1] - u_c[e - 1]
            matrix[component * (n + 1) + e, component, 3] = matrix[component * (n + 1) + e, 3, component] = value
        matrix[4 * (n + 1)] = np.eye(4)
    rows, cols = np.tril_indices(4)
    points = np.eye(4)[rows] + np.where((rows == cols)[:, None], 0.0, np.eye(4)[cols])
    products = (points[:, :, None] * points[:, None, :]).reshape(len(points), -1)
    cone = Cone(len(points), Weights(points, np.ones((1, len(points))), np.zeros((1, 0))))
    centre = Centre(cone, products @ np.eye(4).ravel(), np.linalg.solve(products[:, rows * 4 + cols].T, np.eye(4)[rows, cols]))
    B = np.einsum("ni,cpij,nj->cnp", points, matrices, points)
    B[:, :, -1] = -centre.w
    # The multipliers tau of the matrix inequality stay among the unknowns, and positive.
    line = Cone(1, Weights(np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 0))))
    tau = np.zeros((n, 1, columns))
    tau[np.arange(n), 0, 4 * (n + 1) + 1 + np.arange(n)] = 1.0
    tau[:, 0, -1] = -1.0
    return [Block(cone, B, centre), Block(line, tau, Centre(line, np.ones(1), np.ones(1)))]


@cache
def certificate_with_corners() -> PairProof:
    """A certificate of the spheres on the very ground of their dual proof, its normal bounded at the box's corners."""
    proof, ground = whole()
    volumes = tuple(Volume.of(spheres().geometry(name)) for name in (proof.pair.a, proof.pair.b))
    kinematics, center = Kinematics.of(spheres()), (LOWER + UPPER) / 2
    frame = choose_frame(kinematics, volumes)
    faces = spheres().polytope(ground.C, ground.d)
    samples = hit_and_run(faces, center, 300, 0)
    chosen = tuple(range(len(ground.d)))
    polytope = type(faces)(ground.C, ground.d)
    sides = program.Sides(kinematics, polytope, Box(ground.mid, ground.half), (0, 1), chosen, center, samples)
    sides.__dict__["norm_blocks"] = corner_blocks(2, sides.u_c)
    solution = solve(program.build(sides, volumes, frame))
    assert solution.status is Status.FEASIBLE
    found = pair_proof(sides, volumes, frame, ground, solution, "int32")
    assert found.frame == proof.frame
    return found


def test_a_dual_proof_does_not_deny_a_plane_that_a_pair_proof_states():
    """Both hold, on the same polytope in the same frame: the matrix inequality admits fewer normals than the box's corners."""
    proof, _ = whole()
    assert verify_dual(proof).rounded
    assert verify_pair(certificate_with_corners()).gap > 1e-3
    text = "\n".join(verify_file(with_scene(proof.to_bytes(), spheres())).lines)
    assert "no plane affine in s" not in text
    assert "does not mean that no plane separates them" in text
    assert "a normal bounded by the matrix inequality" in text


def test_the_statement_names_the_faces_that_it_is_about():
    proof, ground = whole()
    text = "\n".join(verify_file(with_scene(proof.to_bytes(), spheres())).lines)
    for joint, mid, half in zip(spheres().moving, ground.mid.tolist(), ground.half.tolist(), strict=True):
        assert f"'{joint.name}': s from {mid!r} - {half!r} to {mid!r} + {half!r}" in text


def test_without_a_radius_the_normal_is_not_mentioned():
    world, proof = dual()
    tip = box("arm/link2/tip", "arm/link2", (0.1, 0.1, 0.1), (1.0, 0.0, 0.0))
    angular = replace(world, geometries=(*world.geometries[:-1], tip))
    data = Certification(angular, cube(angular, 0.0, 0.64), np.zeros(2)).certify(world.pairs.index(proof.pair)).proof
    assert not verify_dual(DualProof.from_bytes(data, angular)).rounded
    text = "\n".join(verify_file(with_scene(data, angular)).lines)
    assert "no certificate" in text
    assert "matrix inequality" not in text


# A box beyond the joint limits.


def test_a_box_beyond_the_joint_limits_is_refused():
    """Within narrow limits the pair is certifiable; on the faces of a box far beyond them, which say less, it would not be."""
    world, proof = dual()
    narrow = replace(world, joints=tuple(replace(joint, lower=-0.04, upper=0.04) for joint in world.joints))
    assert Certification(narrow, cube(narrow, 0.0, 1.0)).certify(world.pairs.index(proof.pair)).outcome is Outcome.CERTIFIED
    eye = np.eye(2)
    none = np.zeros((2, 2))
    limits = {"Y_upper": np.hstack([eye, none]), "Y_lower": np.hstack([none, eye])}
    ground = replace(proof.ground, C=np.zeros((0, 2)), d=np.zeros(0), **limits)
    rejected(replace(proof, scene=narrow, ground=ground), "proof_box")


def test_the_certifiers_boxes_reach_no_farther_than_rounding():
    """Neither where the polytope is all of the joint limits, nor where a trust box is."""
    joints = zip(spheres().joints, 2 * np.arctan(LOWER), 2 * np.arctan(UPPER), strict=True)
    limited = replace(spheres(), joints=tuple(replace(joint, lower=float(low), upper=float(high)) for joint, low, high in joints))
    limits = limited.polytope(np.zeros((0, 2)), np.zeros(0))
    inside = limited.polytope(np.eye(2), UPPER * 0.99)
    for shared in (Certification(limited, limits), Certification(limited, inside, box=Box.around(limited.s_lower, limited.s_upper))):
        result = shared.certify(0)
        assert result.outcome is Outcome.NOT_CERTIFIABLE, result
        assert "no certificate" in result.detail


# Numbers out of the range in which doubles are rounded relatively.

THETA = 0.95
"""Where the joints that are added stand, in the coordinates of their box."""
REACH = 0.49


def hostile(added: int, normal: float, first: float, offset: float, scale: float) -> tuple[DualProof, float]:
    """The spheres' dual proof with sliding joints added that concern no body, and a face that cuts off what makes the pair fail.

    The joints slide in [-REACH, REACH] and a face each keeps them above 0.9 of it. The functionals take them to be at THETA; that face,
    ``first`` s_0 + ``normal`` sum_l s_l <= offset, they do not meet by far, but its coefficients, or products of them, underflow.
    Moments and all that is homogeneous in them are multiplied by ``scale``.

    Returns:
        the proof, and how far the first joint can go within the faces.
    """
    proof, ground = whole()
    n = 2 + added
    bodies = tuple(f"slide{i}" for i in range(added))
    slides = tuple(
        Joint(f"slide{i}", JointKind.PRISMATIC, WORLD, body, np.array([1.0, 0.0, 0.0]), pose(), pose(), 2 + i, -REACH, REACH)
        for i, body in enumerate(bodies)
    )
    base = spheres()
    scene = replace(base, joints=(*base.joints, *slides), bodies=(*base.bodies, *bodies), q_star=np.zeros(n))
    eye = np.eye(n)
    cut = np.array([first, 0.0, *[normal] * added])
    C = np.vstack([np.pad(ground.C, ((0, 0), (0, added))), -eye[2:], cut])
    d = np.concatenate([ground.d, np.full(added, -0.9 * REACH), [offset]])
    mid, half = (np.concatenate([x, np.full(added, y)]) for x, y in ((ground.mid, 0.0), (ground.half, REACH * (1 + 1e-12))))
    limited = scene.polytope(C, d)
    rows = {row.tobytes(): j for j, row in enumerate(limited.C[: len(C)] + 0.0)} | {
        row.tobytes(): len(C) + j for j, row in enumerate(limited.C[len(C) :] + 0.0) if j % n >= 2
    }
    Y_upper, Y_lower = (np.eye(len(limited.d))[[rows[row.tobytes()] for row in sign * eye + 0.0]] for sign in (1.0, -1.0))
    moments = []
    for held, joint in zip(proof.moments, (1, 0), strict=True):
        grid = held[:, table((joint,), 2)[0]]
        moments.append(np.hstack([held] + [THETA * grid] * added) * scale)
    at = np.concatenate([np.eye(3), np.tile(THETA * np.eye(3)[:1], (added, 1))])
    aa, bb = proof.normal
    lifted = at @ bb @ at.T
    lifted[np.arange(3, n + 1), np.arange(3, n + 1)] = bb[0, 0]
    equations = tuple(k // 3 * (n + 1) + k % 3 for k in proof.equations)
    changed = replace(
        proof,
        scene=scene,
        ground=Ground(C, d, mid, half, Y_lower, Y_upper),
        interior=np.array([ground.mid[0] - 0.9 * ground.half[0], ground.mid[1], *[0.9 * REACH] * added]),
        moments=(moments[0], moments[1]),
        equations=equations,
        normal=(aa * scale, (lifted + lifted.T) / 2 * scale),
    )
    least = -0.9 * REACH * added
    return changed, (offset + normal * least) / first


def test_the_joints_added_change_nothing_without_the_face():
    """What the two tests below rest on: the functionals are right but for that one face."""
    proof, _ = hostile(3, 1.0, 1.0, 10.0, 1.0)
    verify_dual(proof)
    rejected(hostile(3, 1.0, 1.0, 1.0, 1.0)[0], "proof_dual")


@pytest.mark.parametrize("way", ["the coefficients", "the products with the moments"])
def test_underflow_hides_no_face_that_is_not_met(way):
    """On the faces the pair is certifiable, whatever the scale of one of them."""
    quantum = 2.0**-1074
    if way == "the coefficients":
        arguments, factor = (4, quantum, quantum, 2 * quantum, 2.0**300), 2.0**1000
    else:
        mass = max(float(m[:, 0].max()) for m in whole()[0].moments)
        unit = 2.0**-600 / mass
        arguments, factor = (18, unit, 0.45 * unit, 8 * unit, 2.0**-474), 2.0**600
    proof, end = hostile(*arguments)
    scene, ground = proof.scene, proof.ground
    C, d = ground.C.copy(), ground.d.copy()
    C[-1], d[-1] = C[-1] * factor, d[-1] * factor
    assert end < 0.5
    assert Certification(scene, scene.polytope(C, d)).certify(0).outcome is Outcome.CERTIFIED
    rejected(proof, "proof_dual")


doubles = st.builds(math.ldexp, st.floats(-1, 1), st.integers(-1074, 300))


@given(st.lists(doubles, min_size=5, max_size=5), st.lists(doubles, min_size=13, max_size=13), doubles)
@example([0.0, 0.0, 0.0, 0.6015625, 2.0**-39], [0.0] * 12 + [1.0], 0.9290953423597124)
@example([0.0, 0.0, 0.0, 0.0, 1.0], [0.0] * 12 + [2.0**-725], 2.0**300)
def test_no_rounding_no_underflow_and_no_change_exceeds_its_bound(face, held, change):
    """Localised moments as the verifier computes them against exact fractions, whatever the sizes of the numbers."""
    assume(any(face) and any(held))
    index = table((1,), 4)
    near = _near_one([fmpq(*x.as_integer_ratio()) for x in face])
    values, errors = _enclosed(np.array([held]), np.array([near]), (1,), arb(abs(change)))
    powers = Fraction(max(near, key=abs)) / Fraction(max(face, key=abs)) / Fraction(2) ** math.frexp(max(map(abs, held)))[1]
    most = sum(abs(Fraction(w)) for w in face) * abs(Fraction(change))
    for value, error, row in zip(values[0, 0], errors[0, 0], index.T, strict=True):
        exact = sum(Fraction(w) * Fraction(held[i]) for w, i in zip(face, row, strict=True))
        for changed in (exact - most, exact + most):
            assert error == np.inf or abs(Fraction(value) - changed * powers) <= Fraction(error)


@pytest.mark.parametrize(("moments", "faces"), list(itertools.product((-200, 300), repeat=2)))
def test_powers_of_two_change_nothing(moments, faces):
    """Neither of all moments nor of a face, as long as the numbers of the proof are not rounded themselves."""
    proof, ground = whole()
    weights = np.array([2.0**-faces] * len(ground.d) + [1.0] * 4)
    scaled = replace(
        proof,
        ground=replace(
            ground,
            C=ground.C * 2.0**faces,
            d=ground.d * 2.0**faces,
            Y_lower=ground.Y_lower * weights,
            Y_upper=ground.Y_upper * weights,
        ),
        moments=tuple(m * 2.0**moments for m in proof.moments),
        normal=tuple(m * 2.0**moments for m in proof.normal),
    )
    assert verify_dual(scaled).slack == verify_dual(proof).slack
