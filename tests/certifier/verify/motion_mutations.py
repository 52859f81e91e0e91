"""Valid proofs of motions of many kinds, and changes of them: of their bytes behind headers that fit, and of what they say."""

from __future__ import annotations

import copy
import io
import json
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from certifier.model import WORLD, Geometry, JointKind, Pair, Scene
from certifier.motion.search import search
from certifier.proof.container import npy, pack, with_scene
from certifier.proof.motion import Motion, Space
from tests.certifier.motions import raised, swing
from tests.certifier.proofs import motion
from tests.certifier.scenes import ball, box, planar_arm, pose, random_tree
from tests.certifier.verify.hostile import Members, fitting, members, zipped

Rng = np.random.Generator
Parts = tuple[dict[str, Any], dict[str, np.ndarray]]


def _proved(scene: Scene, path: Motion, tube: bool = False) -> bytes:
    proof = search(scene, path, tube).proof
    assert proof is not None
    return with_scene(proof.to_bytes(), scene)


def _in(space: Space, scene: Scene, q: Any, degree: int = 1) -> Motion:
    points = np.array(q, dtype=float)
    return Motion(space, points if space is Space.Q else scene.to_s(points), degree)


def _slider(padding: float) -> Scene:
    """A joint that slides and one that turns behind it, with capsules, offset frames and a weld at the end."""
    scene = planar_arm(2, padding=padding, q_star=(0.1, -0.2))
    first, second = scene.joints
    rail = replace(first, kind=JointKind.PRISMATIC, axis=np.array([1.0, 0.0, 0.0]), X_BM=pose((0.1, 0.2, 0.0), angle=0.3), lower=-0.5)
    turn = replace(second, X_PF=pose((0.5, 0.0, 0.1), (1.0, 2.0, 3.0), 0.4), X_BM=pose((-0.1, 0.0, 0.05), (0.0, 1.0, 0.0), -0.2))
    rod = Geometry("arm/link2/rod", "arm/link2", np.array([[0.0, 0.0, 0.0], [0.6, 0.0, 0.1]]), 0.04, {"kind": "capsule"})
    wall = box("world/wall", WORLD, (0.2, 0.2, 2.0), (1.2, 1.3, 0.0))
    cart = ball("arm/link1/cart", "arm/link1", 0.05)
    pairs = (Pair(rod.name, wall.name), Pair(cart.name, wall.name))
    return replace(scene, joints=(rail, turn), geometries=(cart, rod, wall), pairs=pairs)


def _forest(seed: int) -> Scene:
    """A tree with every kind of joint; a ball on some bodies and a box on others, and a pair of each ball and each box."""
    tree = random_tree(seed, bodies=5)
    rng = np.random.default_rng(seed)
    shapes: list[Geometry] = []
    for i, body in enumerate(tree.bodies):
        shapes.append(ball(f"{body}/ball", body, 0.1, rng.normal(size=3) * 0.1) if i % 2 else box(f"{body}/box", body, (0.1, 0.2, 0.1)))
    balls, boxes = shapes[1::2], shapes[::2]
    pairs = tuple(Pair(*sorted((a.name, b.name))) for a in balls for b in boxes)
    return replace(tree, geometries=tuple(shapes), pairs=pairs, padding=0.003)


@cache
def valid() -> list[bytes]:
    """Proofs in q and in s, of degrees 1 to 5, with tubes, ends before the motion's, slides, paddings and radii."""
    found = []
    swung = [[-1.0], [0.6], [-0.4], [0.2], [-0.9], [0.5], [-0.2], [0.1], [0.7], [-0.3], [0.4]]
    for degree, space in ((1, Space.Q), (2, Space.S), (3, Space.Q), (4, Space.S), (5, Space.Q), (5, Space.S)):
        for gap, tube in ((1e-3, False), (0.05, True)):
            scene = swing(gap, padding=0.002 * (degree % 2))
            found.append(_proved(scene, _in(space, scene, swung[: 2 * degree + 1], degree), tube))
    scene, proof = motion()
    found += [with_scene(proof.to_bytes(), scene), _proved(scene, raised(proof.motion, 2), True)]
    into = swing(-0.05)
    for space in Space:
        found.append(_proved(into, _in(space, into, [[-1.5], [-1.0], [0.3]])))
        slider = _slider(0.004)
        path = [[-0.3, -0.9], [0.1, 0.2], [0.35, 0.1]]
        found += [_proved(slider, _in(space, slider, path), tube) for tube in (False, True)]
        found.append(_proved(slider, _in(space, slider, [*path, [0.2, -0.5]], 3), True))
    rng = np.random.default_rng(0)
    for seed in range(40):
        forest = _forest(seed)
        path = _in(Space.Q, forest, rng.uniform(-0.6, 0.6, (3, forest.n)), int(rng.choice([1, 2])))
        result = search(forest, path, bool(seed % 2))
        if result.proof is not None and len(result.proof.ends) < 400 and len(found) < 28:
            found.append(with_scene(result.proof.to_bytes(), forest))
    return found


