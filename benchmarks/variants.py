"""These variants of the 7-joint example have the same arm, with other figures about its links and other furniture before it."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from benchmarks.arms import box
from certifier.model import WORLD, Array, Geometry, Pair, Scene

CHAMFER = 0.15
"""The polytopes' chamfers take away this part of every edge at either end."""


def _box(link: Geometry, index: int) -> Iterator[Geometry]:
    yield link


def _balls(cells: tuple[int, int, int]) -> Callable[[Geometry, int], Iterator[Geometry]]:
    """Covers the box with balls about its cells.

    Args:
        cells: number of cells along the box's shortest, middle and longest edge.
    """

    def figure(link: Geometry, index: int) -> Iterator[Geometry]:
        center, half = _extent(link)
        counts = np.empty(3)
        counts[np.argsort(half)] = cells
        for number, cell in enumerate(itertools.product(*(range(int(k)) for k in counts))):
            offset = half * ((2 * np.array(cell) + 1) / counts - 1)
            yield _round(f"{link.body}/ball{number}", link.body, (center + offset)[None], float(np.linalg.norm(half / counts)))

    return figure


def _primitive(link: Geometry, index: int) -> Iterator[Geometry]:
    """Yields, by turns, a capsule about the middle of the box, the box itself, and a ball."""
    center, half = _extent(link)
    longest = int(np.argmax(half))
    along = np.eye(3)[longest] * half[longest]
    radius = float(np.linalg.norm(np.delete(half, longest)))
    yield (
        _round(f"{link.body}/capsule", link.body, np.array([center - along, center + along]), radius),
        link,
        _round(f"{link.body}/ball", link.body, center[None], float(half.max())),
    )[index % 3]


def _polytope(link: Geometry, index: int) -> Iterator[Geometry]:
    """Yields the box with its corners cut off, which has 24 vertices."""
    center, half = _extent(link)
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    cut = np.ones((3, 3)) - 2 * CHAMFER * np.eye(3)
    vertices = center + half * (corners[:, None] * cut).reshape(-1, 3)
    yield Geometry(f"{link.body}/polytope", link.body, vertices, 0.0, {"kind": "convex"})


FIGURES = {"box": _box, "sphere": _balls((1, 2, 2)), "dense": _balls((1, 2, 3)), "primitive": _primitive, "polytope": _polytope}

_SIDES = ((-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0))
FURNITURE = {
    "cupboard": [
        ((0.018, 0.7, 1.2), (1.03, 0.0, 0.6)),
        *(((0.35, 0.7, 0.018), (0.85, 0.0, z)) for z in (0.009, 0.4, 0.8, 1.191)),
        *(((0.35, 0.018, 1.2), (0.85, y, 0.6)) for y in (-0.359, 0.359)),
        *(((0.35, 0.018, 1.2), (0.49, y, 0.6)) for y in (-0.38, 0.38)),
    ],
    "bins": [
        part
        for y in (-0.45, 0.45)
        for part in (
            ((0.5, 0.4, 0.02), (0.5, y, 0.01)),
            *(((0.02 if i else 0.5, 0.4 if i else 0.02, 0.2), (0.5 + 0.24 * i, y + 0.19 * j, 0.12)) for i, j in _SIDES),
        )
    ],
    "tables": [
        part
        for x in (-0.8, 0.8)
        for part in (
            ((0.6, 1.2, 0.04), (x, 0.0, 0.24)),
            *(((0.05, 0.05, 0.22), (x + 0.26 * i, 0.55 * j, 0.11)) for i, j in itertools.product((-1, 1), repeat=2)),
        )
    ],
}
"""Each piece of furniture is a list of boxes, given by their sizes and centres in metres."""


def variant(example: Scene, figure: str, furniture: str | None) -> Scene:
    """Returns the example with this figure about every link and, if named, this furniture in place of the example's own.

    Figures are paired where their links are paired in the example. A link that is paired with the first piece of the example's furniture
    is paired with every piece of the new furniture.
    """
    links = [g for g in example.geometries if _on_arm(g)]
    figures = {link.name: list(FIGURES[figure](link, i)) for i, link in enumerate(links)}
    own = [g for g in example.geometries if not _on_arm(g)]
    figures |= {g.name: [g] for g in own} if furniture is None else {g.name: [] for g in own[1:]} | {own[0].name: _boxes(furniture)}
    pairs = [Pair(*sorted((a.name, b.name))) for pair in example.pairs for a in figures[pair.a] for b in figures[pair.b]]
    geometries = tuple(g for some in figures.values() for g in some)
    name = f"iiwa_{figure}_{furniture or 'shelf'}"
    return replace(example, name=name, geometries=geometries, pairs=tuple(pairs), ignored=(), warnings=())


def _boxes(furniture: str) -> list[Geometry]:
    return [box(f"world/{furniture}{i}", WORLD, np.array(size), np.array(at)) for i, (size, at) in enumerate(FURNITURE[furniture])]


def _on_arm(geometry: Geometry) -> bool:
    return geometry.body.startswith("iiwa/")


def _extent(link: Geometry) -> tuple[Array, Array]:
    """Returns the centre and the half edges of a box whose edges are parallel to its link's axes."""
    lower, upper = link.vertices.min(axis=0), link.vertices.max(axis=0)
    return (lower + upper) / 2, (upper - lower) / 2


def _round(name: str, body: str, vertices: Array, radius: float) -> Geometry:
    return Geometry(name, body, vertices, radius, {"kind": "sphere" if len(vertices) == 1 else "capsule"})
