"""``python -m tests.certifier.verify.worst``: files as dear to check as the limits let them be, with what each took.

Most of them hold until their last step, so that every step before it is taken.
"""

from __future__ import annotations

import itertools
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from certifier.isolation.child import run_in_child
from certifier.model import WORLD, Geometry, Joint, JointKind, Pair, Scene, Volume
from certifier.proof import limits
from certifier.proof.container import pack, unpack, with_scene
from certifier.proof.ground import Ground
from certifier.proof.motion import Motion, MotionProof, Space
from certifier.proof.negative import DualProof
from certifier.proof.pair import PairProof, Side
from certifier.verify.kinematics import ExactKinematics
from certifier.verify.moments import monomials
from tests.certifier.proofs import region
from tests.certifier.scenes import ball, pose
from tests.certifier.verify.hostile import fitting, members, zipped


def valid() -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    return unpack(region(), "region")


def stored(header: dict[str, Any], arrays: dict[str, np.ndarray]) -> bytes:
    """The file without compression, which would make it too small for what it unpacks to."""
    return zipped(members(pack(header, arrays)))


def header_of_nothing() -> bytes:
    """A header full of empty lists."""
    header, arrays = valid()
    header["scene"]["provenance"] = {"a": [[]] * 4_100_000}
    return stored(header, arrays)


def header_of_numbers() -> bytes:
    """Vertices, with as many digits as a double has."""
    header, arrays = valid()
    scene, rng = header["scene"], np.random.default_rng(0)
    shape = {**scene["geometries"][0], "body": WORLD}
    many = [{**shape, "name": f"more/{i}", "vertices": rng.normal(size=(limits.VERTICES, 3)).tolist()} for i in range(62)]
    scene["geometries"] += many
    return pack(fitting(header), arrays)


def pairs_and_reasons() -> bytes:
    header, arrays = valid()
    names = [geometry["name"] for geometry in header["scene"]["geometries"]]
    pairs = list(itertools.islice(itertools.cycle(itertools.permutations(names, 2)), limits.PAIRS))
    header["scene"]["ignored"] = [{"pair": list(pair), "reason": "x" * 400} for pair in pairs]
    return stored(fitting(header), arrays)


def geometries_and_pairs() -> bytes:
    """As many bodies, geometries and pairs as there may be; no proof covers the last pair."""
    header, arrays = valid()
    scene = header["scene"]
    weld = {**scene["joints"][0], "kind": "weld", "index": None, "lower": None, "upper": None}
    count = limits.JOINTS - len(scene["joints"])
    scene["joints"] += [{**weld, "name": f"w{i}", "parent": WORLD if i % 64 == 0 else f"b{i - 1}", "child": f"b{i}"} for i in range(count)]
    scene["bodies"] += [f"b{i}" for i in range(count)]
    one = {**scene["geometries"][0], "vertices": [[0, 0, 9]], "shape": {}}
    scene["geometries"] += [{**one, "name": f"g{i}", "body": f"b{i % count}"} for i in range(limits.GEOMETRIES - len(scene["geometries"]))]
    scene["pairs"] += [["g0", f"g{i + 1}"] for i in range(limits.PAIRS - len(scene["pairs"]))]
    return pack(fitting(header), arrays)


def proofs() -> bytes:
    """One proof over and over, on its own ground as often as there may be grounds."""
    header, arrays = valid()
    for i in range(len(header["proofs"]), limits.PROOFS):
        ground = 2 + i if 2 + i < limits.GROUNDS else 0
        header["proofs"].append({**header["proofs"][0], "ground": ground})
        for name in ("plane", "scalars", "mantissa0", "mantissa1", "exponent0", "exponent1"):
            arrays[f"proof/{i}/{name}"] = arrays[f"proof/0/{name}"]
        if ground:
            arrays |= {f"ground/{ground}/{name}": arrays[f"ground/0/{name}"] for name in ("C", "d", "mid", "half", "Y_lower", "Y_upper")}
    used = sorted({proof["ground"] for proof in header["proofs"]})
    header["grounds"] = len(used)
    renumbered = {old: new for new, old in enumerate(used)}
    for proof in header["proofs"]:
        proof["ground"] = renumbered[proof["ground"]]
    grounds = {name: array for name, array in arrays.items() if name.startswith("ground/")}
    rest = {name: array for name, array in arrays.items() if name not in grounds}
    return pack(header, rest | {f"ground/{renumbered[int(n.split('/')[1])]}/{n.split('/')[2]}": a for n, a in grounds.items()})


