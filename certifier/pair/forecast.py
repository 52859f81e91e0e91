"""What certifying each pair will cost, before it is done: dimensions, memory and a time that orders and batches the work.

The time is a sum of what grows with the pair's size: :func:`terms`, each with its seconds in ``SECONDS``. They were fitted, nonnegative and
by relative error, to the mean processor time, verification included, of every size class (joints the plane moves with, N and vertices of A
and of B) among the certified pairs of the catalogue's scenes, each alone: ``ciris bench survey`` measures and fits again. Pairs that are
refuted take less, those that need a second program, or faces in joints that are not between their bodies, take more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from certifier.kinematics import Kinematics
from certifier.model import Array, Scene, Volume
from certifier.pair.frames import frames_to_try

SECONDS = np.array([1.8e-2, 3.4e-6, 7.6e-6, 1.2e-10])
"""Of the terms, on one thread of a 2.5 GHz core (docs/benchmarks.md)."""


@dataclass(frozen=True)
class PairCost:
    """Forecast for one pair: of what is tried first for it.

    Attributes:
        frame: body of the reference frame.
        chain_a, chain_b: position indices of the joints from the frame to either body.
        gram_a, gram_b: rows of the Gram matrices, 2^k.
        joints: how many the plane moves with; 0 for a plane at rest.
        N_a, N_b: dimensions of the polynomial spaces (B.2).
        rationals: vertices of both bodies.
        seconds: on one thread of a 2.5 GHz core, roughly.
        memory_bytes: of the solver's factors and tables, for whatever may be tried.
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
    """One forecast for every pair of the scene, in the order of ``scene.pairs``."""
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
    """What the time of a pair is a sum of, (4,): the pair; the corners of P's box in the joints that the plane moves with, at which the
    verifier bounds the normal; the coefficients of the rationals; their factorisations.
    """
    coefficients, factors = np.array(vertices) @ np.power.outer(np.array(N, dtype=float), [1, 3])
    return np.array([1.0, 2.0**joints, coefficients, factors])
