"""What a draft says of hulls is written here: which bodies one hull stands for, how many vertices a polytope may have, and which meshes are
better decomposed.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable

import yaml

from certifier.kinematics import Kinematics
from certifier.model import WORLD, Pair, Scene
from certifier.scene.hollow import beyond, fault_of

MANY_PARTS = 4
"""Where a body that moves has more polytopes than this, the draft has their hull stand for them."""
NEAR = 0.005
"""Where a polytope of few vertices reaches farther beyond the hull of a mesh, in metres, the draft allows more vertices."""
MOST_VERTICES = 128
"""The draft allows at most this many."""
FAR = 0.01
"""Where the hull of a mesh reaches farther beyond the mesh, in metres, the draft offers to decompose the mesh."""
THRESHOLD = 0.02
"""The draft offers this threshold, in metres, or half of what the hull reaches beyond the mesh."""


def hulls(scene: Scene) -> str:
    """Returns that hulls stand for the bodies of many parts, each part of which would be a pair with each part of all other bodies."""
    moved = [joint.child for joint in scene.joints if Kinematics.of(scene).chain(WORLD, joint.child)]
    parts = Counter(geometry.body for geometry in scene.geometries if geometry.radius == 0)
    bodies = [body for body in moved if parts[body] > MANY_PARTS]
    if not bodies:
        return ""
    lines = [f"  - {quoted(body)}  # {parts[body]} parts" for body in bodies]
    return (
        "\n".join(["# One hull stands for all parts of each of these. Leave a body out where its hollows matter.", "hulls:", *lines]) + "\n"
    )


def vertices(scene: Scene, now: int) -> str:
    """Returns how many vertices polytopes may have, where those of ``now`` vertices reach far beyond hulls of meshes.

    The distance falls about as the number of vertices rises.
    """
    capped = [g for g in scene.geometries if g.shape["kind"] in ("mesh", "convex", "hull")]
    worst = max(capped, key=lambda g: g.inflation, default=None)
    if worst is None or worst.inflation <= NEAR:
        return ""
    count = min(MOST_VERTICES, 16 * math.ceil(now * worst.inflation / NEAR / 16))
    said = f"With {now} vertices, {worst.name} would reach up to {1000 * worst.inflation:.3g} mm beyond its hull."
    return f"# {said} Fewer vertices certify faster.\nmesh: {{max_vertices: {count}}}\n"


def offers(scene: Scene, doubtful: Iterable[Pair]) -> str:
    """Returns the meshes that are better decomposed where their openings matter, as comments.

    Their hulls reach far beyond them, or perhaps overlap where the meshes do not.

    Args:
        doubtful: the pairs of which perhaps only hulls overlap.
    """
    suspected = {name for pair in doubtful for name in (pair.a, pair.b)}
    meshes = [g for g in scene.geometries if g.shape["kind"] == "mesh"]
    reach = {g.name: beyond(scene, g.name) for g in meshes}
    found = [g.name for g in meshes if reach[g.name] > FAR or (reach[g.name] and g.name in suspected)]
    if not found:
        return ""
    solid = sorted((name for name in found if not fault_of(scene, name)), key=lambda name: -reach[name])
    lines = ["# The hulls of some meshes reach far beyond them, and close their openings."]
    if solid:
        lines += [
            "# Where that matters, take away the # of decompose and of the mesh: convex parts then stand for it.",
            "# A smaller threshold (metres) makes more parts, each with pairs of its own, and certifying takes longer.",
            "# decompose:",
            *(f"#   {quoted(name)}: {{threshold: {min(THRESHOLD, reach[name] / 2):.2g}}}  # {_said(reach[name])}" for name in solid),
        ]
    for name in found:
        if fault := fault_of(scene, name):
            lines.append(f"# To decompose {name}, mend its mesh first: {fault}; {_said(reach[name])}.")
    return "\n".join(lines) + "\n"


def _said(reach: float) -> str:
    return f"the hull reaches {1000 * reach:.3g} mm beyond it"


def doubt(scene: Scene, pair: Pair, depth: float) -> str | None:
    """Returns a sentence where perhaps only what stands for two bodies overlaps: it reaches farther beyond them than they overlap.

    Args:
        depth: how deep they are in each other at least, at the configurations that were tried, metres.
    """
    reach = {name: beyond(scene, name) + scene.geometry(name).inflation for name in (pair.a, pair.b)}
    if depth > sum(reach.values()):
        return None
    said = " and ".join(f"what stands for {name} reaches {1000 * most:.3g} mm beyond it" for name, most in reach.items() if most)
    return f"perhaps only their hulls overlap, by {1000 * depth:.3g} mm at least: {said}"


def quoted(text: str) -> str:
    """Returns a text as YAML has it, in quotes where it needs them."""
    plain = all((c.isalnum() and c.isascii()) or c in "_-./" for c in text) and text[:1].isalpha()
    return text if plain and yaml.safe_load(text) == text else json.dumps(text)
