"""Straight lines of a frame of the robot: waypoints in q between which it stays near a line in space, as bounds show and not samples.

The line leads from the pose at the start to the goal. At the part u of it, the position is p(u), linear in u, and the rotation is that of
the unit quaternion z(u), which turns evenly about one axis. At a waypoint the frame is on the line, to planner.poses.reach.TIGHT. Between
two waypoints q is straight, and the frame is compared with the line at the same part t of the way, 0 <= t <= 1. Let d(t) be the difference
of the two. Let D bound its third derivative. Taylor's theorem about t = 1/2 for d'', and the Green's function of d'', show that

    |d(t)| <= max(|d(0)|, |d(1)|) + |d''(1/2)|/8 + D/48

- Position. p is linear, so d'' is the second derivative of the frame's origin x; it is computed at t = 1/2 from the joints' axes a. The
  third derivative of x by joints j, k, l, in the order from the world on, is a_j x (a_k x dx/dq_l), and |dx/dq_l| is at most the lever of l
  (certifier.motion.chains). Let T_l be the sum of |dq_k| over the revolute joints k up to l. A revolute joint l adds
  lever_l (T_l^3 - T_(l-1)^3) to D, and a prismatic one 3 T_(l-1)^2 lever_l |dq_l|.
- Rotation. The frame's quaternion y is a product with one factor for each joint, and each derivative of it by a joint's angle is half a
  unit quaternion. So its third derivative is at most (T/2)^3, where T is the sum over all joints. Let v be the sum of dq_k a_k, and b that
  of dq_j dq_k (a_j x a_k) over j < k; then y'' = (b/2 - |v|^2/4) y. For an angle w between the waypoints, z'' = -(w/2)^2 z, and the third
  derivative is (w/2)^3. A bound of |y - z| is one of the angle between the rotations, 4 asin(|y - z|/2). The quaternions' signs matter:
  where a joint makes a whole turn from one waypoint to the next, y is far from z.

So all along a segment the frame is within the tolerances of the line's pose at the same part of the way. It is as near to the straight
segment in space, and it goes forward along it, but for the tolerance. All is computed in floating point, and its rounding is not bounded.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from certifier.errors import RegionError
from certifier.model import Array, Scene
from planner.poses.frame import Frame, Pose, frame_of, place, pose_at, pose_of, times
from planner.poses.reach import TIGHT, jacobian, reach

FINEST = 1e-6
"""No tolerance is finer than this, in metres or radians."""
SHORTEST = 2.0**-14
"""No segment is shorter than this part of the line."""
FLAT = 1e-2
"""The arm is singular where joints that move by 1 move the frame in some direction by less than this, in the arm's size or in radians."""


@dataclass(frozen=True, eq=False)
class Line:
    """A motion of the robot along a straight line of a frame, or the beginning of one.

    Attributes:
        q: (k, n) waypoints from the start on, k >= 1, radians or metres; q is straight between them.
        parts: (k,) the part of the line that is behind the frame at each waypoint, from 0 to 1.
        metres, radians: bounds of how far the frame is from the line anywhere on the motion.
        reason: None where the motion goes all along the line. Otherwise why it ends: ``"limit"``, a joint would have to leave its limits;
            ``"singular"``, the frame can hardly move in some direction there, because the arm is stretched or axes are in line, so the
            line goes on nowhere, or in another branch, far away in q; ``"tolerance"``, it needs segments shorter than SHORTEST.
        joint: name of the joint at its limit; None for other reasons.
    """

    q: Array
    parts: Array
    metres: float
    radians: float
    reason: str | None = None
    joint: str | None = None


