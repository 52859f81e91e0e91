"""A statement says here by how much the bodies of each pair are larger than the scene's geometries."""

from __future__ import annotations

from collections.abc import Iterator

from certifier.model import Pair, Scene
from certifier.verify.decimals import exactly


def paddings(scene: Scene) -> list[str]:
    """Returns lines that give the padding of a scene, and every pair with another one. One line stands for two bodies where it can."""
    others = {pair: padding for pair, padding in scene.other_paddings().items() if pair in {*scene.body_pairs}}
    line = f"padding {exactly(scene.padding)} m around every body"
    if not others:
        return [line]
    return [f"{line}, but in {len(others)} {'pair' if len(others) == 1 else 'pairs'}:", *_lines(scene, others)]


def _lines(scene: Scene, others: dict[Pair, float]) -> Iterator[str]:
    of_bodies: dict[tuple[str, ...], list[Pair]] = {}
    for pair in scene.body_pairs:
        bodies = sorted(scene.geometry(name).body for name in (pair.a, pair.b))
        of_bodies.setdefault(tuple(bodies), []).append(pair)
    for (a, b), pairs in of_bodies.items():
        alike = {scene.padding_of(pair) for pair in pairs}
        if len(pairs) > 1 and len(alike) == 1 and pairs[0] in others:
            yield f"  {exactly(others[pairs[0]])} m: all {len(pairs)} pairs of the bodies '{a}' and '{b}'"
        else:
            yield from (f"  {exactly(others[pair])} m: '{pair.a}' and '{pair.b}'" for pair in pairs if pair in others)
