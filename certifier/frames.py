"""Choice of the reference frame of a pair (C-IRIS B.1) and what the program costs in it.

Each side of a pair costs about (vertices) x N(k)^2 x (faces), N the dimension of B.2 with the k joints between frame and body, so the
frame sits in the middle of the chain, nearer to the body with more vertices.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from certifier.basis import dimension
from certifier.kinematics import Kinematics
from certifier.proof import Volume


@dataclass(frozen=True)
class Frame:
    """The frame body F of a pair and the chains to both sides (position indices, ascending)."""

    body: str
    chain_a: tuple[int, ...]
    chain_b: tuple[int, ...]


def choose_frame(kinematics: Kinematics, volumes: tuple[Volume, Volume]) -> Frame:
    """The cheapest frame on the path between the two volumes' bodies; ties go to the one nearer to a."""
    a, b = volumes
    return _cheapest(kinematics, a.body, b.body, len(a.vertices), len(b.vertices))


@lru_cache(maxsize=4096)
def _cheapest(kinematics: Kinematics, a: str, b: str, vertices_a: int, vertices_b: int) -> Frame:
    n = kinematics.scene.n
    best: tuple[float, Frame] | None = None
    for body in kinematics.bodies_between(a, b):
        frame = Frame(body, _chain(kinematics, body, a), _chain(kinematics, body, b))
        sides = ((vertices_a, frame.chain_a), (vertices_b, frame.chain_b))
        cost = sum(vertices * dimension(len(chain), n) ** 2 for vertices, chain in sides)
        if best is None or cost < best[0]:
            best = cost, frame
    assert best is not None, "a path has at least one body"
    return best[1]


def _chain(kinematics: Kinematics, frame: str, body: str) -> tuple[int, ...]:
    return tuple(sorted(kinematics.chain(frame, body)))
