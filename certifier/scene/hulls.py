"""Links of many convex parts, as programs that decompose meshes write them, become one hull of their parts here, where a scene asks for it.

Pairs are what certifying costs. Two links of fifteen parts each make 225 of them, and their hulls one.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TypeVar

import numpy as np

from certifier.errors import SceneError, close_matches
from certifier.model import Geometry
from certifier.scene.hollow import beyond_parts
from certifier.scene.hull import outer
from certifier.scene.known import PART
from certifier.scene.names import Register

_Key = TypeVar("_Key")


def with_hulls(
    geometries: Mapping[_Key, tuple[Geometry, ...]],
    hulls: Sequence[str],
    bodies: Collection[str],
    max_vertices: int,
    names: Register,
    reached: dict[str, float],
) -> dict[_Key, tuple[Geometry, ...]]:
    """Returns the geometries with one hull in the place of all polytopes of each body named; balls and capsules remain.

    Args:
        geometries: what stands for each geometry of Drake's.
        hulls: names of bodies, as the scene file has them.
        bodies: all bodies of the scene.
        max_vertices: a hull has at most this many vertices; where it would have more, a polytope around it takes its place.
        names: the names that bodies and geometries have; the hulls get theirs there.
        reached: gets the names of hulls that reach beyond their parts, and how far, in metres.

    Raises:
        SceneError: ``unknown_name``; ``few_parts`` for a body with fewer than two polytopes; ``scene_field`` for one with a mesh that is
            decomposed; ``hull``, as :func:`outer`.
    """
    found = dict(geometries)
    for k, body in enumerate(hulls):
        if body not in bodies:
            hint = close_matches(body, list(bodies)) or "`ciris scene check` lists the geometries, whose names begin with their bodies"
            raise SceneError("unknown_name", f"the scene has no body {body!r}", field=f"hulls[{k}]", hint=hint)
        parts = {key: geometry for key, (geometry, *_) in geometries.items() if geometry.body == body and geometry.radius == 0}
        if part := next((part for part in parts.values() if part.shape["kind"] == PART), None):
            message = f"{body} has {part.shape['of']}, which is decomposed, and one hull would stand for the parts"
            raise SceneError("scene_field", message, field=f"hulls[{k}]", hint="leave out the one or the other")
        if len(parts) < 2:
            message = f"{body} must have two or more boxes, cylinders and meshes; it has {len(parts)}"
            raise SceneError("few_parts", message, field=f"hulls[{k}]", hint="leave it out of hulls")
        name = names.give(names.unused(f"{body}/hull"), "hull", f"the hull of {body}")
        hull = _hull(name, list(parts.values()), max_vertices)
        found |= dict.fromkeys(parts, (hull,))
        beyond = beyond_parts(hull.vertices, [part.vertices for part in parts.values()], hull.inflation)
        if beyond := max(beyond, *(reached.get(part.name, 0.0) for part in parts.values())):
            reached[name] = beyond
    return found


def _hull(name: str, parts: list[Geometry], max_vertices: int) -> Geometry:
    """Returns the hull of the parts; its inflation is about the hull of the shapes that the parts stand for."""
    vertices, inflation, _ = outer(np.concatenate([part.vertices for part in parts]), max_vertices)
    substitution = f"{len(parts)} parts -> hull with {len(vertices)} vertices"
    shape = {"kind": "hull", "of": [part.name for part in parts]}
    return Geometry(name, parts[0].body, vertices, 0.0, shape, substitution, inflation + max(part.inflation for part in parts))