def unpacked(data: bytes) -> Parts:
    """Header and arrays, read by NumPy and json alone."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        names = [name for name in archive.namelist() if name.endswith(".npy")]
        header = json.loads(archive.read("header.json"))
        return header, {name.removesuffix(".npy"): np.load(io.BytesIO(archive.read(name))) for name in names}


# Bytes


def changed_bytes(data: bytes, rng: Rng) -> bytes:
    """The file with bytes of it changed, most often behind a zip and array headers that fit, and with the scene's hash made to fit."""
    way = rng.integers(12)
    if way == 0:
        return _scrambled(data, rng)
    found = members(data)
    for _ in range(1 + rng.integers(3)):
        at = int(rng.integers(len(found)))
        name, content = found[at]
        if name == "header.json":
            content = _digits(content, rng) if rng.random() < 0.8 else _scrambled(content, rng)
        elif way == 1:
            content = _scrambled(content, rng)
        else:
            content = _array(content, rng)
        found[at] = name, content
    if way == 2:
        other = members(valid()[rng.integers(len(valid()))])
        i = int(rng.integers(len(found)))
        found[i] = found[i][0], dict(other)[found[i][0]]
    return zipped(_fitted(found), zipfile.ZIP_DEFLATED)


def _scrambled(content: bytes, rng: Rng) -> bytes:
    raw = bytearray(content)
    way = rng.integers(4)
    i, j = sorted(int(k) for k in rng.integers(0, len(raw), 2))
    if way <= 1:
        for _ in range(1 + rng.integers(4)):
            raw[rng.integers(len(raw))] ^= 1 << rng.integers(8)
    elif way == 2:
        del raw[i : min(j, i + 16)]
    else:
        raw[j:j] = raw[i : i + 8]
    return bytes(raw)


def _digits(content: bytes, rng: Rng) -> bytes:
    """JSON with a few of its digits, signs and letters changed."""
    raw = bytearray(content)
    places = [i for i, byte in enumerate(raw) if byte in b"0123456789-."]
    for at in rng.choice(places, 1 + rng.integers(2)):
        raw[at] = rng.choice(list(b"0123456789"))
    return bytes(raw)


def _array(content: bytes, rng: Rng) -> bytes:
    """An array with bits or numbers of it changed, or whole rows, in the shape that it has or another that fits."""
    array = np.load(io.BytesIO(content)).copy()
    if not array.size:
        return content
    flat, way = array.reshape(-1), rng.integers(6)
    i, j = (int(k) for k in rng.integers(0, flat.size, 2))
    if way <= 2:
        raw = flat.view(np.uint8).reshape(flat.size, -1)
        # The last bytes hold the exponent; the first ones move a number by ulps.
        raw[i, rng.integers(raw.shape[1])] ^= 1 << rng.integers(8)
    elif way == 3:
        flat[[i, j]] = flat[[j, i]]
    elif way == 4:
        flat[i] = flat[j]
    else:
        rows = rng.integers(len(array) + 1)
        array = np.concatenate([array[:rows], array[max(0, rows - 1) :]]) if rng.random() < 0.5 else np.delete(array, rows - 1, axis=0)
    return npy(array)


def _fitted(found: Members) -> Members:
    """The members with a header whose hash fits its scene, if it is one."""
    parts = dict(found)
    try:
        text = json.dumps(fitting(json.loads(parts["header.json"])), sort_keys=True).encode()
    except (ValueError, RecursionError):
        return found
    return [(name, text if name == "header.json" else content) for name, content in found]


# What the file says


