"""Joints that follow another one move with it here: both have the same position, and the follower's axis and frame say how it moves.

A follower is at ``factor`` times the position of its leader, plus ``offset``. The factor becomes a part of its axis: with a negative one it
points the other way, and the axis of a follower that slides is as long as the factor says. The offset becomes a part of its fixed frame
X_PF. The limits of the leader become those at which all followers are within theirs.

With another factor than 1 and -1, s = tan((q - q*)/2) of a follower that turns is no rational function of low degree in that of its leader.
So such joints are held or swept.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np

from certifier.errors import SceneError
from certifier.kinematics import Kinematics
from certifier.model import WORLD, Joint, JointKind, Scene
from certifier.scene.joints import EXACT, Coupling, motion, range_of
from certifier.scene.mimics import Mimic, mimic_of

SPEEDS = 1e-3, 1e3
"""Least and largest multiplier, in magnitude, of a joint that slides and follows another one."""


def followers_of(
    joints: Sequence[Joint], couplings: Sequence[Coupling], still: Collection[str], marked: Collection[str] = ()
) -> dict[str, Mimic]:
    """Returns the joints that follow one that moves, by their full names. Their leaders follow none.

    Args:
        still: full names of the joints that are held or swept.
        marked: full names of joints that follow another one by what their model says. Of others, couplings alone tell.

    Raises:
        SceneError: ``unsupported_joint``, where joints are coupled in a way in which they cannot move.
    """
    by_name = {joint.name: joint for joint in joints if joint.index is not None}
    waiting = [coupling for coupling in couplings if not {*coupling.factors} <= {*still}]
    found: dict[str, Mimic] = {}
    while waiting:
        group = _group(waiting)
        waiting = [coupling for coupling in waiting if coupling not in group]
        leader = _leader(group, list(by_name), marked)
        lines = {leader: (1.0, 0.0)}
        while len(lines) < 1 + len(group):
            known = next((c for c in group if len({*c.factors} & {*lines}) == len(c.factors) - 1 == 1), None)
            if known is None:
                raise _no_tree(leader, group)
            (of_it, factor), (other, own) = sorted(known.factors.items(), key=lambda item: item[0] not in lines)
            of_leader, offset = lines[of_it]
            lines[other] = -factor * of_leader / own, (known.constant - factor * offset) / own
        for name, (factor, offset) in lines.items():
            if name != leader:
                found[name] = Mimic(name, leader, factor, offset)
    for mimic in found.values():
        _check(by_name[mimic.follower], by_name[mimic.leader], mimic)
    return found


def leading(joints: Sequence[Joint], followers: Mapping[str, Mimic]) -> list[Joint]:
    """Returns the joints without those that follow. The limits of leaders are those at which all their followers are within theirs.

    Raises:
        SceneError: ``joint_range`` for a leader that has no such range.
    """
    by_name = {joint.name: joint for joint in joints}
    found = {joint.name: joint for joint in joints if joint.name not in followers}
    for mimic in followers.values():
        leader = found[mimic.leader]
        lower, upper = _within(mimic, *range_of(by_name[mimic.follower]))
        lower, upper = (max(range_of(leader)[0], lower), min(range_of(leader)[1], upper))
        if lower >= upper:
            message = f"joint {mimic.follower} follows {mimic.leader}, and there is no range of positions with both within their limits"
            mend = "mend the limits, the multiplier or the offset in the model"
            single = abs(mimic.factor) * (lower - upper) <= EXACT and lower - upper <= EXACT
            held = f"hold them at the only position, by fix: {{{mimic.leader}: {(lower + upper) / 2:.12g}}}; or "
            hint = f"{held if single else 'they can be held nowhere either: '}{mend}"
            raise SceneError("joint_range", message, field="directives", hint=hint)
        found[mimic.leader] = replace(leader, lower=lower, upper=upper)
    return list(found.values())


def with_followers(leaders: Sequence[Joint], every: Sequence[Joint], followers: Mapping[str, Mimic]) -> list[Joint]:
    """Returns the joints in the order of ``every``: the leaders, and each follower with the position and the limits of its leader."""
    found = {joint.name: joint for joint in leaders}
    return [
        _following(joint, found[followers[joint.name].leader], followers[joint.name]) if joint.name in followers else found[joint.name]
        for joint in every
    ]


def check_ways(scene: Scene) -> None:
    """Refuses joints that move together and are on one way: from the world to a body, and between the bodies of a pair.

    Slides between the bodies of a pair count once, if no other joint that moves is between them.

    Raises:
        SceneError: ``unsupported_joint``.
    """
    if not scene.following:
        return
    for body in scene.bodies:
        if twice := _twice(_moving(scene, WORLD, body)):
            message = f"joints {' and '.join(twice)} move together, and one is behind the other, which is not supported"
            raise SceneError("unsupported_joint", message, field="directives", hint=_still(twice[0]))
    for pair in scene.pairs:
        bodies = [scene.geometry(name).body for name in (pair.a, pair.b)]
        chain = Kinematics.of(scene).chain(bodies[0], bodies[1])
        repeated = {index for index in chain if chain.count(index) > 1}
        if twice := _twice([joint for joint in _moving(scene, bodies[0], bodies[1]) if joint.index in repeated]):
            message = f"joints {' and '.join(twice)} move together, and both are between {pair.a} and {pair.b}, which is not supported"
            ignored = f"ignore: [{{pair: [{', '.join(bodies)}], reason: REASON}}]"
            hint = f"{_still(twice[0])}; or certify nothing about these bodies, by {ignored}"
            raise SceneError("unsupported_joint", message, field="directives", hint=hint)


def said_of(followers: Mapping[str, Mimic], scene: Scene) -> list[str]:
    """Returns sentences for people about the joints that follow."""
    found = []
    for joint in scene.moving:
        behind = [f"{name}{_where(mimic)}" for name, mimic in followers.items() if mimic.leader == joint.name]
        if behind:
            ends = f"{joint.lower:.9g} to {joint.upper:.9g} {joint.unit}"
            found.append(f"joint {joint.name} takes {', '.join(behind)} with it: one coordinate, from {ends}, moves them all")
    return found


def _where(mimic: Mimic) -> str:
    """Returns where a follower is, for people; "" where it has the position of its leader."""
    times = "" if mimic.factor == 1 else f"{mimic.factor:.9g} times "
    added = f" {'minus' if mimic.offset < 0 else 'plus'} {abs(mimic.offset):.9g}" if mimic.offset else ""
    return f" (at {times}its position{added})" if times or added else ""


def _group(couplings: Sequence[Coupling]) -> list[Coupling]:
    """Returns the first of the couplings and all that are connected with it."""
    names = {*couplings[0].factors}
    while len(grown := names.union(*(c.factors for c in couplings if names & {*c.factors}))) > len(names):
        names = grown
    return [c for c in couplings if names & {*c.factors}]


def _leader(group: Sequence[Coupling], order: Sequence[str], marked: Collection[str]) -> str:
    """Returns the joint that others follow and that follows none. With a factor of -1, a coupling does not tell which of two that is."""
    names = sorted({name for coupling in group for name in coupling.factors}, key=order.index)
    known = [mimic for mimic in map(mimic_of, group) if mimic is not None and mimic.factor != -1]
    leaders, followers = {mimic.leader for mimic in known}, {*marked} | {mimic.follower for mimic in known}
    free = [name for name in names if name not in followers]
    return max(free or names, key=lambda name: (name in leaders, sum(name in coupling.factors for coupling in group)))


def _check(follower: Joint, leader: Joint, mimic: Mimic) -> None:
    names = [leader.name, follower.name]
    if follower.kind is not leader.kind:
        message = (
            f"joint {follower.name} follows {leader.name} (mimic), but one slides and the other turns; such joints cannot move in ciris"
        )
        raise SceneError("unsupported_joint", message, field="directives", hint=f"{_still(leader.name)}; the other follows")
    if follower.kind is JointKind.REVOLUTE and abs(mimic.factor) != 1:
        allowed = "joints that turn move with a multiplier of 1 or -1"
    elif follower.kind is JointKind.PRISMATIC and not SPEEDS[0] <= abs(mimic.factor) <= SPEEDS[1]:
        allowed = f"joints that slide move with one from {SPEEDS[0]:g} to {SPEEDS[1]:g}, or from -{SPEEDS[1]:g} to -{SPEEDS[0]:g}"
    else:
        return
    message = f"joints {' and '.join(names)} are coupled (mimic) with the multiplier {mimic.factor:.9g}; in ciris, {allowed}"
    raise SceneError("unsupported_joint", message, field="directives", hint=f"{_still(leader.name)}; the others follow")


def _no_tree(leader: str, group: Sequence[Coupling]) -> SceneError:
    """Returns the error for joints that do not follow the leader one after the other."""
    names = [*dict.fromkeys(name for coupling in group for name in coupling.factors)]
    if len(group) >= len(names) and all(len(coupling.factors) == 2 for coupling in group):
        circle = f"joints {' and '.join(names)} follow each other in a circle (mimic), so none of them leads"
        hint = f"remove one of their mimic elements in the model; or {_still(leader)}"
        return SceneError("unsupported_joint", circle, field="directives", hint=hint)
    message = f"joints {' and '.join(names)} are coupled by other equations than mimic joints; such joints cannot move in ciris"
    return SceneError("unsupported_joint", message, field="directives", hint=f"{_still(leader)}; the others follow")


def _still(joint: str) -> str:
    return f"hold one of them, as in fix: {{{joint}: 0}}, or sweep it, as in fix: {{{joint}: swept}}"


def _within(mimic: Mimic, lower: float, upper: float) -> tuple[float, float]:
    """Returns the leader's positions at which the follower is within its limits, rounded inwards."""
    first, last = sorted(_leader_at(mimic, limit) for limit in (lower, upper))
    return _inwards(first, np.inf), _inwards(last, -np.inf)


