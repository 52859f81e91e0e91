"""This module decides which pairs of geometries must be certified, and which are ignored by request."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from certifier.model import Geometry, Ignored, Pair
from certifier.scene.file import IgnoreEntry
from certifier.scene.known import check_known, names_of
from certifier.scene.tree import Tree


def pairs(
    candidates: Iterable[tuple[str, str]],
    geometries: tuple[Geometry, ...],
    tree: Tree,
    ignore: Sequence[IgnoreEntry],
    described: Sequence[IgnoreEntry] = (),
) -> tuple[tuple[Pair, ...], tuple[Ignored, ...], list[str]]:
    """Splits the candidates that have a moving joint between their bodies into those to certify and those ignored.

    Args:
        ignore: the entries of the scene file, which come first. The name of a mesh that is decomposed means all of its parts.
        described: entries of SRDF files. Many of them concern no pair, because a filter hides it or a link has no geometry.

    Returns:
        the pairs to certify and the ignored pairs, each sorted, and a warning for every entry of the scene file that concerns no pair.

    Raises:
        SceneError: an ignore entry names neither a body nor a geometry.
    """
    body = {g.name: g.body for g in geometries}
    named = {g.name: names_of(g) for g in geometries}
    known = [*tree.bodies, *(name for names in named.values() for name in names)]
    for entry in ignore:
        for k, name in enumerate((entry.a, entry.b)):
            check_known(name, known, f"{entry.field}[{k}]")
    entries = (*ignore, *described)
    first = {frozenset((entry.a, entry.b)): entry for entry in reversed(entries)}
    place = {entry: i for i, entry in enumerate(entries)}
    wanted: list[Pair] = []
    ignored: list[Ignored] = []
    used: set[IgnoreEntry] = set()
    for a, b in sorted({(min(candidate), max(candidate)) for candidate in candidates}):
        if tree.group[body[a]] == tree.group[body[b]]:
            continue
        both = (frozenset((name_a, name_b)) for name_a in named[a] for name_b in named[b])
        match = min((first[names] for names in both if names in first), key=place.__getitem__, default=None)
        if match is None:
            wanted.append(Pair(a, b))
        else:
            used.add(match)
            ignored.append(Ignored(a, b, match.reason))
    unused = [f"{e.field}: {e.a} and {e.b} have no pair to ignore" for e in ignore if e not in used]
    return tuple(wanted), tuple(ignored), unused
