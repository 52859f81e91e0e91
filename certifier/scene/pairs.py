"""This module decides which pairs of geometries must be certified, and which are ignored by request."""

from __future__ import annotations

from collections.abc import Iterable

from certifier.errors import SceneError, close_matches
from certifier.model import WORLD, Geometry, Ignored, Pair
from certifier.scene.file import IgnoreEntry
from certifier.scene.tree import Tree


def pairs(
    candidates: Iterable[tuple[str, str]], geometries: tuple[Geometry, ...], tree: Tree, ignore: tuple[IgnoreEntry, ...]
) -> tuple[tuple[Pair, ...], tuple[Ignored, ...], list[str]]:
    """Splits the candidates that have a moving joint between their bodies into those to certify and those ignored.

    Returns:
        the pairs to certify and the ignored pairs, each sorted, and a warning for every ignore entry that concerns no pair.

    Raises:
        SceneError: an ignore entry names neither a body nor a geometry.
    """
    body = {g.name: g.body for g in geometries}
    known = [name for name in tree.bodies if name != WORLD] + list(body)
    for entry in ignore:
        for k, name in enumerate((entry.a, entry.b)):
            if name != WORLD and name not in known:
                message, hint = f"{name!r} is neither a body nor a geometry of the scene", "`ciris scene show` and `scene check` list them"
                raise SceneError("unknown_name", message, field=f"{entry.field}[{k}]", hint=close_matches(name, known) or hint)
    wanted: list[Pair] = []
    ignored: list[Ignored] = []
    used: set[IgnoreEntry] = set()
    for a, b in sorted({(min(candidate), max(candidate)) for candidate in candidates}):
        if tree.group[body[a]] == tree.group[body[b]]:
            continue
        names_a, names_b = {a, body[a]}, {b, body[b]}
        match = next((e for e in ignore if (e.a in names_a and e.b in names_b) or (e.a in names_b and e.b in names_a)), None)
        if match is None:
            wanted.append(Pair(a, b))
        else:
            used.add(match)
            ignored.append(Ignored(a, b, match.reason))
    unused = [f"{e.field}: {e.a} and {e.b} have no pair to ignore" for e in ignore if e not in used]
    return tuple(wanted), tuple(ignored), unused
