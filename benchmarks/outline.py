"""This module finds outlines of the set where a field on a grid is negative (marching squares)."""

from __future__ import annotations

import numpy as np

from certifier.model import Array

Corner = tuple[int, int]
Edge = tuple[Corner, Corner]

ROUND = ((0, 0), (1, 0), (1, 1), (0, 1))
"""The corners of a cell, in order around it."""


def outlines(field: Array) -> list[Array]:
    """Returns the closed boundaries of {field < 0}, in coordinates of the grid.

    Args:
        field: (nx, ny) values at the points (i, j); the set ends where the grid does.

    Returns:
        Loops, (k, 2) each: one around every connected part and every hole, for the even-odd rule. Between two neighbours of opposite
        sign the boundary is where the field, interpolated linearly, vanishes.
    """
    padded = np.pad(field, 1, constant_values=np.abs(field).max())
    next_edge = _links(padded < 0)
    loops = []
    while next_edge:
        edge = first = next(iter(next_edge))
        loop = []
        while True:
            loop.append(_crossing(padded, edge))
            edge = next_edge.pop(edge)
            if edge == first:
                break
        loops.append(np.clip(np.array(loop) - 1, 0, np.array(field.shape) - 1))
    return loops


def _links(inside: Array) -> dict[Edge, Edge]:
    """Returns a map from each edge that the boundary crosses to the edge that it crosses next."""
    links: dict[Edge, Edge] = {}
    counts = sum(inside[i : i + len(inside) - 1, j : j + inside.shape[1] - 1].astype(int) for i, j in ROUND)
    for i, j in np.argwhere((counts > 0) & (counts < len(ROUND))).tolist():
        corners = [(i + a, j + b) for a, b in ROUND]
        # On the way around the cell, the crossed edge that leaves the set is linked to the next one, which enters it again.
        crossed = [(a, b) for a, b in zip(corners, (*corners[1:], corners[0]), strict=True) if inside[a] != inside[b]]
        for here, there in zip(crossed, (*crossed[1:], crossed[0]), strict=True):
            if inside[here[0]]:
                links[_undirected(here)] = _undirected(there)
    return links


def _undirected(edge: Edge) -> Edge:
    return min(edge), max(edge)


def _crossing(field: Array, edge: Edge) -> tuple[float, float]:
    a, b = edge
    share = field[a] / (field[a] - field[b])
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
