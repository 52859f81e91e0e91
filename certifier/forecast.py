"""What certifying each pair will cost, before it is done: dimensions, memory and a time that orders and batches the work."""

from __future__ import annotations

from dataclasses import dataclass

from certifier.basis import dimension
from certifier.frames import choose_frame
from certifier.kinematics import Kinematics
from certifier.model import Scene
from certifier.proof import Volume

_SECONDS_PER_FLOP = 1.0e-10
_SECONDS_PER_RATIONAL = 5e-4
_ITERATIONS = 9
_FACES = 14


@dataclass(frozen=True)
class PairCost:
    """Forecast for one pair.

    Attributes:
        frame: body of the reference frame.
        chain_a, chain_b: position indices of the joints from the frame to either body.
        gram_a, gram_b: rows of the Gram matrices, 2^k.
        N_a, N_b: dimensions of the polynomial spaces (B.2).
        rationals: vertices of both bodies.
        seconds: on one thread of a 2.5 GHz core, roughly.
        memory_bytes: peak of the solver's factors.
    """

    a: str
    b: str
    frame: str
    chain_a: tuple[int, ...]
    chain_b: tuple[int, ...]
    gram_a: int
    gram_b: int
    N_a: int
    N_b: int
    rationals: int
    seconds: float
    memory_bytes: int


def forecast(scene: Scene) -> list[PairCost]:
    """One forecast for every pair of the scene, in the order of ``scene.pairs``."""
    kinematics = Kinematics(scene)
    costs = []
    for pair in scene.pairs:
        volumes = (Volume.of(scene.geometry(pair.a)), Volume.of(scene.geometry(pair.b)))
        frame = choose_frame(kinematics, volumes)
        vertices = [len(volume.vertices) for volume in volumes]
        lengths = [len(frame.chain_a), len(frame.chain_b)]
        N = [dimension(k, scene.n) for k in lengths]
        flops = sum(
            v * (n**3 / 3 + 2 * n**2 * (4 * scene.n + 5) + 4 * _FACES * dimension(k, k) ** 2 * 2**k)
            for v, n, k in zip(vertices, N, lengths, strict=True)
        )
        memory = sum(8 * v * n * (n + 2 * (4 * scene.n + 5)) for v, n in zip(vertices, N, strict=True))
        seconds = _ITERATIONS * (flops * _SECONDS_PER_FLOP + sum(vertices) * _SECONDS_PER_RATIONAL)
        gram_a, gram_b = (2**k for k in lengths)
        costs.append(
            PairCost(pair.a, pair.b, frame.body, frame.chain_a, frame.chain_b, gram_a, gram_b, N[0], N[1], sum(vertices), seconds, memory)
        )
    return costs
