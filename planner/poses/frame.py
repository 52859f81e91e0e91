"""Frames by their names, and where the joints put them: compiled forward kinematics, with rotations as unit quaternions.

A frame is that of a body. The chain of joints from the world leads to it (certifier.motion.chains). With the joints' motions J and fixed
poses L, X_WB = L_0 J_0 L_1 J_1 ... L_m. The quaternion that is computed here is the product of the factors' quaternions. So it is a smooth
function of q on all of joint space: it changes its sign where a joint makes a whole turn.

Quaternions, (4,), are (w, x, y, z).
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from certifier.conditions import of_condition
from certifier.errors import RegionError, close_matches
from certifier.kinematics import Kinematics
from certifier.model import Array, Scene
from certifier.motion.chains import chain, fill_levers, lengths
from certifier.positions import check_magnitude

SHOWN = 8
"""A hint lists at most this many names of frames."""


class Pose(NamedTuple):
    """A pose in the world.

    Attributes:
        position: (3,) metres.
        turn: (4,) unit quaternion.
    """

    position: Array
    turn: Array


class Frame(NamedTuple):
    """A frame of the robot with the m joints, m >= 1, that move it; axes are in the frames of their joints.

    Attributes:
        turns: (m + 1, 4) quaternions of the fixed poses.
        offsets: (m + 1, 3) of the fixed poses, metres.
        axes: (m, 3), as certifier.motion.chains.Chain has them.
        joints: (m,) position indices, from the world on.
        slides: (m,) whether each joint is prismatic.
        levers: (m,) how far the frame's origin moves at most where the joint moves by 1: metres, or the length of the axis of a
            prismatic joint.
        lower, upper: (n,) the joints' own limits, radians or metres.
        size: metres, about the length of the arm; never 0.
    """

    turns: Array
    offsets: Array
    axes: Array
    joints: np.ndarray
    slides: np.ndarray
    levers: Array
    lower: Array
    upper: Array
    size: float


@lru_cache(maxsize=64)
def frame_of(scene: Scene, name: str) -> Frame:
    """Returns the frame of a body of the scene.

    Args:
        name: ``model/body``, or a last part of it that only one body has.

    Raises:
        RegionError: ``unknown_frame``, ``ambiguous_frame``, or ``fixed_frame`` where no joint moves it.
    """
    body = _body(scene, name)
    found = chain(Kinematics.of(scene), "world", body)
    if not len(found.joints):
        raise RegionError("fixed_frame", f"no joint moves the frame {body}", field="frame", hint=_one_of(_moved(scene)))
    lower, upper = scene.own_limits
    farthest = np.where(scene.revolute, 0.0, np.maximum(np.abs(lower), np.abs(upper)))
    levers = np.empty(len(found.joints))
    measured = lengths(found, np.zeros((1, 3)))
    chained = found.joints, found.speeds, measured.offsets, measured.across, measured.tail, measured.tail_across
    size = measured.size + fill_levers(*chained, farthest, levers)
    turns = np.array([_quaternion(R) for R in found.rotations])
    return Frame(turns, found.offsets, found.axes, found.joints, found.speeds > 0.0, levers, lower, upper, size or 1.0)


def pose_of(position: ArrayLike, rpy: ArrayLike) -> Pose:
    """Returns the pose with a position, (3,) metres, and angles of roll, pitch and yaw, (3,) radians.

    The frame turns about the world's x by roll, then about the world's y by pitch, then about the world's z by yaw, as in Drake and URDF.

    Raises:
        RegionError: ``wrong_length``, or ``number_too_large`` for what is not finite or above certifier.positions.MAGNITUDE.
    """
    p, angles = _three(position, "position"), _three(rpy, "rpy")
    turn = np.array([1.0, 0.0, 0.0, 0.0])
    for axis, angle in zip(np.eye(3), angles, strict=True):
        turn = times(np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)]), turn)
    return Pose(p, turn)


def pose_at(frame: Frame, q: Array) -> Pose:
    """Returns where the frame is at joint positions q, (n,)."""
    m = len(frame.joints)
    pose = Pose(np.empty(3), np.empty(4))
    place(frame, q, pose, np.empty((m, 3)), np.empty((m, 3)))
    return pose


def _three(given: ArrayLike, field: str) -> Array:
    numbers = np.array(given, dtype=float)
    if numbers.shape != (3,):
        what = "x, y, z in metres" if field == "position" else "roll, pitch, yaw in radians"
        raise RegionError("wrong_length", f"{field} must be 3 numbers, not of shape {numbers.shape}", field=field, hint=f"give {what}")
    check_magnitude(numbers, field)
    return numbers


def _body(scene: Scene, name: str) -> str:
    """Returns the body that is meant by its name, or by the last part of it."""
    bodies = [body for body in scene.bodies if not of_condition(body)]
    if name in bodies:
        return name
    found = [body for body in bodies if body.endswith(f"/{name}")]
    if len(found) == 1:
        return found[0]
    if found:
        raise RegionError("ambiguous_frame", f"{len(found)} bodies are called {name!r}", field="frame", hint=_one_of(found))
    known = _moved(scene)
    hint = close_matches(name, known) or _one_of(known)
    raise RegionError("unknown_frame", f"no body of the scene is called {name!r}", field="frame", hint=hint)


def _moved(scene: Scene) -> list[str]:
    """Returns the bodies that joints move, those farthest from the world first, for they are the likeliest tools."""
    kinematics = Kinematics.of(scene)
    moved = [body for body in scene.bodies if body != "world" and not of_condition(body) and kinematics.chain("world", body)]
    return sorted(moved, key=lambda body: -len(kinematics.ancestors(body)))


def _one_of(names: list[str]) -> str:
    more = ", ..." if len(names) > SHOWN else ""
    return f"name one of {', '.join(names[:SHOWN])}{more}" if names else "no joint moves anything in this scene"


def _quaternion(R: Array) -> Array:
    """Returns the unit quaternion of a rotation, (3, 3): the eigenvector of Bar-Itzhack's matrix, which is exact to rounding everywhere."""
    K = np.empty((4, 4))
    K[0, 0] = np.trace(R)
    K[0, 1:] = K[1:, 0] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    K[1:, 1:] = R + R.T - np.trace(R) * np.eye(3)
    return np.linalg.eigh(K)[1][:, -1]


