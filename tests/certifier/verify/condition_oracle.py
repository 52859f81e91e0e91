"""What is true of the conditions that a statement names, by code that shares nothing with the verifier.

The sentences of the statement are read as a person reads them, and the scene as JSON. Kinematics are products of matrices here.
"""

from __future__ import annotations

import io
import itertools
import json
import re
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from certifier.polytopes.closest import closest
from certifier.polytopes.polytope import Polytope, chebyshev_center
from certifier.polytopes.sampling import hit_and_run
from certifier.proof.map import MapProof
from certifier.proof.sub_scene import sub_scene
from tests.certifier.map.test_map import in_planes

HAIR = 1e-6
"""In metres and radians: what the verifier takes the numbers of a rotation for differs from them by less."""
SAMPLES, TIMES, DRAWN = 60, 40, 4000
"""Of a polytope beside its corners, of each piece of a motion, and within the joint limits of a map."""
_NUMBER = r"-?[\d.]+(?:e-?\d+)?"
_VECTOR = rf"\(({_NUMBER}), ({_NUMBER}), ({_NUMBER})\)"
_NAME = "'([^']*)'"
_POINT = rf"the point {_VECTOR} m of {_NAME}"
_NAMES = r"(?:(?:the point \([^)]*\) m of )?'[^']*'(?:, )?)+"
_LIMITED = ", at configurations within the joint limits"


@dataclass(frozen=True)
class File:
    """A proof file, read by NumPy and json alone."""

    header: dict[str, Any]
    arrays: dict[str, np.ndarray]

    @classmethod
    def of(cls, data: bytes) -> File:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = [name for name in archive.namelist() if name.endswith(".npy")]
            arrays = {name.removesuffix(".npy"): np.load(io.BytesIO(archive.read(name))) for name in names}
            return cls(json.loads(archive.read("header.json")), arrays)


class Bodies:
    """The bodies of a scene's document at joint positions q, (S, n)."""

    def __init__(self, scene: dict[str, Any], q: np.ndarray) -> None:
        self.q, self._scene = q, scene
        self.moving = {joint["name"]: joint for joint in scene["joints"] if joint["index"] is not None and not joint.get("follows")}
        self._above = {joint["child"]: joint for joint in scene["joints"]}
        self._poses = {"world": np.broadcast_to(np.eye(4), (len(q), 4, 4))}

    def pose(self, body: str) -> np.ndarray:
        """Returns the pose in the world, (S, 4, 4)."""
        if body not in self._poses:
            joint = self._above[body]
            moved = np.broadcast_to(np.eye(4), (len(self.q), 4, 4)).copy()
            if joint["index"] is not None:
                at, axis = self.q[:, joint["index"]], np.array(joint["axis"], dtype=float)
                if joint["kind"] == "prismatic":
                    moved[:, :3, 3] = at[:, None] * axis
                else:
                    x, y, z = axis / np.linalg.norm(axis)
                    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
                    moved[:, :3, :3] += np.sin(at)[:, None, None] * K + (1 - np.cos(at))[:, None, None] * (K @ K)
            X_PF, X_BM = (np.array(joint[name], dtype=float) for name in ("X_PF", "X_BM"))
            self._poses[body] = self.pose(joint["parent"]) @ X_PF @ moved @ np.linalg.inv(X_BM)
        return self._poses[body]

    def geometries(self, name: str) -> list[dict[str, Any]]:
        """Returns the geometries that a name means: one, the parts of a mesh, or all of a body."""
        own = [one for one in self._scene["geometries"] if not one["name"].startswith("conditions/")]
        return [one for one in own if name in (one["name"], one["body"], one["shape"].get("of"))]

    def points(self, geometry: dict[str, Any], of: str = "world") -> np.ndarray:
        """Returns the vertices in the frame of a body, (S, v, 3)."""
        X = np.linalg.inv(self.pose(of)) @ self.pose(geometry["body"])
        return np.array(geometry["vertices"], dtype=float) @ X[:, :3, :3].swapaxes(1, 2) + X[:, None, :3, 3]

    def within_limits(self) -> np.ndarray:
        """Returns whether each configuration is within the joint limits, (S,)."""
        joints = sorted(self.moving.values(), key=lambda joint: joint["index"])
        lower, upper = (np.array([joint[side] for joint in joints]) for side in ("lower", "upper"))
        return ((lower <= self.q) & (self.q <= upper)).all(axis=1)

    def to_q(self, s: np.ndarray) -> np.ndarray:
        turns = [joint["kind"] == "revolute" for joint in sorted(self.moving.values(), key=lambda joint: joint["index"])]
        return np.array(self._scene["q_star"]) + np.where(turns, 2 * np.arctan(s), s)


