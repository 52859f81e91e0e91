"""Plans with Drake's GcsTrajectoryOptimization through the certified regions of a service, which then says whether the plan is covered.

    python examples/planner_gcs.py planar-2dof --start 0 0 --goal 0.3 -0.2

It looks for new regions until some lead from start to goal. It needs drake beside ``ciris[client]``.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry.optimization import GraphOfConvexSetsOptions, HPolyhedron, Point
from pydrake.planning import GcsTrajectoryOptimization

import ciris

INSIDE = 1e-6
"""The optimizer keeps this far, in s, from every face, because its own tolerance must not lead it out of a region."""


def plan(regions: Sequence[ciris.Region], start: NDArray[np.float64], goal: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Returns the shortest polyline in s through the regions, (k, n), from start to goal, (n,) each, in s; None if there is none."""
    sets = [HPolyhedron(region.C, region.d - INSIDE * np.linalg.norm(region.C, axis=1)) for region in regions]
    if not all(any(one.PointInSet(end) for one in sets) for end in (start, goal)):
        return None
    gcs = GcsTrajectoryOptimization(len(start))
    inside = gcs.AddRegions(sets, order=1, name="regions")
    source, target = gcs.AddRegions([Point(start)], order=0, name="start"), gcs.AddRegions([Point(goal)], order=0, name="goal")
    gcs.AddEdges(source, inside)
    gcs.AddEdges(inside, target)
    gcs.AddPathLengthCost()
    options = GraphOfConvexSetsOptions()
    options.convex_relaxation, options.max_rounded_paths = True, 5
    trajectory, result = gcs.SolvePath(source, target, options)
    if not result.is_success():
        return None
    pieces = [trajectory.segment(i).control_points().T for i in range(trajectory.get_number_of_segments())]
    points = np.vstack([start, *pieces, goal])
    kept = [points[0], *(b for a, b in pairwise(points) if np.linalg.norm(b - a) > INSIDE / 10)]
    return np.array([start, *kept[1:-1], goal])


def within(space: ciris.Space, q: Sequence[float], field: str) -> None:
    """Refuses joint positions, (n,), outside of the limits, where no region can be: nobody needs to wait for one."""
    for joint, value, lower, upper in zip(space.joints, space.points(q, field), space.q_lower, space.q_upper, strict=True):
        if not lower <= value <= upper:
            message = f"{joint} is at {value:.6g}, not between its limits {lower:.6g} and {upper:.6g}"
            raise ciris.CirisError("outside_limits", message, field=field, hint="move it between them")


def drive(service: ciris.Service, name: str, start: Sequence[float], goal: Sequence[float], patience: float) -> NDArray[np.float64] | None:
    """Plans from start to goal, joint positions, with the regions that there are, again and again until some lead there.

    Returns:
        The waypoints in q, (k, n), of a motion that is straight in s and proved to be free of collision; None if ``patience`` seconds pass.

    Raises:
        CirisError: outside_limits; what the service refuses.
    """
    scene, until = service.scene(name), time.monotonic() + patience
    for field, end in (("start", start), ("goal", goal)):
        within(scene.space, end, field)
    while True:
        waypoints = plan(service.regions(scene), scene.to_s(start), scene.to_s(goal))
        if waypoints is not None and service.path(scene, s=waypoints):
            return scene.to_q(waypoints)
        if not time.monotonic() < until:
            return None
        time.sleep(1)


def main() -> int:
    parser = argparse.ArgumentParser(description="Plans through the certified regions of a service.")
    parser.add_argument("scene", help="name or id of a scene that the service knows")
    for end in ("start", "goal"):
        parser.add_argument(f"--{end}", required=True, nargs="+", type=float, metavar="Q", help="joint positions, in radians or metres")
    parser.add_argument("--patience", type=float, default=60, help="seconds to wait for regions that lead there")
    asked = parser.parse_args()
    try:
        with ciris.connect() as service:
            waypoints = drive(service, asked.scene, asked.start, asked.goal, asked.patience)
    except ciris.CirisError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    if waypoints is None:
        print("no certified regions lead there", file=sys.stderr)
        return 1
    for waypoint in waypoints:
        print(", ".join(f"{x:.6g}" for x in waypoint))
    print("every point of this motion is in certified regions", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