def unpacked_bytes() -> bytes:
    """Arrays of as many bytes as a file may have, in members as large as can be."""
    header, arrays = valid()
    half = np.random.default_rng(0).normal(size=(limits.UNPACKED_BYTES - (1 << 20)) // 16)
    return pack(header, {**arrays, "implied/Y": half, "zz": half})


def chain(moving: int, welds: int, tiny: float) -> Scene:
    """An arm of ``moving`` joints behind welds and a body behind as many joints, with frames of full mantissas and the tiniest numbers."""
    joints, bodies, rng = [], [WORLD], np.random.default_rng(0)
    for side, count in (("a", moving), ("b", 0)):
        for i in range(welds + moving):
            turns = count and i >= welds
            X = pose(rng.normal(size=3) * 0.1, rng.normal(size=3), rng.uniform(-3, 3))
            X[2, 3] = tiny
            kind = JointKind.REVOLUTE if turns else JointKind.WELD
            above = WORLD if i == 0 else f"{side}{i - 1}"
            axis = np.array([0.6, 0.8, 0.0]) if turns else np.zeros(3)
            limit = 1.0 if turns else None
            index = i - welds if turns else None
            joints.append(Joint(f"j{side}{i}", kind, above, f"{side}{i}", axis, X, X, index, limit and -limit, limit))
            bodies.append(f"{side}{i}")
    ends = [f"{side}{welds + moving - 1}" for side in "ab"]
    geometries = tuple(ball(f"{end}/ball", end, 0.1, (0.1, 0.2, tiny)) for end in ends)
    q_star = rng.uniform(-0.3, 0.3, size=moving)
    return Scene("chain", tuple(joints), tuple(bodies), geometries, (Pair(*(g.name for g in geometries)),), (), q_star)


def whole_box(n: int) -> Ground:
    eye = np.eye(n, 2 * n)
    Y_upper, Y_lower = eye, np.eye(2 * n)[n:]
    return Ground(np.zeros((0, n)), np.zeros(0), np.full(n, 1 / 3), np.full(n, 2.1), Y_lower, Y_upper)


def paths() -> bytes:
    """The longest paths with the numbers that gain most bits."""
    return _pair(chain(7, limits.PATH - 7, 5e-324), 1, 0, whole_box(7), tuple(range(7)))


def gram_matrices() -> bytes:
    """The largest chain with the most faces, for two vertices."""
    scene = chain(7, 1, 1.0)
    first = scene.geometries[0]
    geometries = (replace(first, vertices=np.concatenate([first.vertices] * 2)), scene.geometries[1])
    return _pair(replace(scene, geometries=geometries), 2, limits.FACTORS // 4**7 - 1, whole_box(7), tuple(range(7)))


def _pair(scene: Scene, vertices: int, faces: int, ground: Ground, joints: tuple[int, ...]) -> bytes:
    """A pair's file whose first volume has this many vertices, behind these joints; it fails at the residual."""
    n, rng, sides = scene.n, np.random.default_rng(0), []
    for chain_, count in ((joints, vertices), ((), 1)):
        length = 2 ** len(chain_)
        mantissa = rng.integers(-(1 << 47), 1 << 47, size=(count, faces + 1, length * (length + 1) // 2))
        sides.append(Side(chain_, mantissa, rng.integers(-200, 200, size=faces + 1).astype(np.int32)))
    volumes = (Volume.of(scene.geometries[0]), Volume.of(scene.geometries[1]))
    numbers = tuple(int(j) for j in rng.integers(0, 2 * n, size=faces))
    plane = rng.normal(size=(4, n + 1)) * 5e-324 + rng.normal(size=(4, n + 1))
    proof = PairProof(scene, volumes, WORLD, ground, np.zeros(n), plane, 1.0, 1e3, numbers, (sides[0], sides[1]))
    return with_scene(proof.to_bytes(), scene)


def polytope() -> bytes:
    """A ground of as many faces and joints as may be, every multiplier and every coefficient in use."""
    n, m, rng = limits.POSITIONS, limits.FACES, np.random.default_rng(0)
    eye = np.eye(4)
    joints = tuple(
        Joint(f"j{i}", JointKind.PRISMATIC, WORLD if i % 60 == 0 else f"b{i - 1}", f"b{i}", eye[2, :3], eye, eye, i, -1.0, 1.0)
        for i in range(n)
    )
    geometries = (ball("b0/ball", "b0", 0.1), ball("world/ball", WORLD, 0.1, (9, 0, 0)))
    bodies = (WORLD, *(f"b{i}" for i in range(n)))
    scene = Scene("wide", joints, bodies, geometries, (Pair("b0/ball", "world/ball"),), (), np.zeros(n))
    C, Y = rng.normal(size=(m, n)), np.zeros((2, n, m + 2 * n))
    for row in Y.reshape(2 * n, -1):
        row[rng.choice(m, 2 * n, replace=False)] = 10.0 ** rng.uniform(-150, 0, size=2 * n)
    ground = Ground(C, np.full(m, 9.0), np.zeros(n), np.full(n, 1e6), Y[0], Y[1])
    return _pair(scene, 1, 0, ground, (0,))


def dual() -> bytes:
    """The longest chain and the most joints with the moments of a uniform distribution; it fails at the equations."""
    scene = chain(6, 1, 1.0)
    first, other = scene.geometries
    n, rng, V = scene.n, np.random.default_rng(0), 6  # more vertices would be sums of too many products
    many = Geometry("a/many", first.body, rng.normal(size=(V, 3)), 0.0, {})
    scene = replace(scene, geometries=(many, other), pairs=(Pair(many.name, other.name),))
    exponents = [monomials(joints, n) for joints in (tuple(range(n)), ())]
    one, two = (np.prod(np.where(e % 2, 0.0, 1 / (e + 1)), axis=1) for e in exponents)
    more = limits.LOCALISED // (V * 4**n) - 4 * n - 1
    box = Ground.of_box(np.zeros(n), np.full(n, 0.2))
    C, d = np.concatenate([box.C, rng.normal(size=(more, n))]), np.concatenate([box.d, np.full(more, 99.0)])
    ground = Ground(C, d, box.mid, box.half, *(np.pad(Y, ((0, 0), (0, more))) for Y in (box.Y_lower, box.Y_upper)))
    normal = (np.eye(3), np.eye(n + 1))
    moments = (np.tile(one, (V, 1)), two[None])
    entries = np.zeros((0, 3), dtype=np.int64)
    return with_scene(DualProof(scene, scene.pairs[0], WORLD, ground, np.zeros(n), moments, (), entries, normal).to_bytes(), scene)


def motion() -> bytes:
    """As many intervals of bodies with as many vertices, behind as many joints, as there may be."""
    scene, rng = chain(32, 1, 1.0), np.random.default_rng(0)
    first, other = scene.geometries
    many = 512
    bodies = [Geometry(g.name, g.body, rng.normal(size=(many, 3)), 0.0, {}) for g in (first, other)]
    far = replace(bodies[1], vertices=bodies[1].vertices + np.array([0.0, 0.0, 1e4]))
    scene = replace(scene, geometries=(bodies[0], far), pairs=(Pair(first.name, other.name),))
    joints = sum(len(ExactKinematics.by_joint(scene).path(WORLD, body.body)) for body in scene.geometries)
    count = min(limits.INTERVALS, limits.SWEPT // (2 * many + limits.JOINT_COST * joints + scene.n))
    ends, normals = np.arange(1, count + 1) / count, np.tile([0.0, 0.0, -1.0], (count, 1))
    frames, counts = np.zeros(1, np.int32), np.array([[count]], np.int32)
    still = Motion(Space.Q, np.zeros((2, scene.n)))
    return with_scene(MotionProof(scene, still, 1.0, 0.0, frames, counts, ends, normals).to_bytes(), scene)


def motion_chains() -> bytes:
    """Pairs that each have a frame and two bodies of their own, each at the end of as many welds as there may be."""
    chains, welds, rng = 156, limits.PATH, np.random.default_rng(0)
    first, last = (pose(rng.uniform(-1, 1, 3) * [0.1, 1e-300, 3e-308], rng.normal(size=3), rng.uniform(-3, 3)) for _ in range(2))
    step = first @ np.linalg.inv(last)
    ends = [np.linalg.matrix_power(step, k) for k in range(welds + 1)]
    joints, bodies = [], [WORLD]
    for c, k in itertools.product(range(chains), range(welds)):
        turns = (JointKind.REVOLUTE, np.array([0.0, 0.0, 1.0]), first, last, 0, -1.0, 1.0)
        kind, *rest = turns if c == 0 and k == welds - 1 else (JointKind.WELD, np.zeros(3), first, last)
        joints.append(Joint(f"j{c}/{k}", kind, f"{c}/{k - 1}" if k else WORLD, f"{c}/{k}", *rest))
        bodies.append(f"{c}/{k}")
    points = np.array([np.linalg.solve(ends[welds], [c, 0.0, 0.0, 1.0])[:3] for c in range(chains)])
    geometries = tuple(Geometry(f"g{c:03}", f"{c}/{welds - 1}", points[c : c + 1], 0.0, {}) for c in range(chains))
    pairs, frames, normals, used = [], [], [], set()
    for a, b in itertools.combinations(range(chains), 2):
        for off in range(2 * chains):
            c, k = (a + b + off) % chains, welds - 1 - (a * b + off) % 2
            if c not in (a, b) and not used & {(c, k, a), (c, k, b)}:
                used |= {(c, k, a), (c, k, b)}
                pairs.append(Pair(f"g{a:03}", f"g{b:03}"))
                frames.append(1 + c * welds + k)
                normals.append(ends[k + 1][:3, :3].T @ [-1.0, 0.0, 0.0])
                break
    scene = Scene("chains", tuple(joints), tuple(bodies), geometries, tuple(pairs), (), np.zeros(1))
    return _resting(scene, frames, np.ones(len(pairs), int), np.ones(len(pairs)), np.array(normals))


def motion_joints() -> bytes:
    """Pairs whose frames are behind all joints that move, and whose bodies are not: each chain has all of them."""
    eye, leaves, rng = np.eye(4), 200, np.random.default_rng(0)
    moving = limits.PATH - 1
    joints = [
        Joint(f"j{i}", JointKind.REVOLUTE, f"b{i - 1}" if i else WORLD, f"b{i}", eye[2, :3], pose((0.01, 0, 0)), eye, i, -1.0, 1.0)
        for i in range(moving)
    ]
    joints += [Joint(f"f{i}", JointKind.WELD, f"b{moving - 1}", f"f{i}", np.zeros(3), pose((0, 0, i)), eye) for i in range(leaves)]
    joints += [Joint(f"a{i}", JointKind.WELD, WORLD, f"a{i:03}", np.zeros(3), pose((i, 0, 0)), eye) for i in range(leaves)]
    geometries = tuple(Geometry(f"g{i:03}", f"a{i:03}", np.zeros((1, 3)), 0.0, {}) for i in range(leaves))
    pairs = tuple(Pair(a.name, b.name) for a, b in itertools.combinations(geometries, 2))
    bodies = (WORLD, *(joint.child for joint in joints))
    scene = Scene("joints", tuple(joints), bodies, geometries, pairs, (), np.zeros(moving))
    frames = 1 + moving + rng.integers(0, leaves, len(pairs))
    return _resting(scene, frames, np.ones(len(pairs), int), np.ones(len(pairs)), np.tile([-1.0, 0.0, 0.0], (len(pairs), 1)))


def motion_geometries() -> bytes:
    """Pairs of the same two bodies with as many geometries and intervals as there may be, one of them with many vertices."""
    eye, count = np.eye(4), limits.GEOMETRIES - 1
    joint = Joint("j", JointKind.REVOLUTE, WORLD, "a", eye[2, :3], eye, eye, 0, -1.0, 1.0)
    one = np.array([[-3.0, 0.0, 0.0]])
    others = [Geometry(f"g{i:05}", WORLD, np.repeat(one, limits.VERTICES if i == 0 else 1, axis=0), 0.0, {}) for i in range(count)]
    tip = Geometry("a", "a", np.array([[0.1, 0.0, 0.0]]), 0.0, {})
    scene = Scene("geometries", (joint,), (WORLD, "a"), (tip, *others), tuple(Pair("a", g.name) for g in others), (), np.zeros(1))
    each = limits.INTERVALS // count
    ends = np.tile(np.arange(1, each + 1) / each, count)
    normals = np.tile([1.0, 0.0, 0.0], (count * each, 1))
    some = normals[::40, 1:]
    some[:] = np.random.default_rng(0).uniform(-0.01, 0.01, some.shape)  # a file that is smaller may not unpack to that much
    return _resting(scene, np.zeros(count), np.full(count, each), ends, normals)


def _resting(scene: Scene, frames: Any, counts: np.ndarray, ends: np.ndarray, normals: np.ndarray) -> bytes:
    """The file of a motion of one piece that rests where all positions are 0."""
    still = Motion(Space.Q, np.zeros((2, scene.n)))
    proof = MotionProof(scene, still, 1.0, 0.0, np.array(frames, np.int32), counts[:, None].astype(np.int32), ends, normals)
    return with_scene(proof.to_bytes(), scene)


FILES: tuple[Callable[[], bytes], ...] = (
    header_of_nothing,
    header_of_numbers,
    pairs_and_reasons,
    geometries_and_pairs,
    proofs,
    unpacked_bytes,
    paths,
    gram_matrices,
    polytope,
    dual,
    motion,
    motion_chains,
    motion_joints,
    motion_geometries,
)


def measured(names: list[str]) -> Iterator[str]:
    """A line for each file of these names, or of all."""
    for make in FILES:
        if names and make.__name__ not in names:
            continue
        with tempfile.NamedTemporaryFile(suffix=".proof") as file:
            file.write(make())
            file.flush()
            size, began = file.tell(), time.perf_counter()
            found = run_in_child("tests.certifier.verify.judge:judge", {"path": file.name}, timeout_s=3600, memory_bytes=8 << 30)
            took = time.perf_counter() - began
        answer = found["answer"]
        said = "holds" if answer["holds"] else f"{answer['error']['code']}: {answer['error']['message'][:100]}"
        yield f"{make.__name__}: {size / 2**20:.2f} MiB, {took:.1f} s, {found['peak'] / 2**20:.0f} MiB, {said}"


if __name__ == "__main__":
    for line in measured(sys.argv[1:]):
        print(line, flush=True)
