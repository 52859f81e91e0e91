"""Which regions overlap, how deep, and how they hang together."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

from planner.library import Library
from planner.overlap import FLAT, beside, components, gap, overlap
from tests.planner.regions import box, cut_boxes, library


def depth(stored: Library, a: int, b: int) -> float:
    """The radius of the largest ball in both, by one linear program over all faces; negative where there is none."""
    faces = np.concatenate([stored.faces[stored.rows(a)], stored.faces[stored.rows(b)]])
    norms = np.linalg.norm(faces[:, :-1], axis=1)
    objective = np.append(np.zeros(stored.n), -1.0)
    found = linprog(objective, A_ub=np.column_stack([faces[:, :-1], norms]), b_ub=faces[:, -1], bounds=(None, None))
    return float(found.x[-1])


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 5), faces=st.integers(0, 20))
def test_an_overlap_is_what_a_linear_program_over_all_faces_says(seed: int, n: int, faces: int) -> None:
    stored = cut_boxes(np.random.default_rng(seed), n, 2, faces)
    found, expected = (overlap(stored, 0, 1) if beside(stored, 1, [0]) else None), depth(stored, 0, 1)
    if abs(expected) > 1e-7:
        assert (found is not None) == (expected > 0)
    if found is not None:
        assert found.depth == pytest.approx(expected, abs=1e-9)
        for region in (0, 1):
            polytope = stored.polytope(region)
            slack = (polytope.d - polytope.C @ found.witness) / np.linalg.norm(polytope.C, axis=1)
            assert slack.min() >= found.depth - 1e-9 > 0


def test_regions_that_only_touch_do_not_overlap() -> None:
    stored = library(box("a", [0, 0], [1, 1]), box("b", [1, 0], [2, 1]), box("c", [1 - 4 * FLAT, 0], [2, 1]))
    assert beside(stored, 0, [1, 2]) == [2]
    found = overlap(stored, 0, 2)
    assert found is not None
    assert found.depth == pytest.approx(2 * FLAT, rel=1e-3)


def test_a_chain_is_one_component_and_the_gap_to_the_other_is_found() -> None:
    chain = [box(f"chain{i}", [0.9 * i, 0], [0.9 * i + 1, 1]) for i in range(3)]
    stored = library(*chain, box("far", [4, 3], [5, 4]), box("nearer", [1.2, 1.25], [1.5, 2]))
    edges = [(a, b) for b in range(5) for a in beside(stored, b, range(b)) if overlap(stored, a, b)]
    assert edges == [(0, 1), (1, 2)]
    assert components(5, edges) == [[0, 1, 2], [3], [4]]
    found = gap(stored, [0, 1, 2])
    assert found is not None
    assert (found.a, found.b, found.distance) == (1, 4, pytest.approx(0.25))
    assert gap(stored, [0, 1, 2, 3, 4]) is None