def beyond(sentence: str, bodies: Bodies) -> np.ndarray:
    """Returns by how much each configuration fails what a sentence of a statement says, (S,): radians or metres, not positive if it holds.

    Raises:
        ValueError: this sentence says nothing that is known here.
    """
    limited = sentence.endswith(_LIMITED)
    sentence = sentence.removesuffix(_LIMITED)
    for pattern, measure in _SENTENCES.items():
        if found := re.fullmatch(pattern, sentence):
            failed = measure(bodies, *found.groups())
            return np.where(bodies.within_limits(), failed, -np.inf) if limited else failed
    raise ValueError(f"nobody knows what this means: {sentence}")


def _cone(bodies: Bodies, *said: str) -> np.ndarray:
    axis, along = np.array(said[:3], dtype=float), np.array(said[5:8], dtype=float)
    a, b = bodies.pose(said[3])[:, :3, :3] @ axis, bodies.pose(said[8])[:, :3, :3] @ along
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1)) - np.radians(float(said[4]))


def _staying(bodies: Bodies, names: str) -> list[dict[str, Any]]:
    """Returns the geometries and points that a sentence names."""
    points = [{"body": body, "vertices": [[float(x) for x in at]], "radius": 0.0} for *at, body in re.findall(_POINT, names)]
    found = []
    for name in re.findall(_NAME, re.sub(_POINT, "", names)):
        (geometry,) = [one for one in bodies.geometries(name) if one["name"] == name]
        found.append(geometry)
    return found + points


def _zone(bodies: Bodies, names: str, faces: list[list[float]], of: str) -> np.ndarray:
    found = []
    for geometry in _staying(bodies, names):
        points = bodies.points(geometry, of)
        found += [(points @ np.array(normal)).max(axis=1) + geometry["radius"] - d for *normal, d in faces]
    return np.max(found, axis=0)


def _ball(bodies: Bodies, names: str, radius: str, *said: str) -> np.ndarray:
    center, of = np.array(said[:3], dtype=float), said[3]
    kept = [(bodies.points(geometry, of), geometry["radius"]) for geometry in _staying(bodies, names)]
    return np.max([np.linalg.norm(points - center, axis=2).max(axis=1) + own for points, own in kept], axis=0) - float(radius)


def _box(bodies: Bodies, names: str, *said: str) -> np.ndarray:
    lower, upper = np.array(said[:3], dtype=float), np.array(said[3:6], dtype=float)
    faces = [[*normal, d] for normal, d in zip(np.concatenate([np.eye(3), -np.eye(3)]).tolist(), [*upper, *-lower], strict=True)]
    return _zone(bodies, names, faces, said[6])


def _half_spaces(bodies: Bodies, names: str, said: str, of: str) -> np.ndarray:
    faces = [[float(x) for x in face] for face in re.findall(rf"{_VECTOR} \. x <= ({_NUMBER}) m", said)]
    return _zone(bodies, names, faces, of)


def _distance(bodies: Bodies, a: str, b: str, metres: str) -> np.ndarray:
    found = []
    for one, other in itertools.product(bodies.geometries(a), bodies.geometries(b)):
        apart = [closest(x, y).distance for x, y in zip(bodies.points(one), bodies.points(other), strict=True)]
        found.append(float(metres) - np.array(apart) + one["radius"] + other["radius"])
    return np.max(found, axis=0)


def _range(bodies: Bodies, total: str, lower: str, upper: str) -> np.ndarray:
    joints = re.findall(rf"([+-]) {_NAME}", total if total[0] in "+-" else f"+ {total}")
    if not {name for _, name in joints} <= bodies.moving.keys():
        return np.full(len(bodies.q), np.inf)  # it is about no joint
    angle = sum((1 if sign == "+" else -1) * bodies.q[:, bodies.moving[name]["index"]] for sign, name in joints)
    middle, half = np.radians([(float(upper) + float(lower)) / 2, (float(upper) - float(lower)) / 2])
    off = angle - middle
    return np.abs(off - 2 * np.pi * np.round(off / (2 * np.pi))) - half


