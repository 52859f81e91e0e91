"""Valid proofs of a region, of motions and of a map whose scene has conditions of all kinds, and changes of what they say of conditions.

Each change is one of a forger who knows the format: hashes fit, and often all that stands for the conditions is made again.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from certifier.conditioned import with_conditions, without_conditions
from certifier.conditions import Cone, Distance, InBall, Inside, Range, of_condition
from certifier.errors import CirisError
from certifier.jobs import local
from certifier.jobs.map import grow_map
from certifier.model import WORLD, Pair, Scene
from certifier.motion.search import search
from certifier.proof.container import pack, with_scene
from certifier.proof.motion import Motion, Space
from tests.certifier.scenes import ball, box, cube, planar_arm
from tests.certifier.verify.condition_oracle import File
from tests.certifier.verify.hostile import fitting
from tests.certifier.verify.motion_mutations import nudged

Rng = np.random.Generator
HALF = 0.1
"""The region is the cube of this half-width in s. At a corner of it, each condition is within 0.04 of failing."""
PATH = [[-0.18, -0.15, -0.1], [0.18, 0.1, 0.15], [0.1, -0.15, 0.1]]
HOSTILE: list[Any] = [
    None,
    [],
    {},
    "",
    "a/b",
    "a' stays\ncondition 'b",
    "turning",
    -1,
    0,
    0.0,
    1e-300,
    1e6,
    1e99,
    1e101,
    float("nan"),
    True,
]
TABLE: list[Any] = [
    "world",
    "arm/link1",
    "arm/link3",
    "arm/link3/tip",
    "arm/joint2",
    "conditions/room/zone",
    "conditions/turning/arm/link3",
]


@cache
def scene() -> Scene:
    """An arm whose joints turn about z, y and x, with two cones, zones that stand and that move, a ball, a distance and a range."""
    arm = planar_arm(3, limit=0.25)
    joints = tuple(replace(joint, axis=axis) for joint, axis in zip(arm.joints, np.eye(3)[::-1], strict=True))
    tip, post = ball("arm/link3/tip", "arm/link3", 0.125, (0.75, 0.25, -0.5)), ball("world/post", WORLD, 0.125, (1.5, 1.9, 0.25))
    rod = box("arm/link2/rod", "arm/link2", (0.4, 0.2, 0.1), (0.5, 0.0, 0.0))
    pairs = (Pair(tip.name, post.name), Pair(rod.name, post.name))
    room = ((1.0, 0.0, 0.0, 2.98), (0.0, 1.0, 0.0, 1.05), (0.0, 0.0, 1.0, 0.22))
    walls = ((-1.0, 0.0, 0.0, -1.2), (0.0, -1.0, 0.0, 0.57), (0.0, 0.0, -1.0, 1.03))
    return with_conditions(
        replace(arm, joints=joints, geometries=(tip, rod, post), pairs=pairs),
        [
            Cone("lean", "arm/link3", (0.6, 0.0, 0.8), WORLD, (0.0, 0.6, 0.8), 1.25),
            Cone("wrist", "arm/link3", (0.0, 0.0, 1.0), "arm/link1", (0.0, 0.0, 1.0), 0.3),
            Inside("room", (tip.name, rod.name), WORLD, (*room, *walls)),
            Inside("hood", (tip.name,), "arm/link1", ((0.0, 0.6, 0.8, 0.29), (1.0, 0.0, 0.0, 2.97))),
            Distance("clear", tip.name, post.name, 1.3),
            Range("sum", (("arm/joint1", 1), ("arm/joint2", -1), ("arm/joint3", 1)), -0.63, 0.63),
            Inside("nose", (), "arm/link1", ((0.0, 0.0, 1.0, -0.06),), points=(("arm/link3", (0.75, 0.25, -0.5)),)),
            InBall("reach", (tip.name,), WORLD, (-2.0, 0.0, 0.0), 5.15, points=(("arm/link3", (0.8, 0.0, 0.0)),)),
        ],
    )


@cache
def region() -> bytes:
    grown = local.certify(scene(), cube(scene(), 0.0, HALF), assemble=True, cells=400)
    assert grown.region is not None
    return grown.region.proof


@cache
def motion(tube: bool) -> bytes:
    proof = search(scene(), Motion(Space.Q, np.array(PATH)), tube).proof
    assert proof is not None
    return with_scene(proof.to_bytes(), scene())


@cache
def mapped() -> bytes:
    return grow_map(scene(), 0.5, 600.0).proof.to_bytes()


def valid(kind: str) -> list[bytes]:
    """Returns proofs of a kind: ``region``, ``motion`` or ``map``."""
    return {"region": lambda: [region()], "motion": lambda: [motion(False), motion(True)], "map": lambda: [mapped()]}[kind]()


class Parts:
    """What a file says: its header and its arrays, to be changed."""

    def __init__(self, data: bytes) -> None:
        file = File.of(data)
        self.header, self.arrays = copy.deepcopy(file.header), {name: array.copy() for name, array in file.arrays.items()}

    @property
    def scene(self) -> dict[str, Any]:
        found: dict[str, Any] = self.header["scene"]
        return found

    @property
    def conditions(self) -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = self.scene["conditions"]
        return found

    def made_again(self) -> None:
        """Makes all that stands for the conditions of the document; where they make no sense, all stays as it is."""
        said = {name: value for name, value in self.scene.items() if name != "hash"}
        try:
            read = Scene.from_document(said)
            document = with_conditions(without_conditions(read), read.conditions).to_document()
        except (CirisError, KeyError, ValueError, TypeError, AttributeError, OverflowError):
            return
        self.header["scene"] = json.loads(json.dumps(document))

    def without_pair(self, i: int) -> None:
        """Drops a pair with this number, and what proves it."""
        pair = self.scene["pairs"].pop(i)
        if "counts" in self.arrays:
            totals = self.arrays["counts"].sum(axis=1)
            rows = slice(int(totals[:i].sum()), int(totals[: i + 1].sum()))
            self.arrays |= {name: np.delete(self.arrays[name], rows, axis=0) for name in ("ends", "normals")}
            self.arrays |= {name: np.ascontiguousarray(np.delete(self.arrays[name], i, axis=0)) for name in ("counts", "frames")}
            return
        known, prefix = ("proofs", "proof") if "proofs" in self.header else ("pairs", "map")
        if prefix == "map":  # a tree may stand for several pairs
            i = next((number for number, alike in enumerate(self.header["pairs"]) if pair[:2] in alike), len(self.header["pairs"]))
        del self.header[known][i : i + 1]
        kept = {}
        for name, array in self.arrays.items():
            first, *rest = name.split("/")
            number = int(rest[0]) if first == prefix else -1
            if number != i:
                kept["/".join([first, str(number - (number > i)), *rest[1:]]) if first == prefix else name] = array
        self.arrays = kept
        if "volumes" in self.header:
            used = sorted({volume for one in self.header["proofs"] for volume in one["volumes"]})
            self.header["volumes"] = [self.header["volumes"][volume] for volume in used]
            for one in self.header["proofs"]:
                one["volumes"] = [used.index(volume) for volume in one["volumes"]]
            of_volumes = {name: name.split("/") for name in self.arrays if name.startswith("volume/")}
            shapes = {name: self.arrays.pop(name) for name in of_volumes}
            self.arrays |= {
                f"volume/{used.index(int(of_volumes[name][1]))}/{of_volumes[name][2]}": shape
                for name, shape in shapes.items()
                if int(of_volumes[name][1]) in used
            }

    def pack(self) -> bytes:
        return pack(fitting(self.header), self.arrays)


def leaves(node: Any) -> list[tuple[Any, Any]]:
    """The places of all that is neither an object nor a list."""
    items = list(node.items() if isinstance(node, dict) else enumerate(node))
    found = [(node, key) for key, value in items if not isinstance(value, (dict, list))]
    return found + [place for _, value in items if isinstance(value, (dict, list)) for place in leaves(value)]


def chosen(rng: Rng, values: Any) -> Any:
    return values[rng.integers(len(values))]


def number(parts: Parts, rng: Rng) -> None:
    """A number of a condition: an angle, an axis, a face, a distance."""
    node, at = chosen(rng, [(node, at) for node, at in leaves(parts.conditions) if isinstance(node[at], float)])
    node[at] = nudged(node[at], rng)


def larger(parts: Parts, rng: Rng) -> None:
    """A condition that is a little wider or narrower."""
    step = float(rng.choice([-1, 1]) * 10.0 ** rng.uniform(-12, -0.5))
    one = chosen(rng, parts.conditions)
    numbers = {"cone": "angle", "distance": "metres", "range": chosen(rng, ["lower", "upper"]), "ball": "radius"}
    at = (one, numbers[one["kind"]]) if one["kind"] in numbers else None
    node, key = at or (chosen(rng, one["faces"]), 3)
    node[key] += step


def turned(parts: Parts, rng: Rng) -> None:
    """A direction, or a face of a zone, another way round; an axis of another length; all faces inside out."""
    one = chosen(rng, [one for one in parts.conditions if one["kind"] in ("cone", "inside")])
    if one["kind"] == "inside" and rng.random() < 0.4:
        one["faces"] = [[-x for x in face] for face in one["faces"]]
        return
    vector = one[chosen(rng, ["axis", "along"])] if one["kind"] == "cone" else chosen(rng, one["faces"])
    way = rng.integers(4)
    if way == 0:
        vector[:3] = [-x for x in vector[:3]]
    elif way == 1:
        vector[:3] = rng.permutation(vector[:3]).tolist()
    elif way == 2:
        turn = rng.normal(size=3) * 10.0 ** rng.uniform(-12, 0) + vector[:3]
        vector[:3] = (turn / np.linalg.norm(turn)).tolist()
    else:
        vector[:3] = [x * rng.choice([0.0, 0.5, 1 + 1e-13, 1 + 1e-11, 2.0]) for x in vector[:3]]


def word(parts: Parts, rng: Rng) -> None:
    """Another name of a condition, a body, a geometry, a joint or a kind; or something else altogether."""
    node, at = chosen(rng, [(node, at) for node, at in leaves(parts.conditions) if not isinstance(node[at], float)])
    others = [other[key] for other, key in leaves(parts.conditions) if isinstance(other[key], type(node[at]))]
    node[at] = chosen(rng, (TABLE, others, HOSTILE)[rng.choice(3, p=[0.4, 0.4, 0.2])])


def listed(parts: Parts, rng: Rng) -> None:
    """A condition gone, twice, or in another place; a field of it gone, or one more; a face or a joint gone or twice."""
    conditions, way = parts.conditions, rng.integers(6)
    i, j = rng.integers(0, len(conditions), 2)
    if way == 0:
        del conditions[i]
    elif way == 1:
        conditions.append({**copy.deepcopy(conditions[i]), "name": chosen(rng, ["more", conditions[i]["name"]])})
    elif way == 2:
        conditions[i], conditions[j] = conditions[j], conditions[i]
    elif way == 3:
        del conditions[i][chosen(rng, sorted(conditions[i]))]
    elif way == 4:
        conditions[i][chosen(rng, ["more", *sorted(conditions[j])])] = chosen(rng, HOSTILE)
    else:
        many = chosen(rng, [value for one in conditions for value in one.values() if isinstance(value, list) and value])
        at = int(rng.integers(len(many)))
        many[:] = many[:at] + many[at + 1 :] if rng.random() < 0.6 else [*many, many[at]]


def pairs(parts: Parts, rng: Rng) -> None:
    """A pair of a condition gone, with its proof or without it; exchanged; of other geometries; or with another padding."""
    known = parts.scene["pairs"]
    own = [i for i, pair in enumerate(known) if len(pair) == 3 or any(map(of_condition, pair[:2]))]
    i, way = int(chosen(rng, own)), rng.integers(5)
    if way == 0:
        del known[i]
    elif way == 1:
        parts.without_pair(i)
    elif way == 2:
        j = int(chosen(rng, own))
        known[i], known[j] = known[j], known[i]
    elif way == 3:
        known[i] = [*known[i][:2], abs(nudged(known[i][2] if len(known[i]) == 3 else 0.1, rng))]
    else:
        known[i] = sorted([known[i][0], chosen(rng, parts.scene["geometries"])["name"]])


def stand_in(parts: Parts, rng: Rng) -> None:
    """A number or a name of a joint or a geometry that stands for a condition; one gone; or a geometry of the robot on such a body."""
    kind = chosen(rng, ["joints", "geometries"])
    known = [one for one in parts.scene[kind] if of_condition(one["name"])]
    one, way = chosen(rng, known), rng.integers(5)
    if way <= 1:
        node, at = chosen(rng, leaves(one))
        value = node[at]
        node[at] = nudged(value, rng) if isinstance(value, float) else chosen(rng, (TABLE, HOSTILE)[rng.integers(2)])
    elif way == 2:
        parts.scene[kind].remove(one)
        if kind == "joints":
            parts.scene["bodies"].remove(one["child"])
    elif way == 3:
        other = chosen(rng, known)
        key = chosen(rng, sorted(one))
        if key in other:
            one[key] = copy.deepcopy(other[key])
    else:
        chosen(rng, parts.scene["geometries"])["body"] = chosen(rng, [body for body in parts.scene["bodies"] if of_condition(body)])


def proof(parts: Parts, rng: Rng) -> None:
    """A number of an array of the proof, exchanged rows, or a frame of a plane."""
    name = chosen(rng, sorted(name for name, array in parts.arrays.items() if array.size))
    array = parts.arrays[name]
    flat = array.reshape(-1)
    i, j = rng.integers(0, flat.size, 2)
    way = rng.integers(3)
    if array.dtype.kind == "f" and way == 0:
        flat[i] = nudged(float(flat[i]), rng)
    elif way == 1:
        flat[[i, j]] = flat[[j, i]]
    else:
        flat[i] = flat[i] + np.asarray(rng.choice([-1, 1])).astype(array.dtype)


def claimed(parts: Parts, rng: Rng) -> None:
    """A region or joint limits that reach farther, a motion that goes elsewhere, or a tube that is wider."""
    step = 10.0 ** rng.uniform(-9, -0.7)
    if "controls" not in parts.arrays:
        if "region/d" in parts.arrays and rng.random() < 0.7:
            parts.arrays["region/d"][rng.integers(len(parts.arrays["region/d"]))] += step
        else:
            index = rng.integers(len(parts.scene["q_star"]))
            for joint in parts.scene["joints"]:
                joint["upper"] = joint["upper"] + step if joint["index"] == index else joint["upper"]
    elif rng.random() < 0.5:
        parts.header["rho"] += step
    else:
        parts.arrays["controls"][chosen(rng, [0, -1])] += rng.choice([-1, 1], 3) * step


KINDS: tuple[Callable[[Parts, Rng], None], ...] = (number, larger, turned, word, listed, pairs, stand_in, proof, claimed)
AGAIN = (number, larger, turned, word, listed)
"""After these, what stands for the conditions may be made again, so that nothing but the proof speaks against them."""


def changed(data: bytes, rng: Rng) -> tuple[str, bytes]:
    """Returns the file with one change, or two; and of which kind the first one is."""
    parts = Parts(data)
    kinds = [chosen(rng, KINDS) for _ in range(1 + int(rng.random() < 0.25))]
    name = kinds[0].__name__
    kinds[0](parts, rng)
    for kind in kinds[1:]:
        with suppress(TypeError, KeyError, ValueError, AttributeError):  # what is no condition any more stays as it is
            kind(parts, rng)
    if kinds[-1] in AGAIN and rng.random() < 0.6:
        parts.made_again()
        name += ", made again"
    return name, parts.pack()
