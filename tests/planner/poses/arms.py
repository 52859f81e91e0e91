"""Arms for the tests of poses, and Drake, which says where their frames are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.tree import JacobianWrtVariable

from certifier.kinematics import rotation
from certifier.model import Array, Joint, JointKind, Scene
from certifier.scene.drake_model import InDrake, build_diagram, drake_name
from certifier.scene.load import load_scene

EXAMPLES = Path(__file__).parents[3] / "examples"


@dataclass(frozen=True)
class Arm:
    """A scene with the full name of a frame of it."""

    scene: Scene
    frame: str

    @cached_property
    def _drake(self):
        diagram = build_diagram(self.scene)
        return diagram, diagram.plant(), diagram.plant().CreateDefaultContext()

    def pose(self, q: Array) -> RigidTransform:
        _, plant, context = self._drake
        plant.SetPositions(context, InDrake(self.scene, plant).at(q))
        return plant.EvalBodyPoseInWorld(context, plant.GetBodyByName(drake_name(self.frame)))

    def conditioned(self, q: Array) -> float:
        """The least singular value of the Jacobian of the frame's spatial velocity, by joints that move it."""
        _, plant, context = self._drake
        plant.SetPositions(context, q)
        body, world = plant.GetBodyByName(drake_name(self.frame)).body_frame(), plant.world_frame()
        J = plant.CalcJacobianSpatialVelocity(context, JacobianWrtVariable.kQDot, body, np.zeros(3), world, world)
        return float(np.linalg.svd(J, compute_uv=False).min())

    def random(self, rng: np.random.Generator, inner: float = 1.0) -> Array:
        """Joint positions in the inner part of the limits; an endless joint is within a turn and a half."""
        lower, upper = np.nan_to_num(self.scene.own_limits, posinf=3 * np.pi, neginf=-3 * np.pi)
        return (lower + upper) / 2 + inner * rng.uniform(-0.5, 0.5, self.scene.n) * (upper - lower)


def apart(X: RigidTransform, Y: RigidTransform) -> tuple[float, float]:
    """Metres and radians between two poses; the angle by the quaternion, since a cosine knows none below 1e-8."""
    turn = (X.rotation().inverse() @ Y.rotation()).ToQuaternion()
    return float(np.linalg.norm(X.translation() - Y.translation())), 2 * float(np.arctan2(np.linalg.norm(turn.xyz()), abs(turn.w())))


def given(X: RigidTransform) -> tuple[Array, Array]:
    """A pose as users give it."""
    return X.translation(), RollPitchYaw(X.rotation()).vector()


@cache
def arm(name: str) -> Arm:
    match name:
        case "gantry":
            return Arm(gantry(), "gantry/tool")
        case "fingers":
            return Arm(fingers(), "fingers/tip")
        case "endless":
            return Arm(endless(), "turner/tool")
        case _:
            frame = {"iiwa_shelf": "iiwa/link_7", "ur3e_bin": "arm/wrist_3", "dual_ur3e": "left/wrist_3", "planar_2dof": "arm/lower"}[name]
            return Arm(load_scene(EXAMPLES / name / "scene.yaml"), frame)


def placed(xyz: ArrayLike = (0, 0, 0), axis: ArrayLike = (1, 0, 0), angle: float = 0.0) -> Array:
    X = np.eye(4)
    X[:3, :3], X[:3, 3] = rotation(np.array(axis, dtype=float), angle), xyz
    return X


def chain_of(model: str, joints: list[tuple[JointKind, ArrayLike, tuple[float, float], Array]]) -> Scene:
    """An arm whose last body is its tool; its joints have a kind, an axis, limits and a place on the body before."""
    bodies = ["world", *(f"{model}/b{k}" for k in range(1, len(joints))), f"{model}/tool"]
    made = [
        Joint(f"{model}/j{k}", kind, bodies[k], bodies[k + 1], np.array(axis, dtype=float), X, placed((0.01 * k, 0, 0.02)), k, *limits)
        for k, (kind, axis, limits, X) in enumerate(joints)
    ]
    return Scene(model, tuple(made), tuple(bodies), (), (), (), np.zeros(len(joints)))


def gantry() -> Scene:
    """Slides along x and y, a turning column, a slanted slide behind it, and a wrist of three joints."""
    slide, turn = JointKind.PRISMATIC, JointKind.REVOLUTE
    return chain_of(
        "gantry",
        [
            (slide, (1, 0, 0), (-1.0, 1.0), placed((0, 0, 1))),
            (slide, (0, 1, 0), (-0.7, 0.7), placed((0, 0, 0.1))),
            (turn, (0, 0, 1), (-2.9, 2.9), placed((0.1, 0, -0.1))),
            (slide, (0.6, 0, -0.8), (0.0, 0.5), placed((0.2, 0, 0))),
            (turn, (0, 1, 0), (-1.9, 1.9), placed((0, 0.1, -0.2), (1, 0, 0), 0.3)),
            (turn, (1, 0, 0), (-2.9, 2.9), placed((0.05, 0, -0.1))),
            (turn, (0, 0, 1), (-2.9, 2.9), placed((0, 0.02, -0.1))),
        ],
    )


def fingers() -> Scene:
    """A hand that turns, with two fingers. One slides 2.5 times as far as the other one, and the other way; a tip turns at its end."""
    slide, turn, eye = JointKind.PRISMATIC, JointKind.REVOLUTE, np.eye(4)

    def joint(name: str, kind: JointKind, parent: str, child: str, axis: ArrayLike, index: int, follows: bool = False) -> Joint:
        X, ends = placed((0.3, 0.1, 0.05), (0, 1, 0), 0.4), (-0.3, 0.4) if kind is slide else (-2.0, 2.0)
        return Joint(f"fingers/{name}", kind, parent, f"fingers/{child}", np.array(axis), X, eye, index, *ends, follows=follows)

    joints = (
        joint("base", turn, "world", "base", (0.0, 0.6, 0.8), 0),
        joint("hand", turn, "fingers/base", "hand", (1.0, 0.0, 0.0), 1),
        joint("grip", slide, "fingers/hand", "one", (0.0, 1.0, 0.0), 2),
        joint("other", slide, "fingers/hand", "two", (0.0, -1.5, 2.0), 2, follows=True),
        joint("tip", turn, "fingers/two", "tip", (0.0, 1.0, 0.0), 3),
    )
    bodies = ("world", *(one.child for one in joints))
    return Scene("fingers", joints, bodies, (), (), (), np.zeros(4))


def endless() -> Scene:
    """Like a UR arm, with joints that turn without an end or by almost two turns."""
    turn = JointKind.REVOLUTE
    scene = chain_of(
        "turner",
        [
            (turn, (0, 0, 1), (-3.0, 3.0), placed((0, 0, 0.15))),
            (turn, (0, 1, 0), (-3.0, 3.0), placed((0, 0.1, 0))),
            (turn, (0, 1, 0), (-2.6, 2.6), placed((0, 0, 0.3))),
            (turn, (0, 1, 0), (-3.0, 3.0), placed((0, -0.05, 0.28))),
            (turn, (0, 0, 1), (-3.0, 3.0), placed((0, 0.08, 0))),
            (turn, (0, 1, 0), (-3.0, 3.0), placed((0, 0, 0.08))),
        ],
    )
    own: dict[int, tuple[float | None, float | None]] = {0: (None, None), 3: (-6.2, 6.2), 5: (None, None)}
    return replace(scene, joints=tuple(replace(joint, own_limits=own.get(k)) for k, joint in enumerate(scene.joints)))
