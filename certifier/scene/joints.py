"""What a scene file says about the joints of its models is applied here: which are held, narrower limits, and q*.

s = tan((q - q*)/2) stands for less than a whole turn. So of a joint that turns farther, the scene covers a window about q*. The robot is in
the same pose a turn later, so seeds and questions are taken to the window (:meth:`certifier.model.Scene.in_windows`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from certifier import words
from certifier.errors import SceneError, close_matches
from certifier.model import Array, Joint, JointKind

T = TypeVar("T")

WINDOW = np.radians(170.0)
"""A window reaches at most so far to either side of q*. Nearer to half a turn, s changes so fast that certificates become hard."""
FAR = np.radians(179.0)
"""A joint whose limits reach so far from q* gets a window. Files say 3.14 for half a turn, where s is 1256, and 3.14159265: 6e8."""
EXACT = 1e-9
"""Positions at which coupled joints are held fit to each other this well, in radians or metres."""


UNBOUNDED = 1e6
"""A limit of at least this many radians or metres means that there is none: exporters write 1e9, 1e16 or the greatest double for it."""


@dataclass(frozen=True)
class Coupling:
    """A linear equation that joint positions keep to, as a mimic joint does: sum of factor times position = constant.

    Attributes:
        factors: by the joints' names.
    """

    factors: Mapping[str, float]
    constant: float


def counted(limit: float) -> float:
    """Returns a limit of a model, which is infinite where its number means that there is none."""
    return float(np.copysign(np.inf, limit)) if abs(limit) >= UNBOUNDED else limit


def held_at(
    joints: Sequence[Joint], positions: Mapping[str, float], couplings: Sequence[Coupling], swept: Collection[str] = ()
) -> dict[str, float]:
    """Returns where joints are held, radians or metres, by their full names. A joint that is coupled to held ones alone is held as well.

    Joints that are coupled to none that is held or swept are left out.

    Args:
        swept: full names of joints that are swept.

    Raises:
        SceneError: ``unknown_name``; ``scene_field`` where a joint cannot be there.
    """
    by_name = {j.name: j for j in joints if j.index is not None}
    at = by_full_name(positions, by_name, "fix")
    for name, value in at.items():
        if name in swept:
            message = f"joint {name} follows one that is swept, so it cannot be held"
            raise SceneError("scene_field", message, field=f"fix.{name}", hint="leave it out of fix")
        _check_within(by_name[name], value)
    _follow(at, by_name, [coupling for coupling in couplings if not swept or not {*coupling.factors} <= {*swept}])
    return at


def held(joints: Sequence[Joint], at: Mapping[str, float]) -> list[Joint]:
    """Returns the joints, those that are held as welds; the positions of the others are numbered anew, in their order."""
    by_name = {j.name: j for j in joints if j.index is not None}
    free = sorted((j for j in by_name.values() if j.name not in at), key=lambda j: j.index or 0)
    number = {j.name: i for i, j in enumerate(free)}
    return [_welded(j, at[j.name]) if j.name in at else replace(j, index=number.get(j.name)) for j in joints]


def narrowed(joints: Sequence[Joint], limits: Mapping[str, tuple[float, float]], leaders: Mapping[str, str] | None = None) -> list[Joint]:
    """Returns the joints with the limits that the scene file gives them, which are within their own.

    Args:
        leaders: of the joints that follow another one, by their full names.

    Raises:
        SceneError: ``unknown_name``; ``scene_field`` for limits outside of the joint's own.
    """
    by_name = {j.name: j for j in joints if j.index is not None}
    given = by_full_name(limits, by_name, "limits", leaders)
    for name, (lower, upper) in given.items():
        own_lower, own_upper = range_of(by_name[name])
        if lower < own_lower - EXACT or upper > own_upper + EXACT:
            message = f"{lower:.9g} to {upper:.9g} is not within the joint's own limits, {own_lower:.9g} to {own_upper:.9g}"
            raise SceneError("scene_field", message, field=f"limits.{name}", hint="scene files can only make limits narrower")
    return [replace(j, lower=given[j.name][0], upper=given[j.name][1]) if j.name in given else j for j in joints]


def centered(
    joints: Sequence[Joint], q_star: Sequence[float] | None, leaders: Mapping[str, str] | None = None
) -> tuple[list[Joint], Array]:
    """Returns the joints, with windows for those that turn as far as s stands for, or nearly, and q*, (n,).

    Args:
        q_star: as in the scene file; None for the middle of the joint limits, or 0 where a joint has none.
        leaders: of the joints that follow another one, by their full names.

    Raises:
        SceneError: ``no_joints``, ``scene_field``, or ``joint_range`` for a range without an interior or a slide without limits.
    """
    moving = sorted((j for j in joints if j.index is not None), key=lambda j: j.index or 0)
    if not moving:
        message = "no joint of the scene can move, so there is no configuration space"
        raise SceneError("no_joints", message, field="directives", hint="add a model with joints, or hold fewer of them by fix")
    if q_star is not None and len(q_star) != len(moving):
        names = ", ".join(j.name for j in moving)
        message = f"has {words.counted(len(q_star), 'number')} for {words.counted(len(moving), 'joint')}"
        behind = [f"{follower} follows {leader}" for follower, leader in (leaders or {}).items()]
        raise SceneError("scene_field", message, field="q_star", hint="; ".join([f"in order: {names}", *behind]))
    centers = [_middle(j) for j in moving] if q_star is None else list(q_star)
    found = {j.name: _windowed(j, center) for j, center in zip(moving, centers, strict=True)}
    return [found.get(j.name, j) for j in joints], np.array(centers)


def range_of(joint: Joint) -> tuple[float, float]:
    """Returns the limits of a joint that moves, which may be infinite."""
    assert joint.lower is not None, "a joint that moves has limits, which may be infinite"
    assert joint.upper is not None
    return joint.lower, joint.upper


def _middle(joint: Joint) -> float:
    lower, upper = range_of(joint)
    if np.isfinite(lower) and np.isfinite(upper):
        return (lower + upper) / 2
    return float(np.clip(0.0, lower, upper))


def _windowed(joint: Joint, center: float) -> Joint:
    """Returns a joint with a window where its limits reach half a turn from the centre, or nearly."""
    lower, upper = range_of(joint)
    if lower >= upper:
        message = f"joint {joint.name} cannot move: its limits are {lower:.9g} and {upper:.9g} {joint.unit}"
        raise SceneError("joint_range", message, field="directives", hint=f"hold it by fix: {{{joint.name}: {lower:g}}}")
    if joint.kind is not JointKind.REVOLUTE:
        if not (np.isfinite(lower) and np.isfinite(upper)):
            message = f"joint {joint.name} has no finite limits"
            raise SceneError("joint_range", message, field="directives", hint=f"give it some by limits: {{{joint.name}: [LOWER, UPPER]}}")
        return joint
    if center - FAR < lower and upper < center + FAR:
        return joint
    window = max(lower, center - WINDOW), min(upper, center + WINDOW)
    if window[0] >= window[1]:
        message = f"joint {joint.name} turns from {lower:.6g} to {upper:.6g} rad, and q* = {center:.6g} is more than 170 degrees away"
        raise SceneError("joint_range", message, field="q_star", hint="move q_star into the joint's limits")
    own = tuple(limit if np.isfinite(limit) else None for limit in (lower, upper))
    return replace(joint, lower=window[0], upper=window[1], own_limits=(own[0], own[1]))


def by_full_name(said: Mapping[str, T], joints: Mapping[str, Joint], field: str, leaders: Mapping[str, str] | None = None) -> dict[str, T]:
    """Returns what a scene file says of joints by their full names.

    Args:
        leaders: of the joints that follow another one, by their full names.

    Raises:
        SceneError: ``unknown_name``; ``scene_field`` for a joint that is named twice.
    """
    found: dict[str, T] = {}
    for name, value in said.items():
        full = _known(name, joints, field, leaders or {})
        if full in found:
            raise SceneError("scene_field", f"joint {full} is named twice", field=f"{field}.{name}", hint="leave one of them out")
        found[full] = value
    return found


def _known(name: str, joints: Mapping[str, Joint], field: str, leaders: Mapping[str, str]) -> str:
    """Returns the full name of a joint that can move, which a scene file may give without its model where this is clear."""
    fitting = [full for full in joints if name in (full, full.rsplit("/", 1)[-1])]
    following = [full for full in leaders if name in (full, full.rsplit("/", 1)[-1])]
    if not fitting and len(following) == 1:
        message = f"joint {following[0]} follows {leaders[following[0]]} (mimic), so it has no position of its own"
        raise SceneError("unknown_name", message, field=f"{field}.{name}", hint=f"name {leaders[following[0]]}, which takes it along")
    if len(fitting) != 1:
        what = f"fits {' and '.join(fitting)}" if fitting else "is no joint of the scene that can move"
        hint = "write model/joint" if fitting else close_matches(name, list(joints)) or f"joints: {', '.join(joints)}"
        raise SceneError("unknown_name", f"{name!r} {what}", field=f"{field}.{name}", hint=hint)
    return fitting[0]


def _check_within(joint: Joint, value: float) -> None:
    lower, upper = range_of(joint)
    if not lower - EXACT <= value <= upper + EXACT:
        message = f"{value:.9g} is not within the joint's limits, {lower:.9g} to {upper:.9g}"
        raise SceneError("scene_field", message, field=f"fix.{joint.name}", hint="hold it within them")


def _follow(at: dict[str, float], by_name: Mapping[str, Joint], couplings: Sequence[Coupling]) -> None:
    """Adds to the positions of held joints those of joints that are coupled to held ones alone."""
    waiting = list(couplings)
    while known := next((c for c in waiting if sum(name not in at for name in c.factors) <= 1), None):
        waiting.remove(known)
        rest = known.constant - sum(factor * at[name] for name, factor in known.factors.items() if name in at)
        follower = next((name for name in known.factors if name not in at), None)
        if follower is not None:
            at[follower] = rest / known.factors[follower]
            _check_within(by_name[follower], at[follower])
        elif abs(rest) > EXACT:
            names = " and ".join(known.factors)
            message = f"joints {names} are coupled (mimic), and cannot be held at these positions"
            raise SceneError("scene_field", message, field="fix", hint="hold one of them; the other follows")


def motion(joint: Joint, value: float) -> Array:
    """Returns X_FM of a joint at a position, (4, 4)."""
    X_FM = np.eye(4)
    if joint.kind is JointKind.REVOLUTE:
        x, y, z = joint.axis
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        X_FM[:3, :3] += np.sin(value) * cross + (1 - np.cos(value)) * cross @ cross
    else:
        X_FM[:3, 3] = value * joint.axis
    return X_FM


def _welded(joint: Joint, value: float) -> Joint:
    """Returns the weld that holds a joint at a position."""
    return Joint(joint.name, JointKind.WELD, joint.parent, joint.child, np.zeros(3), joint.X_PF @ motion(joint, value), joint.X_BM)
