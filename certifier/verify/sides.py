"""How far vertices can be from the joints that move them, for many bodies at once: with this the verifier bounds how a motion moves them.

A *side* is a geometry as a frame sees it, over the chain of joints from the frame to the body. The joints of the sides stand in columns,
the last ones in the last column. So columns before the first joint of a short chain are empty, and count as joints that move nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from threading import Lock
from typing import NamedTuple

import numpy as np

from certifier.errors import ProofError
from certifier.model import Array, Scene
from certifier.verify.chains import UP, Chain, across, lengths
from certifier.verify.kinematics import ExactKinematics
from certifier.verify.places import Places


class Sides(NamedTuple):
    """Holds S sides with at most M joints.

    Attributes:
        ways: (S,) number of each side's chain, as :class:`Known` counts them.
        geometries: (S,) number of the geometry.
        radii: (S,) metres.
        moving: (S,) how many joints there are.
        joints: (S, M) position indices; 0 where there is no joint.
        turns: (S, M) whether there is a revolute joint.
        speeds: (S, M) by how many metres a prismatic joint slides for a metre of its position, rounded upwards; 0 where there is none.
        before: (S, M) lengths of the fixed poses before the joints, metres, rounded upwards.
        aside: (S, M) how far the pose behind each joint leads from its axis, rounded upwards; 0 for the last joint.
        tail, from_axis, size: (S,) how far the vertices are from the last joint and from its axis, and the sum of all lengths on the way
            to the farthest one, all rounded upwards.
    """

    ways: np.ndarray
    geometries: np.ndarray
    radii: Array
    moving: np.ndarray
    joints: np.ndarray
    turns: np.ndarray
    speeds: Array
    before: Array
    aside: Array
    tail: Array
    from_axis: Array
    size: Array

    def of(self, which: np.ndarray) -> Sides:
        """Returns some of the sides, (K,), in this order and as often as they are asked for."""
        return Sides(*(array[which] for array in self))

    def slid(self, reaches: Array) -> Array:
        """Returns how far the prismatic joints of K sides slide from 0 at most, (K, M) metres, where the positions are (K, n) from it."""
        found: Array = self.speeds * np.take_along_axis(reaches, self.joints, axis=1) * UP
        return found

    def levers(self, slid: Array) -> Array:
        """Returns how far vertices can be from the joints' axes, in metres, rounded upwards.

        These bound motion. They may be much less than :meth:`sizes`, because a body's frame may be far from the body.

        Args:
            slid: (K, M) as from :meth:`slid`, for K sides.

        Returns:
            (K, M) distances from the axes, the speed of a prismatic joint, 0 where there is none. A change of one position moves no vertex
            farther than by the joint's lever times the change.
        """
        levers = np.zeros_like(slid)
        levers[:, -1:] = self.from_axis[:, None]
        # Behind joint k come the offset across its axis, the slide of joint k + 1, all lengths behind that, and the tail.
        behind = np.cumsum((slid + self.before)[:, :0:-1], axis=1)[:, ::-1]
        levers[:, :-1] = self.aside[:, :-1] + slid[:, 1:] + self.tail[:, None]
        levers[:, :-2] += behind[:, 1:]
        return np.where(self.turns, levers * UP, self.speeds)

    def sizes(self, slid: Array) -> Array:
        """Returns the sum of all lengths on the way to the farthest vertices, (K,) metres, rounded upwards: what rounding is a part of.

        No two of the lengths are put together first, as what cancels in their sum does not cancel in what is rounded. The argument is that
        of :meth:`levers`.
        """
        found: Array = (self.size + slid.sum(axis=1)) * UP
        return found

    def errors(self, sizes: Array, inexact: float) -> Array:
        """Returns by how many metres the positions of vertices, of K sides with these sizes, are wrong at most, (K,).

        Args:
            inexact: by how much the joints' positions are wrong at most, in radians or metres.

        Raises:
            ProofError: it is too large for the bound to hold.
        """
        part = (self.moving + 3) * (2.0**-44 + 2 * inexact)
        if not (part < 2.0**-10).all():
            raise ProofError("proof_too_large", "the positions of the motion are too large for doubles to tell where the bodies are")
        return sizes * part + self.speeds.sum(axis=1) * UP * inexact

    def accelerations(self, levers: Array, rates: Array, changes: Array) -> Array:
        """Returns bounds of the accelerations of all vertices, (K,), from levers (K, M), rates and changes (K, n), rounded upwards.

        Joints i and then k on the path contribute twice the product of their rates times the lever of k, where i is revolute, and nothing
        where it is prismatic; a revolute joint alone contributes its lever times the square of its rate, and every joint its lever times
        its change. Nothing here is negative, so what is rounded is a part of it that UP makes good.
        """
        rates, changes = (np.take_along_axis(bounds, self.joints, axis=1) for bounds in (rates, changes))
        turning = np.where(self.turns, rates, 0.0)
        before = np.zeros_like(rates)  # of the revolute joints before each one
        np.cumsum(turning[:, :-1], axis=1, out=before[:, 1:])
        total = levers * (2 * before * rates + turning**2 + changes)
        found: Array = total.sum(axis=1) * UP
        return found


class Known:
    """Keeps what has been computed about a scene: chains, and sides. Several threads may ask at once.

    Attributes:
        pairs: (2, P) the numbers of the geometries a and b of every pair.
        vertices: (P,) how many vertices both have.
        chains: those that were asked about, by their numbers.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene, self._places, self._kinematics = scene, Places(scene), ExactKinematics.by_joint(scene)
        bodies = {body: i for i, body in enumerate(scene.bodies)}
        self._body = np.array([bodies[geometry.body] for geometry in scene.geometries], dtype=np.int64)
        number = {geometry.name: i for i, geometry in enumerate(scene.geometries)}
        self.pairs = np.array([(number[pair.a], number[pair.b]) for pair in scene.pairs], dtype=np.int64).reshape(-1, 2).T
        self.vertices = np.array([len(geometry.vertices) for geometry in scene.geometries], dtype=np.int64)[self.pairs].sum(axis=0)
        self._ways: dict[tuple[int, int], int] = {}
        self._lengths: dict[tuple[int, int], int] = {}
        self._sides: dict[tuple[int, int], int] = {}
        self._made: list[Sides] = []
        self._lock = Lock()
        self._all: Sides | None = None
        self.chains: list[Chain] = []

    def joints(self, frames: np.ndarray, geometries: np.ndarray) -> np.ndarray:
        """Returns how many joints, with those that do not move, are between frames, (K,) numbers of bodies, and geometries, (K,)."""
        ways, where = np.unique(frames * len(self._scene.bodies) + self._body[geometries], return_inverse=True)
        return np.array([self._joints(*divmod(way, len(self._scene.bodies))) for way in ways.tolist()])[where]

    def sides(self, frames: np.ndarray, geometries: np.ndarray) -> tuple[Sides, np.ndarray]:
        """Returns all sides that are known, and the numbers of those of geometries, (K,), as frames, (K,) numbers of bodies, see them."""
        asked, where = np.unique(frames * len(self._body) + geometries, return_inverse=True)
        with self._lock:
            number = np.array([self._side(*divmod(side, len(self._body))) for side in asked.tolist()])
            if self._all is None or len(self._all.ways) < len(self._made):
                self._all = _joined(self._made)
            return self._all, number[where]

    def _joints(self, frame: int, body: int) -> int:
        if (frame, body) not in self._lengths:
            self._lengths[frame, body] = len(self._kinematics.path(self._scene.bodies[frame], self._scene.bodies[body]))
        return self._lengths[frame, body]

    def _way(self, frame: int, body: int) -> int:
        if (frame, body) not in self._ways:
            self.chains.append(self._places.chain(self._scene.bodies[frame], self._scene.bodies[body]))
            self._ways[frame, body] = len(self.chains) - 1
        return self._ways[frame, body]

    def _side(self, frame: int, geometry: int) -> int:
        if (frame, geometry) not in self._sides:
            way = self._way(frame, int(self._body[geometry]))
            shape = self._scene.geometries[geometry]
            self._made.append(_side(way, geometry, shape.radius, self.chains[way], shape.vertices))
            self._sides[frame, geometry] = len(self._made) - 1
        return self._sides[frame, geometry]


