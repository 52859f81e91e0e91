"""How every pair is seen from the frames of the links between its geometries, as arrays for the compiled loops of this room.

A *view* is a geometry as the frame of a link sees it: over the chain of joints that leads to it. A pair has a *choice* of frames, in each
of which a plane between the geometries may be constant.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numba import njit

from certifier.kinematics import Kinematics
from certifier.model import Array, Scene
from certifier.motion.bodies import bodies_of
from certifier.motion.chains import chain, fill_levers, lengths


class Views(NamedTuple):
    """Holds W views with J joints in all, and C choices of P pairs.

    Attributes:
        begins: (W + 1,) where each view's joints begin in the arrays below, and J.
        joints, speeds: (J,) of the chains (certifier.motion.chains.Chain).
        offsets, across: (J,) of the chains (certifier.motion.chains.Lengths).
        tails, tails_across, sizes: (W,) of the chains.
        first: (P + 1,) where each pair's choices begin, and C.
        frames: (C,) the link in whose frame a and b are seen.
        sides: (C, 2) the views of a and of b.
        ways: (L,) the sum of all lengths from the world to each link, metres, but for what prismatic joints add.
    """

    begins: np.ndarray
    joints: np.ndarray
    speeds: Array
    offsets: Array
    across: Array
    tails: Array
    tails_across: Array
    sizes: Array
    first: np.ndarray
    frames: np.ndarray
    sides: np.ndarray
    ways: Array


@lru_cache(maxsize=16)
def views_of(scene: Scene) -> Views:
    """Returns how the pairs of a scene are seen."""
    bodies, kinematics = bodies_of(scene), Kinematics.of(scene)
    number: dict[tuple[int, int], int] = {}
    between, frames, sides, first = dict[tuple[int, int], list[int]](), [], [], [0]
    for a, b in bodies.pairs.tolist():
        ends = int(bodies.links[a]), int(bodies.links[b])
        if ends not in between:
            between[ends] = _between(bodies.parents, *ends)
        for frame in between[ends]:
            frames.append(frame)
            sides.append([number.setdefault((frame, geometry), len(number)) for geometry in (a, b)])
        first.append(len(frames))
    roots = [scene.bodies[root] for root in bodies.roots]
    chains = [chain(kinematics, roots[frame], scene.geometries[geometry].body) for frame, geometry in number]
    measured = [lengths(one, scene.geometries[geometry].vertices) for one, (_, geometry) in zip(chains, number, strict=True)]
    ways = np.linalg.norm(bodies.offsets, axis=1)
    for link in range(1, len(ways)):
        ways[link] += ways[bodies.parents[link]]
    return Views(
        begins=np.array([0, *accumulate(len(one.joints) for one in chains)], dtype=np.int64),
        joints=np.concatenate([np.zeros(0, dtype=np.int64), *(one.joints for one in chains)]),
        speeds=np.concatenate([np.zeros(0), *(one.speeds for one in chains)]),
        offsets=np.concatenate([np.zeros(0), *(one.offsets for one in measured)]),
        across=np.concatenate([np.zeros(0), *(one.across for one in measured)]),
        tails=np.array([one.tail for one in measured]),
        tails_across=np.array([one.tail_across for one in measured]),
        sizes=np.array([one.size for one in measured]),
        first=np.array(first, dtype=np.int64),
        frames=np.array(frames, dtype=np.int64),
        sides=np.array(sides, dtype=np.int64).reshape(-1, 2),
        ways=ways,
    )


def _between(parents: np.ndarray, a: int, b: int) -> list[int]:
    """Returns the links on the way from link a to link b, with both of them."""
    up, down = [a], [b]
    while up[-1] != down[-1]:
        longer = up if up[-1] > down[-1] else down  # a link's number is larger than its parent's
        longer.append(int(parents[longer[-1]]))
    return up + down[-2::-1]


@njit(cache=True)
def levers_of(views: Views, reaches: Array) -> tuple[Array, Array]:
    """Returns the levers of all joints, (J,), and the sizes of all views with what their prismatic joints add, (W,), in metres.

    Args:
        reaches: (n,) how far each joint's position is from 0 at most.
    """
    levers, sizes = np.empty(len(views.joints)), np.empty(len(views.sizes))
    for view in range(len(sizes)):
        own = slice(views.begins[view], views.begins[view + 1])
        chain = views.joints[own], views.speeds[own], views.offsets[own], views.across[own]
        sizes[view] = views.sizes[view] + fill_levers(*chain, views.tails[view], views.tails_across[view], reaches, levers[own])
    return levers, sizes


@njit(cache=True)
def acceleration(views: Views, view: int, levers: Array, rates: Array, changes: Array) -> float:
    """Returns a bound of every vertex' acceleration, in metres, for bounds of the joints' rates and of the rates' changes, (n,)."""
    turning, total = 0.0, 0.0
    for k in range(views.begins[view], views.begins[view + 1]):
        rate, change = rates[views.joints[k]], changes[views.joints[k]]
        if views.speeds[k] > 0.0:
            total += levers[k] * (2.0 * turning * rate + change)
        else:
            total += levers[k] * (rate * (rate + 2.0 * turning) + change)
            turning += rate
    return total


@njit(cache=True)
def moved(views: Views, view: int, levers: Array, rates: Array) -> float:
    """Returns how far joints that move by this much, (n,), move a vertex at most."""
    total = 0.0
    for k in range(views.begins[view], views.begins[view + 1]):
        total += levers[k] * rates[views.joints[k]]
    return total
