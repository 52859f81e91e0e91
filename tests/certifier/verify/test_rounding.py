"""What doubles are wrong by on the way to a vertex, against balls of 600 bits. The bound holds where lengths cancel, too."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from flint import arb, ctx

from certifier.errors import ProofError
from certifier.model import WORLD, Geometry, Joint, JointKind, Pair, Scene
from certifier.proof import limits
from certifier.proof.container import with_scene
from certifier.proof.motion import Motion, MotionProof, Space
from certifier.verify.chains import poses
from certifier.verify.kinematics import exact, rigid, unit
from certifier.verify.motion import verify_motion
from certifier.verify.pieces import Pieces
from certifier.verify.places import Places
from certifier.verify.scene import check_scene
from certifier.verify.sides import Known
from tests.certifier.scenes import box, pose

CASES = 40
LONG_CASES = 4000


def product(A, B):
    return [[sum((A[i][k] * B[k][j] for k in range(4)), arb(0)) for j in range(4)] for i in range(4)]


def rigid_of(X):
    rows = rigid(np.asarray(X, dtype=float).tobytes())
    return [[arb(x / rows[3][3]) for x in row] for row in rows]


def inverse(X):
    R = [[X[j][i] for j in range(3)] for i in range(3)]
    rows = [[*R[i], -sum((R[i][k] * X[k][3] for k in range(3)), arb(0))] for i in range(3)]
    return [*rows, [arb(0), arb(0), arb(0), arb(1)]]


def moved(joint: Joint, q):
    """The joint's motion as a ball, for a position that is a ball: Rodrigues' formula, or the slide."""
    x, y, z = (arb(a) for a in unit(np.asarray(joint.axis, dtype=float).tobytes()))
    X = [[arb(int(i == j)) for j in range(4)] for i in range(4)]
    if joint.kind is JointKind.PRISMATIC:
        for i, a in enumerate((x, y, z)):
            X[i][3] = a * q
        return X
    K = [[arb(0), -z, y], [z, arb(0), -x], [-y, x, arb(0)]]
    for i in range(3):
        for j in range(3):
            X[i][j] += q.sin() * K[i][j] + (1 - q.cos()) * sum((K[i][k] * K[k][j] for k in range(3)), arb(0))
    return X


def world_pose(scene: Scene, body: str, q: list):
    """The pose of a body in the world by the definition of its joints, with nothing of what is tested."""
    X = [[arb(int(i == j)) for j in range(4)] for i in range(4)]
    while body != WORLD:
        joint = scene.joint_above[body]
        own = rigid_of(joint.X_PF)
        if joint.index is not None:
            own = product(own, moved(joint, q[joint.index]))
        X, body = product(product(own, inverse(rigid_of(joint.X_BM))), X), joint.parent
    return X


def turned(rng):
    return pose((0, 0, 0), rng.normal(size=3), rng.uniform(-3, 3))


def adversarial(seed: int):
    """A chain with offsets up to the limit that bring the vertices back to where they began, and a frame and a body of it."""
    rng = np.random.default_rng(seed)
    far = 10.0 ** rng.uniform(-3, 6)
    count, first = int(rng.choice([1, 2, 5, 20, 64])), JointKind.REVOLUTE
    joints, names, n, place = [], [WORLD], 0, np.zeros(3)
    for i in range(count):
        kind = JointKind(rng.choice([JointKind.REVOLUTE, JointKind.PRISMATIC, JointKind.WELD], p=[0.6, 0.2, 0.2])) if i else first
        X_PF, X_BM = turned(rng), turned(rng)
        # Offset by ``far``, and back again by what is left of it, as often as not.
        X_PF[:3, 3] = np.clip(-place + rng.normal(size=3) * 0.1 if rng.random() < 0.7 else rng.uniform(-far, far, 3), -1e6, 1e6)
        X_BM[:3, 3] = rng.uniform(-far, far, 3)
        back = np.linalg.inv(X_BM)
        place = -back[:3, 3] if rng.random() < 0.5 else np.linalg.inv(back[:3, :3]) @ -back[:3, 3]
        moving, axis = kind is not JointKind.WELD, rng.normal(size=3)
        ends = (n, -2.9, 2.9) if kind is JointKind.REVOLUTE else (n, -1e6, 1e6) if moving else (None, None, None)
        axis = axis / np.linalg.norm(axis) if moving else np.zeros(3)
        joints.append(Joint(f"j{i}", kind, names[-1], f"b{i}", axis, X_PF, X_BM, *ends))
        names.append(f"b{i}")
        n += moving
    v = np.clip(joints[-1].X_BM[:3, 3] + rng.normal(size=(3, 3)) * 0.1, -1e6, 1e6)
    shapes = (Geometry("shape", names[-1], v, 0.0, {}), box("wall", WORLD, (1, 1, 1)))
    scene = Scene("adversarial", tuple(joints), tuple(names), shapes, (Pair("shape", "wall"),), (), rng.uniform(-0.1, 0.1, n))
    check_scene(scene)
    frame = names[rng.integers(len(names) - 1)] if rng.random() < 0.5 else WORLD
    return scene, frame, names[-1], v, rng


def still(scene: Scene, space: Space, rng) -> Motion:
    """A motion that rests at a configuration."""
    at = rng.uniform(-1.5, 1.5, scene.n) * np.where(scene.revolute, 1.0, 10.0 ** rng.uniform(-2, 5.5, scene.n))
    if rng.random() < 0.3:
        at *= 0
    return Motion(space, np.array([at, at]))


def wrong_by(seed: int):
    """The largest error of a projection in proportion to its normal, the bound, and what it would be if sums of offsets counted as one."""
    scene, frame, body, v, rng = adversarial(seed)
    space = Space.S if seed % 2 else Space.Q
    motion = still(scene, space, rng)
    pieces, chain, none = Pieces(scene, motion, 0.0), Places(scene).chain(frame, body), np.zeros(1, np.int64)
    R, p = poses([chain], none, none, *pieces.positions(none, np.zeros(1)))
    normal = rng.normal(size=3)
    normal *= rng.uniform(0.51, 1.99) / np.linalg.norm(normal)
    found = [float((R[0].T @ normal) @ vertex + p[0] @ normal) for vertex in v]
    with ctx.workprec(600):
        x = [arb(exact(value)) for value in motion.controls[0]]
        if space is Space.S:
            x = [2 * s.atan() if turns else s for s, turns in zip(x, scene.revolute, strict=True)]
            x = [s + arb(exact(base)) for s, base in zip(x, scene.q_star, strict=True)]
        X = product(inverse(world_pose(scene, frame, x)), world_pose(scene, body, x))
        off = 0.0
        for value, vertex in zip(found, v, strict=True):
            p = [sum((X[i][k] * arb(exact(vertex[k])) for k in range(3)), X[i][3]) for i in range(3)]
            truth = sum((arb(exact(a)) * b for a, b in zip(normal, p, strict=True)), arb(0))
            off = max(off, float(abs(arb(exact(value)) - truth).upper()))
    sides, own = Known(scene).sides(np.array([scene.bodies.index(frame)]), none)  # of the first geometry, whose vertices are v
    side = sides.of(own)
    slid = side.slid(pieces.slid)
    bound = float(side.errors(side.sizes(slid), pieces.inexact)[0])
    tails = np.linalg.norm(v @ chain.rotations[-1].T + chain.offsets[-1], axis=1).max()
    short = tails + np.linalg.norm(chain.offsets[:-1], axis=1).sum() + slid.sum()
    return off / float(np.linalg.norm(normal)), bound, float(side.errors(np.array([short]), pieces.inexact)[0])


def campaign(seeds) -> int:
    """How often an error is more than the bound that puts the last rotation's product and the last offset together first."""
    more = 0
    for seed in seeds:
        off, bound, short = wrong_by(seed)
        assert off <= bound, seed
        more += off > short
    return more