def _side(way: int, geometry: int, radius: float, chain: Chain, vertices: Array) -> Sides:
    """Returns one side, with as many columns as it has joints."""
    reach, fixed, m = chain.reach(vertices), lengths(chain.offsets), len(chain.joints)
    aside = np.zeros((1, m))
    aside[0, : m - 1] = across(chain.axes[:-1], chain.offsets[1:-1])
    return Sides(
        ways=np.array([way]),
        geometries=np.array([geometry]),
        radii=np.array([radius]),
        moving=np.array([m]),
        joints=chain.joints[None],
        turns=chain.speeds[None] == 0,
        speeds=chain.speeds[None],
        before=fixed[None, :-1],
        aside=aside,
        tail=np.array([reach.tail]),
        from_axis=np.array([reach.across]),
        size=np.array([reach.vertices + float(fixed.sum())]),
    )


def _joined(sides: Sequence[Sides]) -> Sides:
    """Returns sides as one, with their joints in the last columns."""
    most = max(one.joints.shape[1] for one in sides)
    return Sides(*(np.concatenate([_widened(array, most) for array in arrays]) for arrays in zip(*sides, strict=True)))


def _widened(array: np.ndarray, columns: int) -> np.ndarray:
    """Returns an array of two dimensions with columns of 0 before the others; one of a single dimension remains as it is."""
    return array if array.ndim == 1 else np.pad(array, ((0, 0), (columns - array.shape[1], 0)))
