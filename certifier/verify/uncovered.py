"""Which pairs of geometries no proof of a scene covers is said here: by statements, manifests and everybody who shows a claim."""

from __future__ import annotations

import itertools
import json
from collections import Counter
from collections.abc import Iterable, Iterator
from enum import StrEnum
from typing import Any

from certifier.conditions import of_condition
from certifier.model import Scene

NAMED = 20
"""A statement gives at most this many counts of pairs that the scene leaves out; each count is for two bodies."""
LISTED = 1000
"""A document lists at most this many entries of two bodies."""


class Why(StrEnum):
    """Says why pairs of two bodies are not covered."""

    NEIGHBOURS = "neighbours"
    """A joint joins the two bodies, and the scene has no such pairs."""
    FILTERED = "filtered"
    """The scene has no such pairs, as a collision filter of the model leaves them out."""
    IGNORED = "ignored"
    """The scene file ignores them, with a reason."""


_WORDS = {
    Why.NEIGHBOURS: "of neighbouring links",
    Why.FILTERED: "that the model filters out",
    Why.IGNORED: "that the scene file ignores",
}


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
    named = list(itertools.islice((f"{count} of '{a}' and '{b}'" for a, b, count in _Geometries(scene).missing()), NAMED + 1))
    return ", ".join(named[:NAMED]) + (", and more" if len(named) > NAMED else "")


def document(scene: Scene) -> dict[str, Any]:
    """Returns what :func:`not_covered` says as JSON-able data, for manifests (docs/architecture.md, "Manifest").

    The keys are ``pairs``, how many pairs of geometries are not covered; how many of them for each reason of :class:`Why`; ``bodies``, at
    most LISTED entries, each with two bodies ``a`` and ``b``, how many ``pairs`` of theirs, ``why``, and the scene file's ``reason`` or
    None; and ``summary``, a sentence for people. The time is linear in what the scene lists.
    """
    geometries = _Geometries(scene)
    joined = geometries.neighbours()
    between = {frozenset((a, b)) for a, b, _ in joined}
    ignored = Counter((*sorted((geometries.body[i.a], geometries.body[i.b])), i.reason) for i in scene.ignored)
    others = ((a, b, count) for a, b, count in geometries.missing() if frozenset((a, b)) not in between)
    entries = itertools.chain(
        (_entry(a, b, count, Why.NEIGHBOURS) for a, b, count in joined),
        (_entry(a, b, count, Why.IGNORED, reason) for (a, b, reason), count in ignored.items()),
        (_entry(a, b, count, Why.FILTERED) for a, b, count in others),
    )
    neighbours = sum(count for _, _, count in joined)
    counts = {Why.NEIGHBOURS: neighbours, Why.FILTERED: geometries.missing_altogether() - neighbours, Why.IGNORED: len(scene.ignored)}
    return {
        "pairs": sum(counts.values()),
        **{why.value: count for why, count in counts.items()},
        "bodies": list(itertools.islice(entries, LISTED)),
        "summary": _summary(counts),
    }


def named(document: dict[str, Any]) -> list[str]:
    """Returns a line for each of the first NAMED entries of a :func:`document`, and one that says how many pairs are in no line."""
    first = document["bodies"][:NAMED]
    lines = [f"{one['pairs']} of {one['a']} and {one['b']}: {one['reason'] or one['why']}" for one in first]
    more = document["pairs"] - sum(one["pairs"] for one in first)
    return lines + ([f"and {more} more"] if more else [])


def _entry(a: str, b: str, pairs: int, why: Why, reason: str | None = None) -> dict[str, Any]:
    return {"a": a, "b": b, "pairs": pairs, "why": why.value, "reason": reason}


def _summary(counts: dict[Why, int]) -> str:
    parts = [(count, _WORDS[why]) for why, count in counts.items() if count]
    total = sum(count for count, _ in parts)
    if not parts:
        return "every pair of bodies that can move against each other is covered"
    verb = "is" if total == 1 else "are"
    if len(parts) == 1:
        return f"{total} pair{'s' * (total > 1)} {parts[0][1]} {verb} not covered"
    return f"{total} pairs are not covered: {', '.join(f'{count} {words}' for count, words in parts)}"


class _Geometries:
    """The geometries of a scene by their bodies, and which pairs of them it lists: those to certify and the ignored ones."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self.body = {geometry.name: geometry.body for geometry in scene.geometries if not of_condition(geometry.name)}
        self._held = Counter(self.body.values())
        self._parts: dict[str, list[str]] = {}
        for name in sorted(self._held):
            self._parts.setdefault(_rigid_part(scene, name), []).append(name)
        pairs = {frozenset((p.a, p.b)) for p in scene.body_pairs} | {frozenset((i.a, i.b)) for i in scene.ignored}
        self._listed = Counter(frozenset(map(self.body.__getitem__, names)) for names in pairs)

    def missing(self) -> Iterator[tuple[str, str, int]]:
        """Yields two bodies that can move against each other, with how many pairs of their geometries are not listed, if any."""
        return self._missing(bodies for two in itertools.combinations(self._parts.values(), 2) for bodies in itertools.product(*two))

    def neighbours(self) -> list[tuple[str, str, int]]:
        """Returns those of the missing ones whose bodies a joint joins."""
        joined = (joint for joint in self._scene.joints if joint.index is not None and not of_condition(joint.child))
        return list(self._missing(sorted((joint.parent, joint.child)) for joint in joined))

    def missing_altogether(self) -> int:
        """Returns how many pairs are missing."""
        sizes = [sum(self._held[name] for name in part) for part in self._parts.values()]
        among = (sum(sizes) ** 2 - sum(size**2 for size in sizes)) // 2
        part = {name: number for number, names in enumerate(self._parts.values()) for name in names}
        return among - sum(count for bodies, count in self._listed.items() if len({part[name] for name in bodies}) == 2)

    def _missing(self, bodies: Iterable[Iterable[str]]) -> Iterator[tuple[str, str, int]]:
        counted = ((a, b, self._held[a] * self._held[b] - self._listed[frozenset((a, b))]) for a, b in bodies)
        return ((a, b, count) for a, b, count in counted if count)


def _rigid_part(scene: Scene, body: str) -> str:
    """Returns the body nearest to the world that this one is welded to, perhaps through others."""
    above = scene.joint_above
    while body in above and above[body].index is None:
        body = above[body].parent
    return body
