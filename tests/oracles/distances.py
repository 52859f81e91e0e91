"""Distances by Drake alone, in a plant that its parser makes of a scene's files, with the shapes and meshes that stand there."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import yaml
from pydrake.geometry import GeometryId, SceneGraphInspector

from certifier.model import Array
from tests.oracles.original import original_diagram


class Distances:
    """Tells how far apart the bodies of a scene file are, padding subtracted; Drake's own filters say which pairs do not count.

    Attributes:
        n: number of joint positions.
        limits: lower and upper limits, (n,) each; half a turn to either side of 0, less a little, for joints without.
    """

    def __init__(self, path: Path) -> None:
        line = re.search(r"^padding: (.*)$", path.read_text(), re.MULTILINE)
        said = yaml.safe_load(line[1]) if line else 0.0
        self._padding, self._own = (said["default"], said["bodies"]) if isinstance(said, dict) else (said, {})
        self._diagram = original_diagram(path)
        self._context = self._diagram.CreateDefaultContext()
        plant = self._diagram.plant()
        self.n = plant.num_positions()
        lower, upper = plant.GetPositionLowerLimits(), plant.GetPositionUpperLimits()
        self.limits = np.where(np.isfinite(lower), lower, -2.9), np.where(np.isfinite(upper), upper, 2.9)

    def order(self, names: Sequence[str]) -> Array:
        """Returns for each of Drake's positions the place of its joint among ``model/joint`` names."""
        plant = self._diagram.plant()
        joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
        moving = sorted((joint for joint in joints if joint.num_positions() == 1), key=lambda joint: joint.position_start())
        return np.array([names.index(f"{plant.GetModelInstanceName(joint.model_instance())}/{joint.name()}") for joint in moving])

    def least(self, q: Array, within: float) -> float:
        """Returns the least distance of two padded bodies at positions q, (n,), in metres; inf if none is less than ``within``."""
        plant, graph = self._diagram.plant(), self._diagram.scene_graph()
        plant.SetPositions(self._diagram.mutable_plant_context(self._context), q)
        query = graph.get_query_output_port().Eval(self._diagram.mutable_scene_graph_context(self._context))
        found = query.ComputeSignedDistancePairwiseClosestPoints(within + 2 * max(self._padding, *self._own.values(), 0.0))
        least = min((pair.distance - 2 * self._of_bodies(query.inspector(), pair.id_A, pair.id_B) for pair in found), default=np.inf)
        return least if least < within else np.inf

    def _of_bodies(self, inspector: SceneGraphInspector, *geometries: GeometryId) -> float:
        """Returns the padding of two geometries: the larger one that the file gives for their bodies, or the usual one."""
        plant = self._diagram.plant()
        bodies = [plant.GetBodyFromFrameId(inspector.GetFrameId(geometry)) for geometry in geometries]
        names = [f"{plant.GetModelInstanceName(body.model_instance())}/{body.name()}" for body in bodies]
        return max((self._own[name] for name in names if name in self._own), default=self._padding)
