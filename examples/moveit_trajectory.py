"""Certifies a trajectory as MoveIt and ROS write it: joint names, and points with positions and time_from_start. No ROS is needed.

    python examples/moveit_trajectory.py planar-2dof trajectory.json

The file holds a JointTrajectory, or a RobotTrajectory with its ``joint_trajectory``, as JSON. The exit status is 0 if the whole motion is
certified, 1 if not, and 2 for a mistake. It needs ``ciris[client]`` alone.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import ciris

Array = NDArray[np.float64]


def refused(field: str, message: str, hint: str) -> ciris.CirisError:
    return ciris.CirisError("trajectory", message, field=field, hint=hint)


def columns(names: Sequence[str], joints: Sequence[str]) -> list[int]:
    """Returns where each joint of the scene is in the trajectory. The joint ``arm/elbow`` may be called ``elbow`` there."""
    found = []
    for joint in joints:
        fitting = [i for i, name in enumerate(names) if name in (joint, joint.rpartition("/")[2])]
        if len(fitting) != 1:
            raise refused("joint_names", f"{len(fitting)} of the names mean the joint {joint}", "each joint of the scene needs one column")
        found += fitting
    strange = [name for i, name in enumerate(names) if i not in found]
    if strange or len(set(found)) < len(found):
        hint = f"the scene's joints are {', '.join(joints)}; `fix` of a scene file holds a joint"
        raise refused("joint_names", f"not one joint of the scene for each of {', '.join(strange or names)}", hint)
    return found


def seconds(time: Any) -> float:
    """Returns a time as ROS 2, ROS 1 or people write it."""
    if isinstance(time, dict):
        return time.get("sec", time.get("secs", 0)) + 1e-9 * time.get("nanosec", time.get("nsecs", 0))
    return float(time)


def curve(points: Sequence[dict[str, Any]], order: Sequence[int], t: Array) -> tuple[Array, bool]:
    """Returns the motion between the points as a controller of ROS 2 interpolates it, and whether it is curved.

    With positions alone that is straight lines, (k, n) waypoints. With velocities it is cubics, with accelerations as well quintics:
    (k - 1, m + 1, n) control points of Bezier pieces.
    """
    given = [name for name in ("positions", "velocities", "accelerations") if all(len(point.get(name) or []) for point in points)]
    q, *rates = (np.array([point[name] for point in points], dtype=float)[:, order] for name in given)
    if given[1:2] != ["velocities"]:
        return q, False
    h, degree = np.diff(t)[:, None], 5 if len(rates) == 2 else 3
    begin, end = [q[:-1], q[:-1] + rates[0][:-1] * h / degree], [q[1:] - rates[0][1:] * h / degree, q[1:]]
    if degree == 5:
        begin.append(2 * begin[1] - begin[0] + rates[1][:-1] * h**2 / 20)
        end.insert(0, 2 * end[0] - end[1] + rates[1][1:] * h**2 / 20)
    return np.stack([*begin, *end], axis=1), True


def certify(service: ciris.Service, name: str, document: dict[str, Any]) -> int:
    """Certifies the trajectory in the scene, prints the verdict, and returns the exit status."""
    scene = service.scene(name)
    try:
        trajectory = document.get("joint_trajectory", document)
        points, names = trajectory["points"], trajectory["joint_names"]
        order = columns(names, scene.joints)
        t = np.array([seconds(point["time_from_start"]) for point in points])
        if not all(a < b for a, b in pairwise(t)):
            raise refused("points", "time_from_start does not ascend", "leave out points that repeat the one before")
        motion, curved = curve(points, order, t)
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
        hint = "every point needs time_from_start and one position for each of joint_names"
        raise refused("points", f"this is no JointTrajectory ({type(error).__name__}: {error})", hint) from None

    verdict = service.certify_path(scene, bezier=motion) if curved else service.certify_path(scene, motion)
    if verdict:
        print(f"certified: no collision in {t[-1] - t[0]:g} s, {verdict.intervals} planes; {verdict.not_covered_summary}")
        return 0
    print(f"not certified: {verdict.outcome.value.replace('_', ' ')}")
    if verdict.stop:
        stop = verdict.stop
        at = t[stop.piece] + stop.time * (t[stop.piece + 1] - t[stop.piece])
        print(f"{stop.a} and {stop.b}, {at:.6g} s after the start")
        print(", ".join(f"{joint} = {value:.6g}" for joint, value in zip(scene.joints, stop.q, strict=True)))
    return 1


def main() -> int:
    parser = argparse.ArgumentParser(description="Certifies a trajectory of MoveIt or ROS.")
    parser.add_argument("scene", help="name or id of a scene that the service knows")
    parser.add_argument("trajectory", type=Path, help="JSON file of a JointTrajectory or RobotTrajectory")
    asked = parser.parse_args()
    try:
        document = json.loads(asked.trajectory.read_text())
        with ciris.connect() as service:
            return certify(service, asked.scene, document)
    except (ciris.CirisError, OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