def _leader_at(mimic: Mimic, position: float) -> Fraction | float:
    """Returns exactly where the leader is when the follower is at a position, which may be infinite."""
    if not np.isfinite(position):
        return position if mimic.factor > 0 else -position
    return (Fraction(position) - Fraction(mimic.offset)) / Fraction(mimic.factor)


def _inwards(exactly: Fraction | float, towards: float) -> float:
    """Returns the double that is nearest to a position, on the side of ``towards``."""
    nearest = float(exactly)
    beyond = nearest < exactly if towards > 0 else nearest > exactly
    return float(np.nextafter(nearest, towards)) if beyond else nearest


def _following(joint: Joint, leader: Joint, mimic: Mimic) -> Joint:
    X_PF = joint.X_PF @ motion(joint, mimic.offset) if mimic.offset else joint.X_PF
    own = leader.index, leader.lower, leader.upper, leader.own_limits
    return Joint(joint.name, joint.kind, joint.parent, joint.child, mimic.factor * joint.axis + 0.0, X_PF, joint.X_BM, *own, follows=True)


def _moving(scene: Scene, one: str, other: str) -> list[Joint]:
    """Returns the joints that move between two bodies, in path order."""
    return [joint for joint, _ in Kinematics.of(scene).joints(one, other) if joint.index is not None]


def _twice(joints: Sequence[Joint]) -> tuple[str, str] | None:
    """Returns two joints with the same position."""
    seen: dict[int | None, str] = {}
    for joint in joints:
        if joint.index in seen:
            return seen[joint.index], joint.name
        seen[joint.index] = joint.name
    return None
