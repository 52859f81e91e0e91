"""An obstacle is a pair for which a growing region was cut: how much was cut off, and at which configuration the pair failed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from certifier.model import Array, Scene
from certifier.polytopes.cutting import lost_together


@dataclass(frozen=True)
class Obstacle:
    """Says what was cut off for a pair in the last stage in which something was.

    Attributes:
        stage: the number of that stage. The papers' algorithm has none and counts what it begins in its place.
        times: in how many rounds something was cut off.
        faces: how many faces were added or moved in; None where only the times are known.
        lost: the shares of the polytope that these faces cut off, by q-volume, as samples say; None where that is not known.
        s: a configuration at which the pair failed, in s; None where none is known.
        contact: the bodies touch at s, as far as floating point can tell.
    """

    stage: int
    times: int
    faces: int | None = None
    lost: float | None = None
    s: tuple[float, ...] | None = None
    contact: bool = False

    def further(self, other: Obstacle) -> Obstacle:
        """Returns this obstacle with what one more round has cut off; the round that lost more says at which configuration."""
        if other.stage != self.stage:
            return other
        shown = other if self.s is None or (other.lost or 0.0) > (self.lost or 0.0) else self
        faces = None if self.faces is None or other.faces is None else self.faces + other.faces
        lost = None if self.lost is None or other.lost is None else lost_together(self.lost, other.lost)
        return Obstacle(self.stage, self.times + other.times, faces, lost, shown.s, shown.contact)

    @classmethod
    def at(cls, stage: int, s: Array | None, *, contact: bool, faces: int | None = None, lost: float | None = None) -> Obstacle:
        """Returns what one round has cut off; ``s`` is (n,)."""
        return cls(stage, 1, faces, lost, None if s is None else tuple(map(float, s)), contact)


def joined(known: dict[int, Obstacle], found: dict[int, Obstacle]) -> dict[int, Obstacle]:
    """Returns pair index -> obstacle, with what one more round has cut off."""
    return known | {index: known[index].further(new) if index in known else new for index, new in found.items()}


def in_manifest(scene: Scene, obstacles: dict[int, Obstacle]) -> list[dict[str, Any]]:
    """Returns what the manifest of a region says of the pairs that cut it, those for which most was lost first; ``q`` is in q."""
    order = sorted(obstacles, key=lambda index: (-(obstacles[index].lost or 0.0), -obstacles[index].times, index))
    return [
        {
            "a": scene.pairs[index].a,
            "b": scene.pairs[index].b,
            "times": one.times,
            "faces": one.faces,
            "lost": one.lost,
            "q": None if one.s is None else scene.to_q(one.s).tolist(),
            "contact": one.contact,
        }
        for index in order
        for one in [obstacles[index]]
    ]