def nudged(x: float, rng: Rng) -> float:
    """The number moved by ulps, by a part of it, or to another size, sign or place."""
    way = rng.integers(6)
    if way == 0:
        for _ in range(1 + rng.integers(4)):
            x = float(np.nextafter(x, rng.choice([-np.inf, np.inf])))
        return x
    if way <= 2:
        return float(x * (1 + rng.choice([-1, 1]) * 10.0 ** rng.uniform(-15, -0.3)))
    if way == 3:
        return float(x + rng.choice([-1, 1]) * 10.0 ** rng.uniform(-12, 0))
    return float(rng.choice([-x, 0.0, 1.0, 2 * x, 0.5 * x, rng.normal()]))


def normals(parts: Parts, rng: Rng) -> None:
    """Planes flipped, scaled, moved, exchanged or those of their neighbours."""
    array = parts[1]["normals"]
    i, j = (int(k) for k in rng.integers(0, len(array), 2))
    way = rng.integers(5)
    if way == 0:
        array[i] *= rng.choice([-1.0, 0.500001, 0.5, 1.9999, 2.0, 1.5, 1e-3])
    elif way == 1:
        array *= rng.choice([-1.0, 0.50001, 1.9999, 1.2])
    elif way == 2:
        array[i] += rng.normal(size=3) * 10.0 ** rng.uniform(-9, 0)
    elif way == 3:
        array[[i, j]] = array[[j, i]]
    else:
        array[i, rng.integers(3)] = nudged(array[i, rng.integers(3)], rng)


def ends(parts: Parts, rng: Rng) -> None:
    """Times moved, or intervals gone, with their counts."""
    _, arrays = parts
    array = arrays["ends"]
    i = int(rng.integers(len(array)))
    if rng.random() < 0.5:
        array[i] = nudged(array[i], rng)
        return
    arrays["ends"], arrays["normals"] = np.delete(array, i), np.delete(arrays["normals"], i, axis=0)
    flat = arrays["counts"].reshape(-1)
    flat[min(int(np.searchsorted(np.cumsum(flat), i, side="right")), len(flat) - 1)] -= 1


def counts(parts: Parts, rng: Rng) -> None:
    """An interval of one piece or pair counted to another."""
    flat = parts[1]["counts"].reshape(-1)
    i, j = rng.integers(0, flat.size, 2)
    step = int(rng.choice([1, 1, 2, -1]))
    flat[i] += step
    flat[j] -= step


def controls(parts: Parts, rng: Rng) -> None:
    """Control points moved, exchanged, fewer or more."""
    arrays = parts[1]
    array = arrays["controls"]
    i, j = (int(k) for k in rng.integers(0, len(array), 2))
    way = rng.integers(6)
    if way <= 2:
        array[i, rng.integers(array.shape[1])] = nudged(array[i, rng.integers(array.shape[1])], rng)
    elif way == 3:
        array[[i, j]] = array[[j, i]]
    elif way == 4:
        array += rng.normal(size=array.shape) * 10.0 ** rng.uniform(-12, -1)
    else:
        arrays["controls"] = np.delete(array, i, axis=0) if rng.random() < 0.5 else np.insert(array, i, array[j], axis=0)


def frames(parts: Parts, rng: Rng) -> None:
    """Planes in the frame of another body."""
    header, arrays = parts
    arrays["frames"][rng.integers(len(arrays["frames"]))] = rng.integers(-1, len(header["scene"]["bodies"]) + 1)


def claims(parts: Parts, rng: Rng) -> None:
    """Another tube, end, degree or space; perhaps with as many control points as belong to it."""
    header, arrays = parts
    way = rng.integers(4)
    if way == 0:
        header["rho"] = abs(nudged(header["rho"], rng)) if header["rho"] else float(10.0 ** rng.uniform(-12, 0))
    elif way == 1:
        header["end"] = float(rng.choice([nudged(header["end"], rng), rng.uniform(0, 1), 1.0]))
    elif way == 2:
        header["space"] = {"q": "s", "s": "q"}[header["space"]]
    else:
        pieces = arrays["counts"].shape[1]
        header["degree"] = int(rng.integers(1, 6))
        points = arrays["controls"]
        arrays["controls"] = points[rng.integers(0, len(points), pieces * header["degree"] + 1)] if rng.random() < 0.5 else points


