"""The robots of two scenes are compared here by their numbers, because names may change and numbers are what proofs are about."""

from __future__ import annotations

from collections.abc import Iterator

from certifier.errors import SceneError
from certifier.model import WORLD, Joint, Scene
from certifier.words import counted

_Way = tuple[object, ...]
"""The numbers of the joints from the world to a body."""


def same_bodies(old: Scene, new: Scene) -> dict[str, str]:
    """Returns old body -> new body, for bodies that hang on the world by the same joints; the body of the same name where several do.

    Raises:
        SceneError: ``other_robot``, where the joints that move are not the same in both scenes.
    """
    before, after = _ways(old), _ways(new)
    _check_joints(old, new, before, after)
    found: dict[_Way, list[str]] = {}
    for body in new.bodies:
        found.setdefault(after[body], []).append(body)
    alike = ((body, found.get(before[body], [])) for body in old.bodies)
    return {body: body if body in others else others[0] for body, others in alike if others}


def _check_joints(old: Scene, new: Scene, before: dict[str, _Way], after: dict[str, _Way]) -> None:
    hint = "grow a region of the new scene: its joints, their limits and q* must be those of the old one"
    if old.n != new.n:
        raise SceneError(
            "other_robot",
            f"the old scene has {counted(old.n, 'joint')} that can move, and the new one has {new.n}",
            field="scene",
            hint=hint,
        )
    for first, second, *q_star in zip(old.moving, new.moving, old.q_star.tolist(), new.q_star.tolist(), strict=True):
        what = next(_differences(first, second, before, after, q_star), None)
        if what is not None:
            raise SceneError("other_robot", f"{what} of joint {second.name} is not what it was", field="scene", hint=hint)


def _differences(first: Joint, second: Joint, before: dict[str, _Way], after: dict[str, _Way], q_star: list[float]) -> Iterator[str]:
    """Gives what is different about a joint of the old and of the new scene."""
    if q_star[0] != q_star[1]:
        yield "q*"
    if (first.lower, first.upper, first.own_limits) != (second.lower, second.upper, second.own_limits):
        yield "the range"
    if before[first.child] != after[second.child]:
        yield "the place or the axis"


def _ways(scene: Scene) -> dict[str, _Way]:
    ways: dict[str, _Way] = {WORLD: ()}

    def way(body: str) -> _Way:
        if body not in ways:
            joint = scene.joint_above[body]
            numbers = joint.kind, joint.index, *((array + 0.0).tobytes() for array in (joint.axis, joint.X_PF, joint.X_BM))
            ways[body] = (*way(joint.parent), numbers)
        return ways[body]

    return {body: way(body) for body in scene.bodies}
