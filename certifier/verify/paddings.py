"""A statement says here by how much the bodies of each pair are larger than the scene's geometries."""

from __future__ import annotations

from certifier.model import Scene
from certifier.verify.decimals import exactly


def paddings(scene: Scene) -> list[str]:
    """Returns lines that give the padding of a scene, and every pair with another one."""
    others = scene.other_paddings()
    line = f"padding {exactly(scene.padding)} m around every body"
    if not others:
        return [line]
    own = [f"  {exactly(padding)} m: '{pair.a}' and '{pair.b}'" for pair, padding in others.items()]
    return [f"{line}, but in {len(others)} {'pair' if len(others) == 1 else 'pairs'}:", *own]
