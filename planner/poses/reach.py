"""Compiled Newton steps from a configuration to one that reaches a pose.

A step is that of Levenberg and Marquardt with the damping of Yamashita and Fukushima (2001), a part of the squared error, which keeps
Newton's convergence where the arm is singular. A joint at a limit that its step would leave stays there and the others do its part. For an
arm with joints to spare the steps are the shortest ones, so the configuration found is near the one they began at.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from certifier.model import Array
from planner.poses.frame import Frame, Pose, place

TIGHT = 1e-9
"""A pose is reached where the frame is this near to it, in metres, and in radians."""
_FINE = 1e-12
"""Steps end where the error is so small, in the arm's size and in radians; they get there from TIGHT in one more step."""
_STEPS = 60
_LONGEST = 1.0
"""No joint moves farther than this in a step, radians or metres."""


@njit(cache=True)
def errors(frame: Frame, pose: Pose, goal: Pose, e: Array) -> tuple[float, float]:
    """Fills in what is missing to a goal, (6,), as a shift over the arm's size and a rotation vector; returns its metres and radians."""
    a, b = goal.turn, pose.turn
    w = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    e[3] = -a[0] * b[1] + a[1] * b[0] - a[2] * b[3] + a[3] * b[2]
    e[4] = -a[0] * b[2] + a[2] * b[0] - a[3] * b[1] + a[1] * b[3]
    e[5] = -a[0] * b[3] + a[3] * b[0] - a[1] * b[2] + a[2] * b[1]
    sine = np.sqrt(e[3] * e[3] + e[4] * e[4] + e[5] * e[5])
    angle = 2.0 * np.arctan2(sine, abs(w))
    e[3:] *= np.copysign(angle / sine if sine > 0.0 else 0.0, w)
    square = 0.0
    for i in range(3):
        e[i] = goal.position[i] - pose.position[i]
        square += e[i] * e[i]
        e[i] /= frame.size
    return np.sqrt(square), angle


@njit(cache=True)
def jacobian(frame: Frame, pose: Pose, axes: Array, origins: Array, J: Array) -> None:
    """Fills in how each joint moves the frame, (m, 6): its origin over the arm's size, and its rotation, in the world."""
    for k in range(len(frame.joints)):
        u, p = axes[k], pose.position - origins[k]
        if frame.slides[k]:
            J[k, :3], J[k, 3:] = u, 0.0
        else:
            J[k, 0], J[k, 1], J[k, 2] = u[1] * p[2] - u[2] * p[1], u[2] * p[0] - u[0] * p[2], u[0] * p[1] - u[1] * p[0]
            J[k, 3:] = u
        J[k, :3] /= frame.size


@njit(cache=True)
def reach(frame: Frame, goal: Pose, q: Array) -> tuple[float, float]:
    """Moves joint positions q, (n,), to where the frame is at a goal, or as near to it as steps lead.

    Args:
        q: the frame's joints change, within their limits.

    Returns:
        how far the frame is from the goal then, metres and radians.
    """
    m = len(frame.joints)
    axes, origins, J, A = np.empty((m, 3)), np.empty((m, 3)), np.empty((m, 6)), np.empty((6, 6))
    pose, e, tried, g = Pose(np.empty(3), np.empty(4)), np.empty(6), np.empty(6), np.empty(m)
    before, damping, slow = np.empty(m), 0.1, 0
    for k in range(m):
        i = frame.joints[k]
        q[i] = min(max(q[i], frame.lower[i]), frame.upper[i])
    place(frame, q, pose, axes, origins)
    metres, radians = errors(frame, pose, goal, e)
    square = e @ e
    jacobian(frame, pose, axes, origins, J)
    for _ in range(_STEPS):
        if square <= _FINE * _FINE:
            break
        for k in range(m):
            i = frame.joints[k]
            g[k] = J[k] @ e
            if (q[i] <= frame.lower[i] and g[k] < 0.0) or (q[i] >= frame.upper[i] and g[k] > 0.0):
                J[k] = 0.0
            before[k] = q[i]
        _step(J, e, damping * square, A, g)
        longest = np.abs(g).max()
        if longest > _LONGEST:
            g *= _LONGEST / longest
        for k in range(m):
            i = frame.joints[k]
            q[i] = min(max(before[k] + g[k], frame.lower[i]), frame.upper[i])
        place(frame, q, pose, axes, origins)
        far, angle = errors(frame, pose, goal, tried)
        less = tried @ tried
        if less < square:
            slow = slow + 1 if less > 0.9 * square else 0
            metres, radians, square = far, angle, less
            e[:] = tried
            jacobian(frame, pose, axes, origins, J)
            damping = max(0.2 * damping, 1e-6)
            if slow == 6:
                break
        else:
            for k in range(m):
                q[frame.joints[k]] = before[k]
            if longest < 1e-13 or (metres <= TIGHT / 10.0 and radians <= TIGHT / 10.0):
                break
            damping *= 8.0
    return metres, radians


@njit(cache=True)
def _step(J: Array, e: Array, damping: float, A: Array, step: Array) -> None:
    """Fills in J (J' J + damping I)^-1 e, (m,), where J is (m, 6), by Cholesky's decomposition."""
    m = len(J)
    y = e.copy()
    for i in range(6):
        for j in range(i + 1):
            total = damping if i == j else 0.0
            for k in range(m):
                total += J[k, i] * J[k, j]
            for k in range(j):
                total -= A[i, k] * A[j, k]
            if i == j:
                A[i, i] = np.sqrt(max(total, 1e-15))
            else:
                A[i, j] = total / A[j, j]
        for k in range(i):
            y[i] -= A[i, k] * y[k]
        y[i] /= A[i, i]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            y[i] -= A[k, i] * y[k]
        y[i] /= A[i, i]
    for k in range(m):
        step[k] = J[k] @ y


@njit(cache=True)
def reach_all(frame: Frame, goal: Pose, q: Array) -> Array:
    """Does with every row of q, (N, n), contiguous, what :func:`reach` does; returns (N, 2) metres and radians."""
    found = np.empty((len(q), 2))
    for i in range(len(q)):
        found[i] = reach(frame, goal, q[i])
    return found
