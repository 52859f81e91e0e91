"""A Drake model is built here from a Scene's numbers alone. No user file is read, so nothing here can meet a broken one."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import Capsule, CollisionFilterDeclaration, Convex, GeometryId, GeometrySet, SceneGraphInspector, Shape, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, PrismaticJoint, RevoluteJoint, RigidBody, SpatialInertia, WeldJoint
from pydrake.planning import RobotDiagram, RobotDiagramBuilder

from certifier.errors import SceneError
from certifier.model import WORLD, Array, Geometry, Joint, JointKind, Scene

_INSTANCE = "scene"


def build_diagram(scene: Scene) -> RobotDiagram:
    """Returns the scene as a Drake diagram, with the same joint positions in the same order. Only ``scene.pairs`` can collide in it.

    Joints that follow others have positions of their own in it (:class:`InDrake`).

    The geometries are the scene's conv(vertices) + ball(radius), without padding. So a configuration is free when the signed distance of
    every pair is more than twice its padding. Drake's names of bodies, joints and geometries are :func:`drake_name`, and
    :func:`scene_name` and :func:`geometry_name` lead back.

    Raises:
        SceneError: ``unsupported_shape`` for more than two vertices with a radius; ``joint_order`` if Drake numbers the joints otherwise.
    """
    builder = RobotDiagramBuilder(time_step=0.0)
    plant, scene_graph = builder.plant(), builder.scene_graph()
    instance = plant.AddModelInstance(_INSTANCE)
    bodies = {WORLD: plant.world_body()}
    for name in scene.bodies:
        if name != WORLD:
            bodies[name] = plant.AddRigidBody(drake_name(name), instance, SpatialInertia.SolidSphereWithMass(1.0, 1.0))
    for joint in scene.joints:
        _add_joint(plant, joint, bodies)
    ids = {g.name: _add_geometry(plant, g, bodies) for g in scene.geometries}
    plant.Finalize()
    starts = [plant.GetJointByName(drake_name(joint.name)).position_start() for joint in scene.moving]
    for joint, start, before in zip(scene.moving, starts, [-1, *starts], strict=False):
        if start < before:
            message = f"joint {joint.name} is not number {joint.index} in a depth-first walk of the tree"
            raise SceneError("joint_order", message, hint="Drake numbers joints so; load the scene from its file again")
    only = CollisionFilterDeclaration().ExcludeWithin(GeometrySet(list(ids.values())))
    for pair in scene.pairs:
        only.AllowBetween(GeometrySet(ids[pair.a]), GeometrySet(ids[pair.b]))
    scene_graph.collision_filter_manager().Apply(only)
    return builder.Build()


class InDrake:
    """Gives the positions of the joints of :func:`build_diagram` at those of the scene.

    Args:
        plant: of the diagram.
    """

    def __init__(self, scene: Scene, plant: MultibodyPlant) -> None:
        every = {plant.GetJointByName(drake_name(joint.name)).position_start(): joint for joint in (*scene.moving, *scene.following)}
        joints = [every[i] for i in range(plant.num_positions())]
        self._index = np.array([joint.index for joint in joints], dtype=np.int64)
        # Drake's axes are unit vectors, so a joint that slides faster than the one that it follows is farther along its own.
        self._speeds = np.array([joint.speed or 1.0 for joint in joints])

    def at(self, q: Array) -> Array:
        """Returns Drake's positions, (N,), at q, (n,)."""
        found: Array = np.asarray(q)[self._index] * self._speeds
        return found


def check_independent(scene: Scene) -> None:
    """Refuses a scene for methods of Drake's in which all joints are independent.

    Raises:
        SceneError: ``unsupported_joint``.
    """
    if scene.following:
        message = f"joint {scene.following[0].name} follows another one, and Drake's methods for regions have independent joints only"
        raise SceneError("unsupported_joint", message, hint="choose another method, or hold or sweep the joints by fix")


def drake_name(name: str) -> str:
    """Returns the name that Drake gets for one of a scene. Drake accepts no ``::`` in it, and a scene's names have no ``|``."""
    return name.replace(":", "|")


def scene_name(drake_name: str) -> str:
    """Returns the scene's name for one that :func:`drake_name` has made."""
    return drake_name.replace("|", ":")


def geometry_name(inspector: SceneGraphInspector, geometry_id: GeometryId) -> str:
    """Returns the scene's name of a geometry of :func:`build_diagram`."""
    return scene_name(inspector.GetName(geometry_id).removeprefix(f"{_INSTANCE}::"))


def _add_joint(plant: MultibodyPlant, joint: Joint, bodies: dict[str, RigidBody]) -> None:
    name, parent, child = drake_name(joint.name), bodies[joint.parent], bodies[joint.child]
    X_PF, X_BM = _transform(joint.X_PF), _transform(joint.X_BM)
    if joint.kind is JointKind.WELD:
        plant.AddJoint(WeldJoint(name, parent.body_frame(), child.body_frame(), X_PF @ X_BM.inverse()))
        return
    F = plant.AddFrame(FixedOffsetFrame(f"{name}/F", parent.body_frame(), X_PF, child.model_instance()))
    M = plant.AddFrame(FixedOffsetFrame(f"{name}/M", child.body_frame(), X_BM, child.model_instance()))
    if joint.kind is JointKind.REVOLUTE:
        plant.AddJoint(RevoluteJoint(name, F, M, joint.axis, joint.lower, joint.upper))
        return
    limits = np.array([joint.lower, joint.upper], dtype=float) * joint.speed
    plant.AddJoint(PrismaticJoint(name, F, M, joint.axis, *limits))


def _add_geometry(plant: MultibodyPlant, geometry: Geometry, bodies: dict[str, RigidBody]) -> GeometryId:
    X_BG, shape = _shape(geometry)
    return plant.RegisterCollisionGeometry(bodies[geometry.body], X_BG, shape, drake_name(geometry.name), CoulombFriction())


def _shape(geometry: Geometry) -> tuple[RigidTransform, Shape]:
    vertices, radius = geometry.vertices, geometry.radius
    if radius == 0:
        return RigidTransform(), Convex(vertices.T, drake_name(geometry.name))
    if len(vertices) == 1:
        return RigidTransform(vertices[0]), Sphere(radius)
    if len(vertices) == 2:
        along = vertices[1] - vertices[0]
        length = float(np.linalg.norm(along))
        return RigidTransform(RotationMatrix.MakeFromOneVector(along / length, 2), vertices.mean(axis=0)), Capsule(radius, length)
    message = f"geometry {geometry.name} has a radius and {len(vertices)} vertices; Drake can round at most two"
    raise SceneError("unsupported_shape", message)


def _transform(X: Array) -> RigidTransform:
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(X[:3, :3]), X[:3, 3])
