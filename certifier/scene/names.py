"""Every body, joint and geometry that Drake has read gets its name here. No two of them get the same.

A scene's pairs, its proofs and what a scene file ignores go by these names. A name has slashes between its parts, and the parts may have
slashes, too. So two things could get the same name, which would then stand for both.
"""

from __future__ import annotations

from pydrake.geometry import GeometryId, Role, SceneGraphInspector
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, Joint, JointIndex, RigidBody

from certifier.errors import SceneError
from certifier.model import WORLD
from certifier.names import ALPHABET, MAX_NAME, is_name


class Register:
    """Gives each name once.

    Raises:
        SceneError: ``scene_name``, when statements may not print a name, or something else has it.
    """

    def __init__(self) -> None:
        self._owners: dict[str, str] = {}

    def give(self, name: str, what: str, owner: str) -> str:
        """Returns the name, which from now on belongs to one thing.

        Args:
            what: kind of thing, for people.
            owner: says which thing it is, for people.
        """
        if not is_name(name):
            message = f"the {what} {name[:MAX_NAME]!a} has a name that is not accepted"
            raise SceneError("scene_name", message, field="directives", hint=f"names have {ALPHABET}")
        if name in self._owners:
            message = f"{self._owners[name]} and {owner} would both be called {name}"
            hint = "rename one of them in its model; names are made of the model's, the body's and the geometry's, with / between them"
            raise SceneError("scene_name", message, field="directives", hint=hint)
        self._owners[name] = owner
        return name

    def unused(self, name: str) -> str:
        """Returns the name, with a number behind it where something else has it."""
        found, number = name, 1
        while found in self._owners:
            number += 1
            found = f"{name}{number}"
        return found


class Names:
    """Holds the names of all bodies, joints and geometries of the proximity role of a plant.

    Bodies and geometries share a register, because a scene file ignores either by its name. Joints have one of their own.

    Attributes:
        register: the names of bodies and geometries.
        bodies: the bodies' names, in the order of their indices.

    Raises:
        SceneError: ``scene_name``, as :meth:`Register.give`.
    """

    def __init__(self, plant: MultibodyPlant, inspector: SceneGraphInspector) -> None:
        self.register = Register()
        self.bodies = tuple(self._of_body(plant, plant.get_body(BodyIndex(i))) for i in range(plant.num_bodies()))
        joints = Register()
        self._joints = {index: _of_joint(joints, plant, plant.get_joint(index)) for index in plant.GetJointIndices()}
        proximity = inspector.GetAllGeometryIds(Role.kProximity)
        self._geometries = {i: self._of_geometry(plant, inspector, i) for i in proximity}

    def body(self, body: RigidBody) -> str:
        return self.bodies[int(body.index())]

    def joint(self, joint: Joint) -> str:
        index: JointIndex = joint.index()
        return self._joints[index]

    def geometry(self, geometry: GeometryId) -> str:
        return self._geometries[geometry]

    def _of_body(self, plant: MultibodyPlant, body: RigidBody) -> str:
        if body.index() == plant.world_body().index():
            return self.register.give(WORLD, "body", "the world")
        model = plant.GetModelInstanceName(body.model_instance())
        return self.register.give(f"{model}/{body.name()}", "body", f"body {body.name()!a} of model {model!a}")

    def _of_geometry(self, plant: MultibodyPlant, inspector: SceneGraphInspector, geometry: GeometryId) -> str:
        """Returns a name that begins with the body's. Drake's prefix, the name of the model, is dropped."""
        body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        model = plant.GetModelInstanceName(body.model_instance())
        own = inspector.GetName(geometry).removeprefix(f"{model}::")
        owner = f"geometry {own!a} of body {body.name()!a} of model {model!a}"
        return self.register.give(f"{self.body(body)}/{own}", "geometry", owner)


def _of_joint(register: Register, plant: MultibodyPlant, joint: Joint) -> str:
    model = plant.GetModelInstanceName(joint.model_instance())
    return register.give(f"{model}/{joint.name()}", "joint", f"joint {joint.name()!a} of model {model!a}")
