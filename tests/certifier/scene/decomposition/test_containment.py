"""Pieces of triangles that no part holds: exact fractions are the oracle."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from certifier.scene.decomposition.containment import Part, uncovered
from certifier.scene.shapes import CORNERS

ONE = np.array([[0, 1, 2]])


def box(lower: list[float], upper: list[float]) -> np.ndarray:
    low, high = np.array(lower), np.array(upper)
    return (low + high) / 2 + CORNERS * (high - low) / 2


def exactly_in(part: Part, point: list[Fraction]) -> bool:
    return all(
        sum((Fraction(n) * x for n, x in zip(normal, point, strict=True)), Fraction(offset)) <= 0
        for normal, offset in zip(part.normals.tolist(), part.offsets.tolist(), strict=True)
    )


def in_piece(piece: np.ndarray, point: np.ndarray) -> bool:
    """Whether a point is in a polygon, up to a nanometre."""
    normal = np.cross(piece[1] - piece[0], piece[2] - piece[0])
    if (length := np.linalg.norm(normal)) < 1e-12:
        return min(np.linalg.norm(point - corner) for corner in piece) < np.ptp(piece, axis=0).max() + 1e-9
    edges = np.roll(piece, -1, axis=0) - piece
    heights = np.cross(edges, point - piece) @ normal / length / np.maximum(np.linalg.norm(edges, axis=1), 1e-12)
    return bool(heights.min() >= -1e-9)


@pytest.mark.parametrize("seed", range(12))
def test_every_point_of_a_triangle_is_in_a_part_or_in_a_piece(seed: int) -> None:
    rng = np.random.default_rng(seed)
    parts = [Part(rng.normal(size=(rng.integers(5, 15), 3)) + rng.normal(size=3)) for _ in range(4)]
    one, other = 2 * rng.normal(size=(2, 3))
    triangle = np.array([one, other, -one - other]) + parts[0].vertices.mean(axis=0)
    pieces = uncovered(parts, triangle, ONE)
    assert pieces
    held = 0
    for weights in rng.dirichlet((1, 1, 1), 150).tolist():
        exact = [Fraction(x) for x in weights[:2]]
        exact.append(1 - sum(exact))
        point = [sum((w * Fraction(x) for w, x in zip(exact, column, strict=True)), Fraction(0)) for column in triangle.T.tolist()]
        inside = any(exactly_in(part, point) for part in parts)
        held += inside
        assert inside or any(in_piece(piece, np.array([float(x) for x in point])) for piece in pieces)
    for piece in pieces:
        middle = [sum(map(Fraction, column), Fraction(0)) / len(piece) for column in piece.T.tolist()]
        deep = [part for part in parts if part.depths(np.array([[float(x) for x in middle]]))[0] > 1e-9]
        assert not deep
    assert held


@pytest.mark.parametrize(("gap", "pieces"), [(1e-3, 1), (1e-9, 1), (0.0, 1), (-1e-12, 0), (-1e-3, 0)])
def test_a_gap_between_two_parts_is_found_however_narrow_it_is(gap: float, pieces: int) -> None:
    """Parts that only touch share no half-spaces that are theirs beyond doubt."""
    triangle = np.array([[-0.5, -0.2, 0.01], [0.5, 0.1, 0.02], [0.4, 0.3, -0.03]])
    two = [Part(box([-1, -1, -1], [-gap / 2, 1, 1])), Part(box([gap / 2, -1, -1], [1, 1, 1]))]
    found = uncovered(two, triangle, ONE)
    assert len(found) == pieces
    for piece in found:
        assert np.abs(piece[:, 0]).max() <= gap + 1e-9


def test_a_part_that_is_thinner_than_rounding_holds_nothing() -> None:
    corners = np.array([[7.0, 7, 0], [8, 7, 0], [7, 8, 0], [7.3, 7.3, 1e-13]])
    part = Part(corners)
    assert np.isinf(part.offsets).all()
    assert len(uncovered([part], corners, ONE)) == 1