def test_projections_are_wrong_by_no_more_than_the_bound():
    assert campaign(range(CASES)) > 0


@pytest.mark.slow
def test_projections_of_many_chains_are_wrong_by_no_more_than_the_bound():
    print(campaign(range(1000, 1000 + LONG_CASES)))


def far_body(seed: int):
    """A body beside its joint whose frame is up to 1e6 m away; its vertex, its exact x and what the chain's doubles say of it."""
    rng = np.random.default_rng(seed)
    X_BM = turned(rng)
    X_BM[:3, 3] = rng.uniform(-limits.MAGNITUDE, limits.MAGNITUDE, 3)
    v = np.clip(X_BM[:3, 3] + rng.uniform(-0.2, 0.2, 3), -limits.MAGNITUDE, limits.MAGNITUDE)[None]
    joint = Joint("arm/turn", JointKind.REVOLUTE, WORLD, "arm/link", np.array([0.0, 0.0, 1.0]), np.eye(4), X_BM, 0, -1.0, 1.0)
    point = Geometry("arm/link/point", "arm/link", v, 0.0, {})

    def before(wall: float) -> Scene:
        behind = box("wall", WORLD, (4.0, 10.0, 10.0), (wall - 2.0, 0.0, 0.0))
        return Scene("far", (joint,), (WORLD, "arm/link"), (point, behind), (Pair(point.name, "wall"),), (), np.zeros(1))

    scene = before(0.0)
    chain, none = Places(scene).chain(WORLD, "arm/link"), np.zeros(1, np.int64)
    R, p = poses([chain], none, none, np.zeros((1, 1)), np.ones((1, 1)), np.zeros((1, 1)))
    rows = R[0].T @ np.array([1.0, 0.0, 0.0])
    with ctx.workprec(600):
        X = world_pose(scene, "arm/link", [arb(0)])
        true = float(sum((X[0][k] * arb(exact(v[0, k])) for k in range(3)), X[0][3]))
    return before, true, float(rows @ v[0] + p[0, 0])


def far_proofs(seeds) -> Iterator[MotionProof]:
    """Proofs about bodies that overlap: the wall's face is between where the vertex is and where doubles put it."""
    for seed in seeds:
        before, true, computed = far_body(seed)
        if computed - true < 5e-11:
            continue
        scene = before(computed - 0.2 * (computed - true))
        assert scene.geometries[1].vertices[:, 0].max() > true
        one, ends, rest = np.array([[1]], np.int32), np.ones(1), Motion(Space.Q, np.zeros((2, 1)))
        yield MotionProof(scene, rest, 1.0, 0.0, np.zeros(1, np.int32), one, ends, np.array([[1.0, 0.0, 0.0]]))


def far_files() -> Iterator[bytes]:
    """Their files."""
    return (with_scene(proof.to_bytes(), proof.scene) for proof in far_proofs(range(1000)))


def test_bodies_that_overlap_by_what_a_far_frame_rounds_are_not_apart():
    found = 0
    for proof in far_proofs(range(200)):
        found += 1
        with pytest.raises(ProofError, match="does not keep"):
            verify_motion(proof)
    assert found > 10
