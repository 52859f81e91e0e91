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

STILL = 1e-6
"""A curve that is no longer than this is as good as a point, because solvers are not more exact; and so is a part of a curve that is so
much shorter than all of it.
"""
FEWEST, MOST = 17, 4000
"""A trajectory has so many configurations at least and at most."""
_UP = 1 + 1e-6


def length(curve: Array) -> float:
    """Returns the length in q of points joined by straight lines, (m, n)."""
    return float(np.linalg.norm(np.diff(curve, axis=0), axis=1).sum())


def timed(curve: Array, speed: Array, acceleration: Array, spacing: float) -> tuple[Array, Array] | None:
    """Returns configurations q (k, n) of a curve at equal steps of time, and their times t (k,) in seconds; None where Toppra finds none.

    First and second divided differences of what is returned are within the limits, those at the two ends, where the robot rests, as well.

    Args:
        curve: (m, n) points in q; a smooth spline goes through them.
        speed, acceleration: (n,) limits of every joint.
        spacing: no joint moves farther between two configurations, unless there would be more than MOST of them.
    """
    if length(curve) <= STILL:
        way = np.abs(curve[-1] - curve[0])
        return curve[[0, -1]], np.array([0.0, _UP * max((way / speed).max(), np.sqrt(way / acceleration).max())])
    path = _spline(curve)
    toppra = Toppra(path, _sliders(len(speed)), np.array(path.get_segment_times()))
    toppra.AddJointVelocityLimit(-speed, speed)
    toppra.AddJointAccelerationLimit(-acceleration, acceleration)
    course = toppra.SolvePathParameterization()
    if course is None:
        return None
    steps = np.abs(np.diff(_at(path, course, MOST), axis=0)).max() * (MOST - 1) / spacing
    q = _at(path, course, int(np.clip(np.ceil(steps) + 1, FEWEST, MOST)))
    q[0], q[-1] = curve[0], curve[-1]
    t = np.linspace(0, course.end_time() - course.start_time(), len(q))
    return q, t * _stretch(q, t[1], speed, acceleration)


def _spline(curve: Array) -> PiecewisePolynomial:
    """Returns a cubic spline through the points, by their distance along the curve. Points where the curve stays are left out."""
    far = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    moves = far > STILL * far.sum()
    points = np.concatenate([curve[:1], curve[1:][moves]])
    along = np.concatenate([[0.0], np.cumsum(far[moves])])
    return PiecewisePolynomial.CubicWithContinuousSecondDerivatives(along, points.T)


def _at(path: PiecewisePolynomial, course: PiecewisePolynomial, count: int) -> Array:
    """Returns so many configurations, (count, n), at equal steps of time."""
    t = np.linspace(course.start_time(), course.end_time(), count)
    u = np.clip(course.vector_values(t)[0], path.start_time(), path.end_time())
    return np.array(path.vector_values(u).T)


def _stretch(q: Array, step: float, speed: Array, acceleration: Array) -> float:
    """Returns by what factor, 1 or more, the times have to be multiplied for the differences to be within the limits."""
    velocity = np.diff(q, axis=0) / step
    at_rest = np.zeros((1, q.shape[1]))
    change = np.diff(np.concatenate([at_rest, velocity, at_rest]), axis=0) / step
    over = max(float((np.abs(velocity) / speed).max()), float(np.sqrt(np.abs(change) / acceleration).max()))
    return max(1.0, over * _UP)


def _sliders(n: int) -> MultibodyPlant:
    """Returns a plant with n positions, which is all that limits of the joints ask of one."""
    plant = MultibodyPlant(time_step=0.0)
    for i in range(n):
        body = plant.AddRigidBody(f"slider{i}", SpatialInertia.SolidSphereWithMass(1.0, 1.0))
        plant.AddJoint(PrismaticJoint(f"along{i}", plant.world_frame(), body.body_frame(), [1.0, 0.0, 0.0]))
    plant.Finalize()
    return plant
