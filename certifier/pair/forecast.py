"""The cost of certifying each pair is forecast here: dimensions, memory, and a time by which the work is ordered and batched.

The time is a sum of :func:`terms` that grow with the pair's size, each multiplied by its seconds in ``SECONDS``.

The seconds are a nonnegative fit by relative error, and ``ciris bench survey`` measures and fits again. What was fitted is the mean
processor time, verification included, of every size class among the certified pairs of the catalogue's scenes, each pair alone. A size
class is given by the joints that the plane moves with and by N and the vertices of A and of B.

Pairs that are refuted take less time. Pairs that need a second program take more, and so do those that need faces in joints that are
not between their bodies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from certifier.kinematics import Kinematics
from certifier.model import Array, Scene, Volume
from certifier.pair.frames import frames_to_try

SECONDS = np.array([1.8e-2, 3.4e-6, 7.6e-6, 1.2e-10])
"""One unit of each term takes this many seconds, on one thread of a 2.5 GHz core (docs/benchmarks.md)."""


@dataclass(frozen=True)
class PairCost:
    """Holds the forecast for one pair, for what is tried first for it.

    Attributes:
        frame: body of the reference frame.
        chain_a, chain_b: position indices of the joints from the frame to either body.
        gram_a, gram_b: rows of the Gram matrices, 2^k.
        joints: how many joints the plane moves with; 0 for a plane at rest.
        N_a, N_b: dimensions of the polynomial spaces (B.2).
        rationals: number of vertices of both bodies together.
        seconds: time on one thread of a 2.5 GHz core, roughly.
        memory_bytes: size of the solver's factors and tables; enough for everything that may be tried.
    """

    a: str
    b: str
    frame: str
    chain_a: tuple[int, ...]
    chain_b: tuple[int, ...]
    gram_a: int
    gram_b: int
    joints: int
    N_a: int
    N_b: int
    rationals: int
    seconds: float
    memory_bytes: int


def forecast(scene: Scene) -> list[PairCost]:
    """Returns one forecast for every pair of the scene, in the order of ``scene.pairs``."""
    kinematics = Kinematics.of(scene)
    costs = []
    for pair in scene.pairs:
        volumes = (Volume.of(scene.geometry(pair.a)), Volume.of(scene.geometry(pair.b)))
        frames = frames_to_try(kinematics, volumes)
        frame, memory = frames[0], max(frame.memory(volumes) + frame.tables for frame in frames)
        vertices = [len(volume.vertices) for volume in volumes]
        lengths, N = [len(frame.chain_a), len(frame.chain_b)], list(frame.dimensions)
        seconds = float(terms(len(frame.joints), vertices, N) @ SECONDS)
        gram_a, gram_b = (2**k for k in lengths)
        costs.append(
            PairCost(
                pair.a,
                pair.b,
                frame.body,
                frame.chain_a,
                frame.chain_b,
                gram_a,
                gram_b,
                len(frame.joints),
                N[0],
                N[1],
                sum(vertices),
                seconds,
                memory,
            )
        )
    return costs


def terms(joints: int, vertices: list[int], N: list[int]) -> Array:
    """Returns the terms that the time of a pair is a sum of, (4,).

    They are 1 for the pair itself; the corners of P's box in the joints that the plane moves with, at which the verifier bounds the normal;
    the coefficients of the rationals; and the factorisations of the rationals.
    """
    coefficients, factors = np.array(vertices) @ np.power.outer(np.array(N, dtype=float), [1, 3])
    return np.array([1.0, 2.0**joints, coefficients, factors])
