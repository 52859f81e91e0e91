"""A straight motion in q is followed here through regions, and through what else is proved beside them: tubes of motions, and a map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from certifier.model import Array
from ciris.free_set import FreeSet
from planner.motion.cover import Line
from planner.tubes import Tubes


class Beside:
    """The straight line in q from a to b, (n,) each, that regions cover as ``line`` says, and tubes and a map cover as well.

    A tube counts as region number ``regions`` plus the number of its motion, and the map comes after the last tube.
    """

    def __init__(self, line: Line, tubes: Tubes | None, free: FreeSet | None, regions: int, a: Array, b: Array) -> None:
        self._line = line
        numbers, spans = np.zeros(0, dtype=np.intp), np.zeros((0, 2))
        if tubes is not None:
            lines, spans = tubes.spans(a, b)
            numbers = regions + tubes.motion[lines]
        if free is not None:
            parts = _spans(free, a, b)
            after = regions + (0 if tubes is None else len(tubes))
            numbers, spans = np.append(numbers, np.full(len(parts), after)), np.concatenate([spans, parts])
        self._numbers: NDArray[np.intp] = numbers
        self._spans = spans

    def furthest(self, t: float) -> tuple[int, float] | None:
        """Returns what is proved to contain the line from t to as far as any, and the parameter where that ends."""
        found: tuple[int, float] | None = self._line.furthest(t)
        here = (self._spans[:, 0] <= t) & (t <= self._spans[:, 1])
        if here.any() and (found is None or found[1] < 1):
            last = int(self._spans[here, 1].argmax())
            if found is None or self._spans[here, 1][last] > found[1]:
                return int(self._numbers[here][last]), float(self._spans[here, 1][last])
        return found


def _spans(free: FreeSet, a: Array, b: Array) -> Array:
    """Returns from when to when the motion from a to b is in a free set, (k, 2); nowhere where an end is beyond the joint limits."""
    ends = np.array([a, b])
    if not ((free.space.q_lower <= ends) & (ends <= free.space.q_upper)).all():
        return np.zeros((0, 2))
    return free.proved_parts(a, b)
