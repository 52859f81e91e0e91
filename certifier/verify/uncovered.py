"""A statement says here which pairs of geometries it does not cover."""

from __future__ import annotations

import itertools
import json
from collections import Counter

from certifier.model import Scene

NAMED = 20
"""A statement gives at most this many counts of pairs that the scene leaves out; each count is for two bodies."""


def not_covered(scene: Scene) -> list[str]:
    """Returns lines that name the pairs that the scene ignores, with the reasons, and those that it leaves out."""
    lines = [f"not covered: '{i.a}' and '{i.b}', for the reason {json.dumps(i.reason, ensure_ascii=False)}" for i in scene.ignored]
    missing = unlisted(scene)
    return lines + ([f"not covered, as the scene has no such pairs: {missing}"] if missing else [])


def unlisted(scene: Scene) -> str:
    """Returns, in words, how many pairs of geometries the scene leaves out: they can move against each other, but it does not list them.

    Listed are the pairs to certify and the ignored ones. The missing ones are counted for each two bodies, and the first NAMED counts
    are given. The time is linear in what the scene lists: of the bodies looked at, two without a listed pair are among those named.
    """
    body = {geometry.name: geometry.body for geometry in scene.geometries}
    held = Counter(body.values())
    parts: dict[str, list[str]] = {}
    for name in sorted(held):
        parts.setdefault(_rigid_part(scene, name), []).append(name)
    pairs = {frozenset((p.a, p.b)) for p in scene.pairs} | {frozenset((i.a, i.b)) for i in scene.ignored}
    listed = Counter(frozenset(map(body.__getitem__, names)) for names in pairs)
    moving = (bodies for two in itertools.combinations(parts.values(), 2) for bodies in itertools.product(*two))
    missing = ((a, b, held[a] * held[b] - listed[frozenset((a, b))]) for a, b in moving)
    named = list(itertools.islice((f"{count} of '{a}' and '{b}'" for a, b, count in missing if count), NAMED + 1))
    return ", ".join(named[:NAMED]) + (", and more" if len(named) > NAMED else "")


def _rigid_part(scene: Scene, body: str) -> str:
    """Returns the body nearest to the world that this one is welded to, perhaps through others."""
    above = scene.joint_above
    while body in above and above[body].index is None:
        body = above[body].parent
    return body
