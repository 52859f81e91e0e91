"""Random kinematic trees built with Drake's own classes, for comparing kinematics."""

from __future__ import annotations

import numpy as np
from pydrake.common.eigen_geometry import AngleAxis
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, PrismaticJoint, RevoluteJoint, SpatialInertia, WeldJoint


def random_plant(rng: np.random.Generator, bodies: int) -> MultibodyPlant:
    """A tree with revolute, prismatic and weld joints between offset frames, offsets up to metres; welds have an X_FM of their own.

    Half of the joints are added from child to parent, so that Drake's tree and the joints' directions differ.
    """
    plant = MultibodyPlant(0.0)
    model = plant.AddModelInstance("tree")
    links = [plant.world_body()]
    for i in range(bodies):
        body = plant.AddRigidBody(f"body{i}", model, SpatialInertia.SolidSphereWithMass(1.0, 0.1))
        parent = links[rng.integers(max(0, len(links) - 3), len(links))]
        inner = plant.AddFrame(FixedOffsetFrame(f"inner{i}", parent.body_frame(), _pose(rng), model))
        outer = plant.AddFrame(FixedOffsetFrame(f"outer{i}", body.body_frame(), _pose(rng), model))
        F, M = (inner, outer) if rng.random() < 0.5 else (outer, inner)
        axis = rng.normal(size=3)
        kind = rng.integers(3)
        if kind == 0:
            plant.AddJoint(WeldJoint(f"joint{i}", F, M, _pose(rng)))
        elif kind == 1:
            plant.AddJoint(RevoluteJoint(f"joint{i}", F, M, axis, -2.0, 2.5))
        else:
            plant.AddJoint(PrismaticJoint(f"joint{i}", F, M, axis, -1.0, 0.5))
        links.append(body)
    plant.Finalize()
    return plant


def _pose(rng: np.random.Generator) -> RigidTransform:
    axis = rng.normal(size=3)
    return RigidTransform(RotationMatrix(AngleAxis(rng.uniform(-3, 3), axis / np.linalg.norm(axis))), rng.normal(size=3))
