"""A grid finds the boxes that a point may be in.

Each axis is divided into cells. For each cell of each axis, the grid holds one bit a box: whether the box reaches into the cell. The
boxes that a point may be in have their bits in its cells of all axes. So a point costs one AND of words for every axis, whatever the
number of boxes that are far away.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from certifier.model import Array

CELLS = 256
_WORD = 64


class BoxGrid:
    """Finds the boxes, of R >= 0 in n dimensions, that points may be in.

    Args:
        lower: (R, n) lower corners.
        upper: (R, n) upper corners.
    """

    def __init__(self, lower: Array, upper: Array) -> None:
        corners = np.concatenate([lower, upper]) if len(lower) else np.zeros((1, lower.shape[1]))
        self._edges = np.quantile(corners, np.linspace(0, 1, CELLS + 1)[1:-1], axis=0).T
        words = max(1, -(-2 * len(lower) // _WORD))
        self._bits = np.zeros((lower.shape[1], CELLS, words), dtype=np.uint64)
        self._count = 0
        self._fill(lower, upper)

    def plus(self, lower: Array, upper: Array) -> BoxGrid:
        """Returns a grid of all these boxes, of which the first are those of this grid. This grid stays as it is."""
        if len(lower) > self._bits.shape[2] * _WORD:
            return BoxGrid(lower, upper)
        grid = BoxGrid.__new__(BoxGrid)
        grid._edges, grid._bits, grid._count = self._edges, self._bits.copy(), self._count
        grid._fill(lower, upper)
        return grid

    def _fill(self, lower: Array, upper: Array) -> None:
        """Sets the bits of the boxes that are new."""
        begin = self._count // 8 * 8
        octets = self._bits.view(np.uint8)[:, :, begin // 8 : -(-len(lower) // 8)]
        cell = np.arange(CELLS)[:, None]
        for edges, low, high, axis in zip(self._edges, lower[begin:].T, upper[begin:].T, octets, strict=True):
            reaches = (np.searchsorted(edges, low) <= cell) & (cell <= np.searchsorted(edges, high))
            axis[:] = np.packbits(reaches, axis=1, bitorder="little")
        self._count = len(lower)

    def candidates(self, s: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Returns which points (k, n) may be in which boxes: the points' and the boxes' numbers, (c,) each.

        Every box that contains a point is among them.
        """
        words = self._bits[0].take(np.searchsorted(self._edges[0], s[:, 0]), axis=0)
        for bits, edges, x in zip(self._bits[1:], self._edges[1:], s.T[1:], strict=True):
            words &= bits.take(np.searchsorted(edges, x), axis=0)
        point, word = np.nonzero(words)
        bits = np.unpackbits(words[point, word].view(np.uint8).reshape(-1, 8), axis=1, bitorder="little")
        entry, bit = np.nonzero(bits)
        return point[entry], word[entry] * _WORD + bit