_SENTENCES: dict[str, Callable[..., np.ndarray]] = {
    rf"the direction {_VECTOR} of {_NAME} stays within ({_NUMBER}) degrees of {_VECTOR} of {_NAME}": _cone,
    rf"({_NAMES}) stays? in the box from {_VECTOR} to {_VECTOR} m, in the frame of {_NAME}": _box,
    rf"({_NAMES}) stays? in the ball of ({_NUMBER}) m about {_VECTOR}, in the frame of {_NAME}": _ball,
    rf"({_NAMES}) stays? where (.*), in the frame of {_NAME}": _half_spaces,
    rf"{_NAME} and {_NAME} stay at least ({_NUMBER}) m apart": _distance,
    rf"(.*) stays from ({_NUMBER}) to ({_NUMBER}) degrees, but for whole turns": _range,
}


def of_region(file: File) -> Bodies:
    """Returns the bodies at corners of the region and at samples within."""
    C, d = file.arrays["region/C"], file.arrays["region/d"]
    polytope = Polytope(C, d)
    s = np.concatenate([hit_and_run(polytope, chebyshev_center(polytope)[0], SAMPLES, 0), _corners(C, d)])
    still = Bodies(file.header["scene"], s)
    return Bodies(file.header["scene"], still.to_q(s))


def _corners(C: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Returns points where n faces meet that are in the polytope."""
    n = C.shape[1]
    rows = np.array(list(itertools.combinations(range(len(d)), n)))
    rows = rows[np.abs(np.linalg.det(C[rows])) > 1e-9]
    points = np.linalg.solve(C[rows], d[rows][..., None])[..., 0]
    return points[(points @ C.T <= d + 1e-12).all(axis=1)]


def of_motion(file: File) -> Bodies:
    """Returns the bodies at times of the motion, and at corners of its tube."""
    header, controls = file.header, file.arrays["controls"]
    found = []
    for first in range(0, len(controls) - 1, header["degree"]):
        last = first + header["degree"]
        points = controls[first : last + 1, None]
        times = np.linspace(0.0, header["end"] if last == len(controls) - 1 else 1.0, TIMES)[:, None]
        while len(points) > 1:
            points = (1 - times) * points[:-1] + times * points[1:]
        found.append(points[0])
    x = np.concatenate(found)
    q = x if header["space"] == "q" else Bodies(header["scene"], x).to_q(x)
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=q.shape[1]))) * header["rho"]
    return Bodies(header["scene"], np.concatenate([q, *(q + corner for corner in corners if header["rho"])]))


def of_map(file: File, data: bytes) -> Bodies:
    """Returns the bodies at configurations within the joint limits that are in a cell of each pair."""
    proof, rng = MapProof.from_bytes(data, lambda _: None), np.random.default_rng(0)
    joints = sorted((joint for joint in file.header["scene"]["joints"] if joint["index"] is not None), key=lambda joint: joint["index"])
    limits = {joint["index"]: (joint["lower"], joint["upper"]) for joint in joints}
    q = rng.uniform(*np.array([limits[i] for i in range(len(limits))]).T, (DRAWN, len(limits)))
    s = proof.scene.to_s(q)
    proved = np.ones(len(s), dtype=bool)
    for pairs, part in zip(proof.pairs, proof.maps, strict=True):
        proved &= in_planes(part, s[:, sub_scene(proof.scene, pairs).positions])
    return Bodies(file.header["scene"], q[proved])


def untrue(data: bytes, kind: str, lines: tuple[str, ...]) -> str | None:
    """Returns what is not true of the conditions that the statement of a file names, or that it names others than its scene; else None.

    Args:
        kind: ``region``, ``motion`` or ``map``.
    """
    file = File.of(data)
    bodies = {"region": of_region, "motion": of_motion}[kind](file) if kind != "map" else of_map(file, data)
    named = []
    for line in lines:
        if found := re.fullmatch(r"(?:there, )?condition '([^']*)': (.*)", line):
            named.append(found[1])
            worst = float(beyond(found[2], bodies).max(initial=-np.inf))
            if not worst <= HAIR:
                return f"this fails by {worst:.3g}: {line}"
        elif "condition " in line or "conditions/" in line:
            return f"this is no statement: {line}"
    wanted = [condition["name"] for condition in file.header["scene"].get("conditions", [])]
    nothing = any("no configuration is proved to be free" in line for line in lines)
    return None if named == ([] if nothing else wanted) else f"the conditions {wanted} are named as {named}"
