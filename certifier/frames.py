"""Choice of the reference frame of a pair (C-IRIS B.1) and what the program costs in it.

Each side of a pair costs about (vertices) x N(k)^2 x (faces), N the dimension of B.2 with the k joints between frame and body, so the
frame sits in the middle of the chain, nearer to the body with more vertices.
"""

from __future__ import annotations

from dataclasses import dataclass

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
    scene = kinematics.scene
    a, b = volumes
    best: tuple[float, Frame] | None = None
    for body in kinematics.bodies_between(a.body, b.body):
        frame = Frame(body, _chain(kinematics, body, a.body), _chain(kinematics, body, b.body))
        sides = ((a, frame.chain_a), (b, frame.chain_b))
        cost = sum(len(volume.vertices) * dimension(len(chain), scene.n) ** 2 for volume, chain in sides)
        if best is None or cost < best[0]:
            best = cost, frame
    assert best is not None, "a path has at least one body"
    return best[1]


def _chain(kinematics: Kinematics, frame: str, body: str) -> tuple[int, ...]:
    return tuple(sorted(kinematics.chain(frame, body)))