def pairs(parts: Parts, rng: Rng) -> None:
    """A pair gone, with its intervals or without them, exchanged with another, of another body, or with a padding of its own."""
    header, arrays = parts
    scene = header["scene"]
    i = int(rng.integers(len(scene["pairs"])))
    way = rng.integers(6)
    if way == 0:
        del scene["pairs"][i]
        if rng.random() < 0.8:
            totals = arrays["counts"].sum(axis=1)
            gone = slice(int(totals[:i].sum()), int(totals[: i + 1].sum()))
            arrays |= {name: np.delete(arrays[name], gone, axis=0) for name in ("ends", "normals")}
            arrays |= {name: np.delete(arrays[name], i, axis=0) for name in ("counts", "frames")}
    elif way == 1:
        j = int(rng.integers(len(scene["pairs"])))
        scene["pairs"][i], scene["pairs"][j] = scene["pairs"][j], scene["pairs"][i]
    elif way < 4:
        padding = scene["padding"] * rng.uniform(0, 2) + rng.choice([0.0, 1e-6, 1e-3, 0.1])
        scene["pairs"][i] = [*scene["pairs"][i][:2], float(padding)]
    else:
        names = [geometry["name"] for geometry in scene["geometries"]]
        scene["pairs"][i] = sorted(rng.choice(names, 2, replace=False).tolist())
    arrays["frames"], arrays["counts"] = np.ascontiguousarray(arrays["frames"]), np.ascontiguousarray(arrays["counts"])


def numbers(parts: Parts, rng: Rng) -> None:
    """A number of the scene: a vertex, a radius, a padding, a frame, an axis, a limit or q*."""
    scene = parts[0]["scene"]
    # Every path of a number is drawn by its kind first, as there are many more vertices than radii.
    kinds: dict[str, list[tuple[Any, Any]]] = {}
    for key, node, at in _numbers({name: scene[name] for name in ("joints", "geometries", "q_star", "padding")}):
        kinds.setdefault(key, []).append((node, at))
    places = kinds[rng.choice(sorted(kinds))]
    node, at = places[rng.integers(len(places))]
    if node is None:
        scene["padding"] = abs(nudged(scene["padding"], rng))
    else:
        node[at] = nudged(node[at], rng)


def _numbers(node: Any, key: str = "") -> Iterator[tuple[str, Any, Any]]:
    for at, value in node.items() if isinstance(node, dict) else enumerate(node):
        name = at if isinstance(at, str) else key
        if name == "padding":
            yield name, None, None
        elif isinstance(value, (dict, list)) and name != "shape":
            yield from _numbers(value, name)
        elif isinstance(value, float):
            yield name, node, at


def tree(parts: Parts, rng: Rng) -> None:
    """A joint of another kind or parent, a geometry on another body, or two joints that move with each other's positions."""
    scene = parts[0]["scene"]
    joints = scene["joints"]
    joint, other = (joints[int(k)] for k in rng.integers(0, len(joints), 2))
    way = rng.integers(4)
    if way == 0 and joint["kind"] != "weld":
        joint["kind"] = {"revolute": "prismatic", "prismatic": "revolute"}[joint["kind"]]
    elif way == 1:
        joint["parent"] = other["parent"]
    elif way == 2:
        joint["index"], other["index"] = other["index"], joint["index"]
    else:
        geometry = scene["geometries"][rng.integers(len(scene["geometries"]))]
        geometry["body"] = str(rng.choice(scene["bodies"]))


KINDS: dict[Callable[[Parts, Rng], None], float] = {
    normals: 0.16,
    ends: 0.1,
    counts: 0.06,
    controls: 0.16,
    frames: 0.05,
    claims: 0.14,
    pairs: 0.08,
    numbers: 0.19,
    tree: 0.06,
}


def changed_meaning(data: bytes, rng: Rng) -> tuple[str, bytes]:
    """One change of what a file says, or two, with a scene's hash that fits; and of which kind the first one is."""
    header, arrays = unpacked(data)
    parts = copy.deepcopy(header), {name: array.copy() for name, array in arrays.items()}
    chosen = rng.choice(len(KINDS), 1 + int(rng.random() < 0.3), p=list(KINDS.values()))
    kinds = [list(KINDS)[k] for k in chosen]
    for kind in kinds:
        if parts[0]["scene"]["pairs"] and all(array.size for array in parts[1].values()):  # what is empty cannot be changed
            kind(parts, rng)
    return kinds[0].__name__, pack(fitting(parts[0]), parts[1])
