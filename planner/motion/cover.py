"""A piece of a motion is covered here, region by region from its start."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol


class Line(Protocol):
    """A straight or curved motion. Its parameter t goes from 0 to 1 and is exact, in whatever kind of number the line counts."""

    def furthest(self, t: Any) -> tuple[int, Any] | None:
        """Returns a region that is proved to contain the line from t to as far as any, and the parameter where that ends.

        None where no region is proved to contain the point at t.
        """


@dataclass(frozen=True)
class Piece:
    """Says that a region contains all of a line from begin to end, 0 <= begin <= end <= 1. Region is its number in the library."""

    begin: float
    end: float
    region: int


@dataclass(frozen=True)
class Cover:
    """Says how much of a line is covered.

    Attributes:
        pieces: in order; each begins where the one before ends. They are proved for the exact parameters, of which begin and end are the
            doubles that are nearest.
        uncovered: where the pieces end, if that is not the line's end. The next points of the line, or this one, are not proved to be in
            any region.
    """

    pieces: tuple[Piece, ...]
    uncovered: float | None


def cover(line: Line) -> Cover:
    """Covers a line with as few regions as possible, as far as it is covered from its start on without a gap."""
    pieces: list[Piece] = []
    t: Any = 0
    while True:
        found = line.furthest(t)
        if found is None or found[1] == t != 1:
            return Cover(tuple(pieces), float(t))
        region, end = found
        pieces.append(Piece(float(t), float(end), region))
        if end == 1:
            return Cover(tuple(pieces), None)
        t = end
