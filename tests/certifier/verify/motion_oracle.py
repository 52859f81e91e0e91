"""What is true of a motion in a proof file, by code that shares nothing with the verifier but what 16 doubles of a pose stand for.

The file is read as a zip of JSON and arrays. Positions come from numpy, at many times of the motion and at corners of its tube, and the
nearest points of bodies from least squares. The worst configurations are computed again in balls of 300 bits. There, two points of the
bodies are as far apart as they are, so their distance bounds what may be stated from above, without a tolerance.
"""

from __future__ import annotations

import io
import json
import zipfile
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from flint import arb, ctx, fmpq
from scipy.spatial.transform import Rotation

from certifier.polytopes.closest import closest
from certifier.verify.kinematics import rigid, unit

TIMES = 24
"""At this many times of each piece bodies are looked at, and at as many ends of intervals at most."""
STEPS = 12
_SHRINK = 0.6180339887498949


class MotionFile:
    """A motion as a file states it.

    Attributes:
        space, degree, end, rho: as docs/proofs.md has them.
        pieces: (P, m + 1, n) control points.
    """

    def __init__(self, data: bytes) -> None:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            header = json.loads(archive.read("header.json"))
            self._arrays = {name: np.load(io.BytesIO(archive.read(f"{name}.npy"))) for name in ("controls", "ends")}
        self.scene: dict[str, Any] = header["scene"]
        self.space, self.degree, self.end, self.rho = (header[name] for name in ("space", "degree", "end", "rho"))
        controls = self._arrays["controls"]
        self.pieces = np.array([controls[k : k + self.degree + 1] for k in range(0, len(controls) - 1, self.degree)])
        self._above = {joint["child"]: joint for joint in self.scene["joints"]}
        self._frames = {
            body: (np.array(joint["X_PF"], dtype=float), np.linalg.inv(np.array(joint["X_BM"], dtype=float)))
            for body, joint in self._above.items()
        }
        self._geometries = {geometry["name"]: geometry for geometry in self.scene["geometries"]}
        moving = [joint for joint in self.scene["joints"] if joint["index"] is not None]
        self._moving = sorted(moving, key=lambda joint: joint["index"])
        self._turns = np.array([joint["kind"] == "revolute" for joint in self._moving])
        self._base = np.array(self.scene["q_star"], dtype=float)

    @property
    def key(self) -> tuple[Any, ...]:
        """What a statement is about, but for the distance."""
        return self.scene["hash"], self.space, self.degree, self.end, self.rho, self._arrays["controls"].tobytes()

    def within_limits(self) -> bool:
        """Whether every control point is within the joint limits, but for the rounding of tangents."""
        for joint, values in zip(self._moving, np.moveaxis(self.pieces, 2, 0), strict=True):
            lower, upper = joint["lower"], joint["upper"]
            if self.space == "q":
                own = joint.get("own_limits") or [None, None]
                lower, upper = (end if limit is None else limit for limit, end in zip(own, (lower, upper), strict=True))
                off = 0.0
            else:
                q = self._base[joint["index"]]
                lower, upper = (np.tan((x - q) / 2) if joint["kind"] == "revolute" else x - q for x in (lower, upper))
                off = 1e-12 * (1 + abs(lower) + abs(upper)) * (1 + max(lower * lower, upper * upper))
            if not (lower - off <= values.min() and values.max() <= upper + off):
                return False
        return True

    @cached_property
    def bound(self) -> float:
        """The least distance of the padded bodies that was found at a configuration of the motion or its tube, rounded upwards, metres.

        What is stated to be a lower bound of all distances must not be larger.
        """
        found = np.inf
        places = [(piece, t) for piece in range(len(self.pieces)) for t in self._times(piece)]
        q = np.array([self._position(piece, t) for piece, t in places])
        for a, b, *_ in self.scene["pairs"]:
            gaps = [self._distance(a, b, x) for x in q]
            for worst in dict.fromkeys(np.argsort(gaps)[:2].tolist()):
                piece, t = places[worst]
                t = self._descended(a, b, piece, t)
                found = min(found, self._exactly(a, b, piece, t, np.zeros(len(self._moving))))
                if self.rho:
                    found = min(found, self._exactly(a, b, piece, t, self._corner(a, b, self._position(piece, t))))
        return found

    def _times(self, piece: int) -> list[float]:
        until = self.end if piece == len(self.pieces) - 1 else 1.0
        ends = self._arrays["ends"]
        ends = ends[ends <= until]
        ends = ends[:: max(1, len(ends) // TIMES)]
        return sorted({*np.linspace(0, until, TIMES).tolist(), *ends.tolist()})

    def _coordinates(self, piece: int, t: float) -> np.ndarray:
        points = self.pieces[piece]
        while len(points) > 1:
            points = (1 - t) * points[:-1] + t * points[1:]
        return points[0]

    def _position(self, piece: int, t: float) -> np.ndarray:
        x = self._coordinates(piece, t)
        return x if self.space == "q" else self._base + np.where(self._turns, 2 * np.arctan(x), x)

    def _descended(self, a: str, b: str, piece: int, t: float) -> float:
        """The time near by at which the bodies are nearest, by golden section."""
        until = self.end if piece == len(self.pieces) - 1 else 1.0
        low, high = max(0.0, t - until / TIMES), min(until, t + until / TIMES)
        at = {x: self._distance(a, b, self._position(piece, x)) for x in (low, t, high)}
        for _ in range(STEPS):
            x, y = high - _SHRINK * (high - low), low + _SHRINK * (high - low)
            at |= {z: self._distance(a, b, self._position(piece, z)) for z in (x, y)}
            low, high = (low, y) if at[x] < at[y] else (x, high)
        return min(at, key=lambda z: at[z])

    def _corner(self, a: str, b: str, q: np.ndarray) -> np.ndarray:
        """How far each joint of the tube is off where the bodies are nearer, one joint after the other."""
        off = np.zeros(len(q))
        for i in range(len(q)):
            choices = []
            for sign in (-1.0, 0.0, 1.0):
                off[i] = sign * self.rho
                choices.append((self._distance(a, b, q + off), off[i]))
            off[i] = min(choices)[1]
        return off

    def _distance(self, a: str, b: str, q: np.ndarray) -> float:
        one, other = self._geometries[a], self._geometries[b]
        A, B = (self._placed(geometry, q) for geometry in (one, other))
        return closest(A, B).distance - one["radius"] - other["radius"] - 2 * self._padding(a, b)

    def _padding(self, a: str, b: str) -> float:
        own = [names[2] for names in self.scene["pairs"] if names[:2] == [a, b] and len(names) == 3]
        return own[0] if own else self.scene["padding"]

    def _placed(self, geometry: dict[str, Any], q: np.ndarray) -> np.ndarray:
        R, p, body = np.eye(3), np.zeros(3), geometry["body"]
        while body != "world":
            joint = self._above[body]
            X, last = self._frames[body]
            if joint["index"] is not None:
                x, axis = q[joint["index"]], np.array(joint["axis"], dtype=float)
                motion = np.eye(4)
                if joint["kind"] == "revolute":
                    motion[:3, :3] = Rotation.from_rotvec(x * axis).as_matrix()
                else:
                    motion[:3, 3] = x * axis
                X = X @ motion
            X = X @ last
            R, p, body = X[:3, :3] @ R, X[:3, :3] @ p + X[:3, 3], joint["parent"]
        return np.array(geometry["vertices"], dtype=float) @ R.T + p

    def _exactly(self, a: str, b: str, piece: int, t: float, off: np.ndarray) -> float:
        """An upper bound of the distance at a configuration, from two points of the bodies, in balls of 300 bits."""
        one, other = self._geometries[a], self._geometries[b]
        q = self._position(piece, t) + off
        weights = closest(*(self._placed(geometry, q) for geometry in (one, other))).weights
        with ctx.workprec(300):
            points = [[_exact(x) for x in row] for row in self.pieces[piece]]
            while len(points) > 1:
                points = [[x + _exact(t) * (y - x) for x, y in zip(p, r, strict=True)] for p, r in pairwise(points)]
            x = points[0]
            if self.space == "s":
                x = [(2 * v.atan() if turns else v) + _exact(base) for v, turns, base in zip(x, self._turns, self._base, strict=True)]
            x = [v + _exact(d) for v, d in zip(x, off, strict=True)]
            ends = []
            for geometry, weight in zip((one, other), weights, strict=True):
                parts = [_exact(max(w, 0.0)) for w in weight]
                rows, whole = list(zip(parts, geometry["vertices"], strict=True)), sum(parts, arb(0))
                mean = [sum((w * _exact(v[i]) for w, v in rows), arb(0)) / whole for i in range(3)]
                ends.append(self._moved(geometry["body"], mean, x))
            square = sum(((u - v) ** 2 for u, v in zip(*ends, strict=True)), arb(0))
            reach = _exact(one["radius"]) + _exact(other["radius"]) + 2 * _exact(self._padding(a, b))
            upper = (arb(square.upper()).sqrt() if square.upper() > 0 else arb(0)) - reach
            return float(np.nextafter(float(upper.upper()), np.inf))

    def _moved(self, body: str, point: list[arb], q: list[arb]) -> list[arb]:
        """A point of a body in the world."""
        while body != "world":
            joint = self._above[body]
            point = _back(_rigid(joint["X_BM"]), point)
            if joint["index"] is not None:
                axis = [arb(x) for x in unit(np.array(joint["axis"], dtype=float).tobytes())]
                at = q[joint["index"]]
                if joint["kind"] == "revolute":
                    along, cross = sum((u * v for u, v in zip(axis, point, strict=True)), arb(0)), _cross(axis, point)
                    c, s = at.cos(), at.sin()
                    point = [c * v + s * w + (1 - c) * along * u for u, v, w in zip(axis, point, cross, strict=True)]
                else:
                    point = [v + at * u for u, v in zip(axis, point, strict=True)]
            X = _rigid(joint["X_PF"])
            point = [sum((X[i][k] * point[k] for k in range(3)), X[i][3]) for i in range(3)]
            body = joint["parent"]
        return point


def _exact(x: float) -> arb:
    return arb(fmpq(*float(x).as_integer_ratio()))


def _rigid(X: Any) -> list[list[arb]]:
    rows = rigid(np.array(X, dtype=float).tobytes())
    return [[arb(x / rows[3][3]) for x in row] for row in rows]


def _back(X: list[list[arb]], point: list[arb]) -> list[arb]:
    off = [point[k] - X[k][3] for k in range(3)]
    return [sum((X[k][i] * off[k] for k in range(3)), arb(0)) for i in range(3)]


def _cross(u: list[arb], v: list[arb]) -> list[arb]:
    return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
