"""A straight motion in q is followed here through regions, and through the tubes of proved motions beside them."""

from __future__ import annotations

from certifier.model import Array
from planner.motion.cover import Line
from planner.tubes import Tubes


class Beside:
    """The straight line in q from a to b, (n,) each, that regions cover as ``line`` says, and tubes cover as well.

    A tube counts as region number ``regions`` plus the number of its motion.
    """

    def __init__(self, line: Line, tubes: Tubes, regions: int, a: Array, b: Array) -> None:
        self._line, self._regions, self._tubes = line, regions, tubes
        self._lines, self._spans = tubes.spans(a, b)

    def furthest(self, t: float) -> tuple[int, float] | None:
        """Returns the region or the tube that is proved to contain the line from t to as far as any, and the parameter where that ends."""
        found: tuple[int, float] | None = self._line.furthest(t)
        here = (self._spans[:, 0] <= t) & (t <= self._spans[:, 1])
        if here.any() and (found is None or found[1] < 1):
            last = int(self._spans[here, 1].argmax())
            if found is None or self._spans[here, 1][last] > found[1]:
                return self._regions + int(self._tubes.motion[self._lines[here][last]]), float(self._spans[here, 1][last])
        return found
