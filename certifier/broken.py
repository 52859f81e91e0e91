"""Says in words what is wrong at a configuration: that bodies touch, or by how much a condition is not kept."""

from __future__ import annotations

import math

import numpy as np

from certifier.conditioned import condition_of
from certifier.conditions import Cone, Inside, Range
from certifier.kinematics import Kinematics
from certifier.model import Array, Pair, Scene


def trouble(scene: Scene, pair: Pair, q: Array | None = None) -> str:
    """Returns in words that a pair touches, or that the condition that it proves is not kept.

    Args:
        q: (n,) where, radians or metres; None where only the pair is known.
    """
    condition = condition_of(scene, pair)
    if condition is None:
        return f"{pair.a} and {pair.b} touch"
    by = ""
    if q is not None:
        s, kinematics = scene.to_s(scene.in_windows(q))[None], Kinematics.of(scene)
        match condition:
            case Cone():
                ends = kinematics.points(condition.of, condition.body, np.array([condition.axis, [0.0, 0.0, 0.0]]), s)[0]
                angle = math.acos(float(np.clip((ends[0] - ends[1]) @ condition.along, -1.0, 1.0)))
                by = f": the angle is {math.degrees(angle):.4g} degrees, and {math.degrees(condition.angle):.9g} at most"
            case Range():
                place = {joint.name: joint.index or 0 for joint in scene.moving}
                total = sum(sign * q[place[name]] for name, sign in condition.joints)
                middle, half = (condition.lower + condition.upper) / 2, (condition.upper - condition.lower) / 2
                beyond = abs(math.remainder(total - middle, 2 * math.pi)) - half
                by = f": the sum of the angles is {math.degrees(beyond):.4g} degrees beyond its range"
            case Inside():
                geometry = scene.geometry(pair.a if pair.a in condition.geometries else pair.b)
                faces = np.array(condition.faces)
                points = kinematics.points(condition.of, geometry.body, geometry.vertices, s)[0]
                beyond = float((points @ faces[:, :3].T - faces[:, 3]).max()) + geometry.radius
                by = f": {geometry.name} reaches {1000 * beyond:.4g} mm beyond the zone"
    return f"the condition '{condition.name}' is not kept{by}"
