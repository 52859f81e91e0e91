"""Conditions that no configuration keeps are found here: alone, within the joint limits, or two of them together.

What is found is certain but for rounding. Much is not found: a zone that the robot does not reach, or three conditions that agree in twos.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np
from scipy.optimize import linprog

from certifier.conditioned import AROUND, Face
from certifier.conditions import Condition, Cone, InBall, Inside, Range, SlideRange
from certifier.model import Scene

Zone = Inside | InBall
Sum = Range | SlideRange
Interval = tuple[float, float]


def exclusions(scene: Scene) -> list[str]:
    """Returns a sentence about each condition that no configuration keeps, and about each two that exclude each other."""
    never = [one for one in scene.conditions if isinstance(one, Range | SlideRange) and not _kept(scene, one)]
    why = "is never in its range within the joint limits"
    found = [f"no configuration keeps the condition '{one.name}': {one.total} {why}" for one in never]
    for a, b in combinations([one for one in scene.conditions if one not in never], 2):
        if clash := _together(scene, a, b):
            found.append(f"the conditions '{a.name}' and '{b.name}' exclude each other: {clash}")
    return found


def _together(scene: Scene, a: Condition, b: Condition) -> str | None:
    """Returns why no configuration keeps both; None where that is not found."""
    if isinstance(a, Cone) and isinstance(b, Cone) and (a.body, a.of) == (b.body, b.of):
        # Both angles between directions are at most so far apart where each direction is in its cone.
        apart = abs(_angle(a.axis, b.axis) - _angle(a.along, b.along))
        return f"both are about directions of '{a.body}', and their cones do not meet" if apart >= a.angle + b.angle else None
    if isinstance(a, Range | SlideRange) and isinstance(b, Range | SlideRange) and dict(_signed(a)) == dict(_signed(b)):
        return None if _common(_kept(scene, a), _kept(scene, b)) else f"no value of {a.total} is in the ranges of both"
    if isinstance(a, Inside | InBall) and isinstance(b, Inside | InBall) and a.of == b.of and (stays := _staying_in_both(a, b)):
        return f"{stays} has to be in two zones that do not meet" if room_in((*_around(a), *_around(b))) <= 0 else None
    return None


def _kept(scene: Scene, condition: Sum) -> list[Interval]:
    """Returns the values of the sum, with the signs of :func:`_signed`, that a condition allows within the joint limits."""
    limits = {joint.name: ends for joint, *ends in zip(scene.moving, scene.q_lower.tolist(), scene.q_upper.tolist(), strict=True)}
    signed = _signed(condition)
    lower = sum(limits[name][0] if sign > 0 else -limits[name][1] for name, sign in signed)
    upper = sum(limits[name][1] if sign > 0 else -limits[name][0] for name, sign in signed)
    ends = (condition.lower, condition.upper) if signed == condition.joints else (-condition.upper, -condition.lower)
    turns, turn = [0], 2 * math.pi
    if isinstance(condition, Range):
        turns = [*range(math.ceil((lower - ends[1]) / turn), math.floor((upper - ends[0]) / turn) + 1)]
    return _common([(ends[0] + turn * k, ends[1] + turn * k) for k in turns], [(lower, upper)])


def _signed(condition: Sum) -> tuple[tuple[str, int], ...]:
    """Returns the joints and signs of a sum, or of its negative, so that the first joint by name counts positively."""
    first = dict(condition.joints)[min(name for name, _ in condition.joints)]
    return tuple((name, sign * first) for name, sign in condition.joints)


def _common(a: list[Interval], b: list[Interval]) -> list[Interval]:
    """Returns what the intervals have in common, without single points."""
    met = [(max(one[0], other[0]), min(one[1], other[1])) for one in a for other in b]
    return [(lower, upper) for lower, upper in met if lower < upper]


def _staying_in_both(a: Zone, b: Zone) -> str | None:
    """Returns the first that has to stay in both zones, in words."""
    if geometry := next((name for name in a.geometries if name in b.geometries), None):
        return repr(geometry)
    point = next((point for point in a.points if point in b.points), None)
    return point and f"the point ({', '.join(f'{x:g}' for x in point[1])}) m of '{point[0]}'"


def room_in(faces: Sequence[Face]) -> float:
    """Returns the radius of the largest ball within all faces, of at most a metre; 0 or less where nothing is between them."""
    normals, offsets = [[*face[:3], 1.0] for face in faces], [face[3] for face in faces]
    found = linprog([0, 0, 0, -1], normals, offsets, bounds=[(None, None)] * 3 + [(None, 1.0)])
    return float(found.x[3]) if found.status == 0 else 1.0


def _around(zone: Zone) -> tuple[Face, ...]:
    """Returns faces that have all of the zone within them."""
    if isinstance(zone, Inside):
        return zone.faces
    offsets = AROUND @ zone.center + zone.radius
    return tuple((x, y, z, d) for (x, y, z), d in zip(AROUND.tolist(), offsets.tolist(), strict=True))


def _angle(a: tuple[float, ...], b: tuple[float, ...]) -> float:
    """Returns the angle between two unit vectors."""
    u, v = np.array(a), np.array(b)
    return 2 * math.atan2(float(np.linalg.norm(u - v)), float(np.linalg.norm(u + v)))