@njit(cache=True)
def times(a: Array, b: Array) -> Array:
    """Returns the product of two quaternions, (4,): the rotation b, then the rotation a."""
    return np.array(
        [
            a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
            a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
        ]
    )


@njit(cache=True)
def turned(a: Array, v: Array, out: Array) -> None:
    """Fills in a vector, (3,), that the rotation of a unit quaternion turns; ``out`` is another array than ``v``."""
    w, x, y, z = a
    s0, s1, s2 = 2.0 * (y * v[2] - z * v[1]), 2.0 * (z * v[0] - x * v[2]), 2.0 * (x * v[1] - y * v[0])
    out[0] = v[0] + w * s0 + (y * s2 - z * s1)
    out[1] = v[1] + w * s1 + (z * s0 - x * s2)
    out[2] = v[2] + w * s2 + (x * s1 - y * s0)


@njit(cache=True)
def place(frame: Frame, q: Array, pose: Pose, axes: Array, origins: Array) -> None:
    """Fills in the frame's pose, and the axes, (m, 3), and the origins, (m, 3), of its joints in the world, at joint positions q, (n,)."""
    p, y, step, factor = pose.position, frame.turns[0].copy(), np.empty(3), np.empty(4)
    p[:] = frame.offsets[0]
    for k in range(len(frame.joints)):
        value = q[frame.joints[k]]
        turned(y, frame.axes[k], axes[k])
        origins[k] = p
        if frame.slides[k]:
            p += value * axes[k]
        else:
            factor[0], factor[1:] = np.cos(value / 2.0), np.sin(value / 2.0) * frame.axes[k]
            y = times(y, factor)
        turned(y, frame.offsets[k + 1], step)
        p += step
        y = times(y, frame.turns[k + 1])
    pose.turn[:] = y