def line(
    scene: Scene,
    frame: str,
    start: ArrayLike,
    position: ArrayLike,
    rpy: ArrayLike | None = None,
    *,
    metres: float = 1e-3,
    radians: float = 1e-2,
) -> Line:
    """Returns waypoints along a straight line of a frame, within the joints' own limits. It says nothing about collisions.

    Args:
        frame: as for planner.poses.frame.frame_of.
        start: (n,) where the motion begins, radians or metres. Joints that do not move the frame stay there.
        position, rpy: (3,) metres and (3,) radians, the goal, as for planner.poses.frame.pose_of; without rpy the frame does not turn.
        metres, radians: the tolerances.

    Raises:
        RegionError: ``unknown_frame``, ``ambiguous_frame``, ``fixed_frame``, ``wrong_length``, ``number_too_large``, or ``tolerance`` for
            one below FINEST.
    """
    arm = frame_of(scene, frame)
    for field, given in (("metres", metres), ("radians", radians)):
        if not given >= FINEST:
            raise RegionError("tolerance", f"{given:g} {field} is too fine a tolerance", field=field, hint=f"give at least {FINEST:g}")
    begin = np.array(start, dtype=float)
    here = pose_at(arm, begin)
    goal = pose_of(position, np.zeros(3) if rpy is None else rpy)
    outside = [i for i in arm.joints if not arm.lower[i] <= begin[i] <= arm.upper[i]]
    if outside:
        return Line(begin[None], np.zeros(1), 0.0, 0.0, "limit", scene.moving[outside[0]].name)
    way = _Way(here, Pose(goal.position, here.turn) if rpy is None else goal)
    return _followed(scene, arm, begin, way, np.array([metres, radians]))


def keeps(
    scene: Scene,
    frame: str,
    start: ArrayLike,
    position: ArrayLike,
    rpy: ArrayLike | None,
    q: Array,
    *,
    metres: float,
    radians: float,
) -> bool:
    """Says whether a motion, (K, n) and straight in q between its rows, stays within the tolerances of a line and goes forward on it.

    The other arguments are those of :func:`line`. Each row belongs to the part of the line that its frame is nearest to.
    """
    arm = frame_of(scene, frame)
    here, goal = pose_at(arm, np.array(start, dtype=float)), pose_of(position, np.zeros(3) if rpy is None else rpy)
    way = _Way(here, Pose(goal.position, here.turn) if rpy is None else goal)
    parts = np.maximum.accumulate([way.nearest(pose_at(arm, row)) for row in q])
    parts[0], parts[-1] = 0.0, 1.0
    for a, b, u, end in zip(q[:-1], q[1:], parts[:-1].tolist(), parts[1:].tolist(), strict=True):
        off, apart = deviation(arm, a, b, way.at(u), way.at((u + end) / 2), way.at(end), (end - u) * way.angle)
        if not (off <= metres and apart <= radians):
            return False
    return True


class _Way:
    """The line itself, from a pose to another; ``angle`` is by how much it turns, radians."""

    def __init__(self, here: Pose, there: Pose) -> None:
        self._here, self._shift = here, there.position - here.position
        turn = times(there.turn, here.turn * np.array([1.0, -1.0, -1.0, -1.0]))
        turn = turn if turn[0] >= 0 else -turn
        sine = float(np.linalg.norm(turn[1:]))
        self.angle = 2 * float(np.arctan2(sine, turn[0]))
        self._axis = turn[1:] / sine if sine else turn[1:]

    def at(self, u: float) -> Pose:
        """Returns the pose at the part u of the line."""
        half = u * self.angle / 2
        turn = times(np.array([np.cos(half), *(np.sin(half) * self._axis)]), self._here.turn)
        return Pose(self._here.position + u * self._shift, turn)

    def nearest(self, pose: Pose) -> float:
        """Returns the part of the line that a pose is nearest to: by its position, or by its turn where the position rests."""
        square = float(self._shift @ self._shift)
        if square > TIGHT**2:
            return float(np.clip((pose.position - self._here.position) @ self._shift / square, 0.0, 1.0))
        turn = times(pose.turn, self._here.turn * np.array([1.0, -1.0, -1.0, -1.0]))
        turned = 2 * float(np.arctan2(turn[1:] @ self._axis, turn[0]))
        return float(np.clip(turned / self.angle, 0.0, 1.0)) if self.angle > 0 else 0.0


def _followed(scene: Scene, arm: Frame, start: Array, way: _Way, tolerance: Array) -> Line:
    """Returns the motion along the line. A segment is as long as the bounds let it be, as far as the last one tells."""
    rows, parts, most = [start], [0.0], np.zeros(2)
    u, step = 0.0, 1.0
    while u < 1.0:
        end, q = min(1.0, u + step), rows[-1].copy()
        ratio, bounds = _segment(arm, rows[-1], q, way, u, end, tolerance)
        if ratio <= 1.0:
            rows.append(q)
            parts.append(end)
            most = np.maximum(most, bounds)
            step, u = max(SHORTEST, (end - u) * 0.95 / max(ratio, 0.2) ** 0.5), end
        elif step <= SHORTEST:
            reason, joint = _why(scene, arm, rows[-1], way, u, tolerance)
            return Line(np.array(rows), np.array(parts), float(most[0]), float(most[1]), reason, joint)
        else:
            step = max(SHORTEST, (end - u) * max(0.25, 0.9 / ratio**0.5))
    return Line(np.array(rows), np.array(parts), float(most[0]), float(most[1]))


