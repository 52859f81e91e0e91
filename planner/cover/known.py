"""What is known of the regions that a scene has: which there are, and which are connected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from certifier.model import Array
from planner.library import Library
from planner.overlap import components


@dataclass(frozen=True)
class Known:
    """The regions of a scene as a graph.

    Attributes:
        library: the regions.
        ends: (e, 2) numbers of regions that overlap.
        witnesses: (e, n) a point in s inside of both.
        parts: the connected components: the numbers of their regions.
    """

    library: Library
    ends: NDArray[np.intp]
    witnesses: Array
    parts: Sequence[Sequence[int]]

    @classmethod
    def of(cls, library: Library, edges: Sequence[tuple[int, int, Sequence[float]]]) -> Known:
        """Returns the graph of a library whose regions overlap like this: two regions, and a point in s inside of both."""
        ends = np.array([edge[:2] for edge in edges], dtype=np.intp).reshape(-1, 2)
        witnesses = np.array([edge[2] for edge in edges], dtype=float).reshape(-1, library.n)
        return cls(library, ends, witnesses, components(len(library), [edge[:2] for edge in edges]))

    def ordered(self, order: Sequence[int] | NDArray[np.intp]) -> Known:
        """Returns the same with the components in this order."""
        return replace(self, parts=[self.parts[i] for i in order])

    @cached_property
    def part_of(self) -> NDArray[np.intp]:
        """Returns the number of each region's component, (R,)."""
        found = np.zeros(len(self.library), dtype=np.intp)
        for number, regions in enumerate(self.parts):
            found[list(regions)] = number
        return found

    def witnesses_in(self, part: int) -> Array:
        """Returns the points in s, (k, n), where regions of a component overlap."""
        return self.witnesses[self.part_of[self.ends[:, 0]] == part]
