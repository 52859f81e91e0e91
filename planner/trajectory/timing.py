"""A curve in q is given times here, from rest to rest, as early as the limits of speed and acceleration allow. This loads Drake.

Drake's Toppra holds the limits at the points of its grid. What counts are the configurations that are returned: if their differences
exceed a limit, all times are stretched until they do not.
"""

from __future__ import annotations

import numpy as np
from pydrake.multibody.optimization import Toppra
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, SpatialInertia
from pydrake.trajectories import PiecewisePolynomial

from certifier.model import Array
from planner.trajectory.straight import MOST, straight
from planner.trajectory.stretch import UP, stretched

STILL = 1e-6
"""A curve that is no longer than this is as good as a point, because solvers are not more exact; and so is a part of a curve that is so
much shorter than all of it.
"""
FEWEST = 17
"""Least number of configurations of a curve."""
NEAR = 0.25
"""Points that a motion has to go through are at least this part of a step apart in time."""
_FAST = 1e6
"""No joint need be faster: Toppra has its numbers in units in which the whole motion lasts about 1."""


def length(curve: Array) -> float:
    """Returns the length in q of points joined by straight lines, (m, n)."""
    return float(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum())


def timed(
    curve: Array, through: list[int], speed: Array, acceleration: Array, spacing: float, straight_between: bool = False
) -> tuple[Array, Array] | None:
    """Returns configurations q (k, n) of a curve at about equal steps of time, and their times t (k,) in seconds.

    None where Toppra finds none.
    First and second divided differences of what is returned are within the limits, those at the two ends, where the robot rests, as well.

    Args:
        curve: (m, n) points in q; a smooth spline goes through them.
        through: numbers of points that are among the configurations, each in place of the one that is nearest in time; of those that are
            nearer to each other than half a step, the first.
        speed, acceleration: (n,) limits of every joint.
        spacing: no joint moves much farther between two configurations, unless there would be more than MOST of them.
        straight_between: whether the configurations are on the straight lines between the points, and not on the spline.
    """
    if length(curve) <= STILL:
        return curve[[0, -1]], np.array([0.0, UP * _least(np.abs(curve[-1] - curve[0]), speed, acceleration)])
    along = _along(curve)
    moves = np.concatenate([[True], np.diff(along) > 0])
    if moves.sum() < 3:
        return straight(curve[0], curve[-1], speed, acceleration, spacing)
    path = PiecewisePolynomial.CubicWithContinuousSecondDerivatives(along[moves], curve[moves].T)
    unit = _least(np.abs(np.diff(curve, axis=0)).sum(axis=0), speed, acceleration)
    toppra = Toppra(path, _sliders(len(speed)), along[moves])
    for limit, add in ((speed * unit, toppra.AddJointVelocityLimit), (acceleration * unit**2, toppra.AddJointAccelerationLimit)):
        no_more = np.minimum(limit, _FAST)
        add(-no_more, no_more)
    course = toppra.SolvePathParameterization()
    if course is None or not np.isfinite(course.get_segment_times()).all():
        return None
    fine = np.linspace(course.start_time(), course.end_time(), MOST)
    reached = np.clip(course.vector_values(fine)[0], 0.0, along[-1])
    if not np.isfinite(reached).all():
        return None
    steps = np.abs(np.diff(path.vector_values(reached))).max() * (MOST - 1) / spacing
    t = np.linspace(fine[0], fine[-1], int(np.clip(np.ceil(steps) + 1, FEWEST, MOST)))
    when = np.interp(along[through], reached, fine)
    kept = _apart(when, t[1] * NEAR)
    t = t[np.abs(t[:, None] - when[None, kept]).min(axis=1, initial=np.inf) >= t[1] / 2]
    t = np.unique(np.concatenate([fine[:1], t, when[kept], fine[-1:]]))
    reached = np.clip(course.vector_values(t)[0], 0.0, along[-1])
    q = np.column_stack([np.interp(reached, along, joint) for joint in curve.T]) if straight_between else path.vector_values(reached).T
    q[np.searchsorted(t, when[kept])], q[0], q[-1] = curve[through][kept], curve[0], curve[-1]
    return q, stretched(q, t * unit, speed, acceleration)


def _apart(times: Array, least: float) -> list[int]:
    """Returns the numbers of times, (m,) ascending, each of which is later by ``least`` than the one before that is among them."""
    kept: list[int] = []
    for i, time in enumerate(times.tolist()):
        if not kept or time - times[kept[-1]] >= least:
            kept.append(i)
    return kept


def _least(way: Array, speed: Array, acceleration: Array) -> float:
    """Returns the time that the slowest joint needs for its way, (n,), by either limit alone. A motion takes a few times as long."""
    return max(float((way / speed).max()), float(np.sqrt(way / acceleration).max()))


def _along(curve: Array) -> Array:
    """Returns how far along the curve its points are, (m,); those where it stays are no farther than the one before."""
    far = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(np.where(far > STILL * far.sum(), far, 0.0))])


def _sliders(n: int) -> MultibodyPlant:
    """Returns a plant with n positions, which is all that limits of the joints ask of one."""
    plant = MultibodyPlant(time_step=0.0)
    for i in range(n):
        body = plant.AddRigidBody(f"slider{i}", SpatialInertia.SolidSphereWithMass(1.0, 1.0))
        plant.AddJoint(PrismaticJoint(f"along{i}", plant.world_frame(), body.body_frame(), [1.0, 0.0, 0.0]))
    plant.Finalize()
    return plant