def _segment(arm: Frame, a: Array, b: Array, way: _Way, u: float, end: float, tolerance: Array) -> tuple[float, Array]:
    """Moves b, (n,), to where the frame is on the line at its part ``end``.

    Returns:
        how large the bounds of the segment from a, at the part u, to b are as a part of the tolerance, infinite where b does not reach the
        line; and the bounds, (2,) metres and radians.
    """
    goal = way.at(end)
    if max(reach(arm, goal, b)) > TIGHT:
        return np.inf, np.full(2, np.inf)
    bounds = np.array(deviation(arm, a, b, way.at(u), way.at((u + end) / 2), goal, (end - u) * way.angle))
    return float((bounds / tolerance).max()), bounds


def _why(scene: Scene, arm: Frame, q: Array, way: _Way, u: float, tolerance: Array) -> tuple[str, str | None]:
    """Returns why the frame cannot move on along the line from q, (n,), at its part u: the reason, and the joint at its limit."""
    everywhere, on = np.full(scene.n, np.inf), q.copy()
    ratio, _ = _segment(arm._replace(lower=-everywhere, upper=everywhere), q, on, way, u, min(1.0, u + SHORTEST), tolerance)
    outside = np.maximum(arm.lower - on, on - arm.upper)
    if ratio <= 1.0 and outside.max() > 0.0:
        return "limit", scene.moving[int(outside.argmax())].name
    m = len(arm.joints)
    axes, origins, J, pose = np.empty((m, 3)), np.empty((m, 3)), np.empty((m, 6)), Pose(np.empty(3), np.empty(4))
    place(arm, q, pose, axes, origins)
    jacobian(arm, pose, axes, origins, J)
    singular = np.isinf(ratio) or np.linalg.svd(J, compute_uv=False).min() < FLAT
    return ("singular" if singular else "tolerance"), None


@njit(cache=True)
def deviation(arm: Frame, a: Array, b: Array, first: Pose, middle: Pose, last: Pose, angle: float) -> tuple[float, float]:
    """Returns bounds of how far the frame is from a piece of the line while q goes straight from a to b, (n,) each: metres and radians.

    Args:
        first, middle, last: poses of the line at the beginning, in the middle and at the end of the piece. Their quaternions are those of a
            continuous motion that begins with the frame's own.
        angle: by which the line turns on the piece, radians.
    """
    m = len(arm.joints)
    axes, origins, pose = np.empty((m, 3)), np.empty((m, 3)), Pose(np.empty(3), np.empty(4))
    off, apart = 0.0, 0.0
    for q, line in ((a, first), (b, last)):
        place(arm, q, pose, axes, origins)
        off = max(off, _length(pose.position - line.position))
        apart = max(apart, _length(pose.turn - line.turn))
    place(arm, (a + b) / 2.0, pose, axes, origins)
    bent, rotating, changing = np.zeros(3), np.zeros(3), np.zeros(3)  # x'', v and b of the joints so far
    jerk, turning = 0.0, 0.0
    for k in range(m):
        rate, u = b[arm.joints[k]] - a[arm.joints[k]], axes[k]
        if arm.slides[k]:
            bent += 2.0 * rate * np.cross(rotating, u)
            jerk += 3.0 * turning**2 * arm.levers[k] * abs(rate)
        else:
            moved = rate * np.cross(u, pose.position - origins[k])
            bent += np.cross(2.0 * rotating + rate * u, moved)
            changing += rate * np.cross(rotating, u)
            rotating += rate * u
            jerk += arm.levers[k] * ((turning + abs(rate)) ** 3 - turning**3)
            turning += abs(rate)
    curved = np.empty(4)
    curved[0], curved[1:] = -(rotating @ rotating) / 4.0, changing / 2.0
    curved = times(curved, pose.turn) + (angle / 2.0) ** 2 * middle.turn
    chord = apart + _length(curved) / 8.0 + (turning**3 + angle**3) / 384.0
    return off + _length(bent) / 8.0 + jerk / 48.0, 4.0 * np.arcsin(min(1.0, chord / 2.0))


@njit(cache=True)
def _length(v: Array) -> float:
    return np.sqrt(v @ v)
