"""Says in words what is wrong at a configuration: that bodies touch, or by how much a condition is not kept."""

from __future__ import annotations

import math

import numpy as np

from certifier.collisions.free import distance_at
from certifier.collisions.seen import seen_of
from certifier.conditioned import condition_of, distance_of
from certifier.conditions import MODEL, Condition, Cone, Distance, InBall, Inside, Range, SlideRange, of_condition
from certifier.kinematics import Kinematics
from certifier.model import Array, Geometry, Pair, Scene
from certifier.motion.bodies import bodies_of


def trouble(scene: Scene, pair: Pair, q: Array | None = None) -> str:
    """Returns in words that a pair touches, or that the condition that it proves is not kept.

    Args:
        q: (n,) where, radians or metres; None where only the pair is known.
    """
    return not_kept(scene, pair, q) or f"{pair.a} and {pair.b} touch"


def not_kept(scene: Scene, pair: Pair, q: Array | None = None) -> str | None:
    """Returns in words that the condition that a pair proves is not kept; None for two bodies that touch.

    Args:
        q: (n,) where, radians or metres; None where only the pair is known.
    """
    condition = condition_of(scene, pair) or distance_of(scene, pair)
    if condition is None or (isinstance(condition, Distance) and (q is None or _apart(scene, pair, q) <= 0)):
        return None
    if q is None:
        return f"the condition '{condition.name}' is not kept"
    if isinstance(condition, InBall) and (inside := -_beyond(scene, pair, condition, q)) >= 0:
        what = f"{_who(scene, pair, condition)} is {1000 * inside:.3g} mm from the surface of the ball, which is too near"
        return f"the condition '{condition.name}' cannot be proved: {what}"
    return f"the condition '{condition.name}' is not kept: {_by(scene, pair, condition, q)}"


def _by(scene: Scene, pair: Pair, condition: Condition, q: Array) -> str:
    """Returns in words by how much a condition is not kept at q, (n,)."""
    s, kinematics = scene.to_s(scene.in_windows(q))[None], Kinematics.of(scene)
    match condition:
        case Cone():
            ends = kinematics.points(condition.of, condition.body, np.array([condition.axis, [0.0, 0.0, 0.0]]), s)[0]
            angle = math.acos(float(np.clip((ends[0] - ends[1]) @ condition.along, -1.0, 1.0)))
            return f"the angle is {math.degrees(angle):.4g} degrees, and {math.degrees(condition.angle):.9g} at most"
        case Range():
            total = _sum(scene, condition, q)
            middle, half = (condition.lower + condition.upper) / 2, (condition.upper - condition.lower) / 2
            beyond = abs(math.remainder(total - middle, 2 * math.pi)) - half
            return f"the sum of the angles is {math.degrees(beyond):.4g} degrees beyond its range"
        case SlideRange():
            total = _sum(scene, condition, q)
            beyond = max(condition.lower - total, total - condition.upper)
            return f"the sum of the positions is {1000 * beyond:.4g} mm beyond its range"
        case Inside() | InBall():
            return f"{_who(scene, pair, condition)} reaches {1000 * _beyond(scene, pair, condition, q):.4g} mm beyond the zone"
        case Distance():
            return f"{pair.a} and {pair.b} are {_apart(scene, pair, q):.4g} m apart, and {condition.metres:.9g} at least"


def _staying(scene: Scene, pair: Pair, condition: Inside | InBall) -> Geometry:
    """Returns the geometry of a pair that has to stay in a zone."""
    return scene.geometry(pair.b if pair.a.startswith(f"{MODEL}/{condition.name}/face") else pair.a)


def _who(scene: Scene, pair: Pair, condition: Inside | InBall) -> str:
    geometry = _staying(scene, pair, condition)
    return f"a point of {geometry.body}" if of_condition(geometry.name) else geometry.name


def _beyond(scene: Scene, pair: Pair, condition: Inside | InBall, q: Array) -> float:
    """Returns how far the geometry of a pair reaches beyond its zone at q, (n,), in metres; negative inside."""
    geometry, s = _staying(scene, pair, condition), scene.to_s(scene.in_windows(q))[None]
    points = Kinematics.of(scene).points(condition.of, geometry.body, geometry.vertices, s)[0]
    if isinstance(condition, InBall):
        return float(np.linalg.norm(points - condition.center, axis=1).max()) - condition.radius + geometry.radius
    faces = np.array(condition.faces)
    return float((points @ faces[:, :3].T - faces[:, 3]).max()) + geometry.radius


def _sum(scene: Scene, condition: Range | SlideRange, q: Array) -> float:
    """Returns the sum of the joints of a range at q, (n,), in radians or metres."""
    place = {joint.name: joint.index or 0 for joint in scene.moving}
    return sum(sign * float(q[place[name]]) for name, sign in condition.joints)


def _apart(scene: Scene, pair: Pair, q: Array) -> float:
    """Returns how far the two bodies of a pair are apart at q, (n,), in metres, without their padding; 0 or less where they touch."""
    bodies = bodies_of(scene)
    links = len(bodies.parents)
    padded = distance_at(
        bodies, seen_of(scene), scene.pairs.index(pair), scene.in_windows(q), np.empty((links, 3, 3)), np.empty((links, 3))
    )
    return float(padded + 2 * scene.padding_of(pair))
