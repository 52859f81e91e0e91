"""Libraries of small regions for tests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from certifier.model import Array, Polytope, StoredRegion
from certifier.polytopes.polytope import bound_multipliers
from planner.library import Library


def region(name: str, C: Array, d: Array) -> StoredRegion:
    """A region with the smallest box around it, which single rows must bound on every axis."""
    lower, upper, _, _ = bound_multipliers(Polytope(C, d))
    return StoredRegion(name, "exact", C, d, lower, upper)


def box(name: str, lower: Sequence[float], upper: Sequence[float]) -> StoredRegion:
    eye = np.eye(len(lower))
    return StoredRegion(
        name, "exact", np.concatenate([eye, -eye]), np.array([*upper, *(-x for x in lower)]), np.array(lower), np.array(upper)
    )


def cut_box(rng: np.random.Generator, name: str, n: int, faces: int, spread: float = 1.0) -> StoredRegion:
    """A random box of half-widths about 0.5, with a centre up to ``spread`` from 0, cut by random faces that leave a ball of it."""
    center, half = rng.uniform(-spread, spread, n), rng.uniform(0.3, 0.8, n)
    normals = rng.normal(size=(faces, n)) / half
    normals /= np.linalg.norm(normals * half, axis=1, keepdims=True)
    eye = np.eye(n)
    C = np.concatenate([normals, eye, -eye])
    return region(name, C, np.concatenate([normals @ center + rng.uniform(0.5, 1.5, faces), center + half, half - center]))


def library(*regions: StoredRegion) -> Library:
    return Library(len(regions[0].lower)).changed(1, [], regions)


def cut_boxes(rng: np.random.Generator, n: int, count: int, faces: int = 6, spread: float = 1.0) -> Library:
    return library(*(cut_box(rng, f"r{i}", n, faces, spread) for i in range(count)))
