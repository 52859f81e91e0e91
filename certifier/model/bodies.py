"""Convex geometries of links, and pairs of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from certifier.model.joints import Array

WORLD = "world"


@dataclass(frozen=True)
class Geometry:
    """A geometry is a convex body fixed to a link: conv(vertices) + ball(radius), in the frame of its body.

    Attributes:
        name: ``model/body/geometry``.
        body: ``model/body``, or ``world``.
        vertices: (v, 3) metres in the body's frame. A sphere has one vertex, a capsule has two.
        radius: metres, 0 for a polytope. The scene's padding is *not* included.
        shape: what the file said, JSON-able: ``{"kind": "box", "size": [x, y, z], "X_BG": 4x4 list}`` and so on.
        substitution: None when vertices and radius describe the shape exactly, else a sentence that names the conservative
            replacement (mesh -> hull with V vertices, cylinder -> prism ...).
        inflation: upper bound in metres on how far the replacement reaches outside the shape, or outside the hull of a mesh.
    """

    name: str
    body: str
    vertices: Array
    radius: float
    shape: dict[str, Any]
    substitution: str | None = None
    inflation: float = 0.0


@dataclass(frozen=True)
class Pair:
    """A pair names two geometries that must not touch; a < b in string order."""

    a: str
    b: str


@dataclass(frozen=True)
class Ignored:
    """Names a pair of geometries that is not certified, and says why."""

    a: str
    b: str
    reason: str
