"""Rows are appended to an array here without copying those that are there already."""

from __future__ import annotations

from typing import Self

import numpy as np

from certifier.model import Array


class Rows:
    """Holds rows of one width. What :meth:`plus` returns shares the memory, so only the newest of a series may be extended."""

    def __init__(self, rows: Array, buffer: Array | None = None) -> None:
        self.array = rows
        self._buffer = rows if buffer is None else buffer

    def plus(self, more: Array) -> Self:
        """Returns these rows and more; those here stay as they are. It takes time in proportion to ``more``, on average."""
        count, total = len(self.array), len(self.array) + len(more)
        buffer = self._buffer
        if total > len(buffer):
            buffer = np.empty((max(total, 2 * count), *self.array.shape[1:]), dtype=self.array.dtype)
            buffer[:count] = self.array
        buffer[count:total] = more
        return type(self)(buffer[:total], buffer)
