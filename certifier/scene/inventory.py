"""This module is the child's side of drafting: it says what models hold before anything in them is welded to the world."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np
from pydrake.math import RollPitchYaw
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.multibody.tree import BodyIndex, RigidBody
from pydrake.systems.framework import DiagramBuilder

from certifier.errors import SceneError
from certifier.model import Joint
from certifier.scene.copies import Copies
from certifier.scene.file import read_scene_file
from certifier.scene.formats.srdf import Srdf
from certifier.scene.mimics import Mimic, mimic_of
from certifier.scene.names import Names
from certifier.scene.parse import couplings, joint_of, read_models, without_limits
from certifier.scene.strict import StrictReader
from certifier.scene.xml import parse_xml


def inventory(payload: dict[str, Any]) -> dict[str, Any]:
    """Returns what the models of the scene file ``payload["path"]`` hold, JSON-able.

    ``roots`` lists the bodies that nothing holds, each with Drake's name of the ``body`` and its pose in the world as the file has it:
    ``translation`` in metres and ``rpy`` in degrees. ``joints`` lists those that move: ``name``, ``kind``, ``lower`` and ``upper``.
    ``links`` lists Drake's names of all bodies but the world, and ``leaves`` those that no joint leads on from.
    ``mimics`` lists the fields of each :class:`Mimic`. ``unread`` names the followers of which Drake does not read that they follow.
    ``state`` has the positions of that state of the SRDF file which names the most joints; none if the file is not accepted.

    Args:
        payload: ``path``; ``models``, the model files by the names of their models; ``srdf``, by the name of its model, if there is one.

    Raises:
        SceneError: whatever is wrong with the file or the models that it names.
    """
    path = Path(payload["path"])
    scene_file = read_scene_file(path)
    plant, scene_graph = AddMultibodyPlantSceneGraph(DiagramBuilder(), time_step=0.0)
    strict = StrictReader(scene_file)
    strict.check(scene_file.resolved_directives, path.name)
    with tempfile.TemporaryDirectory(dir=payload.get("scratch"), prefix="ciris-") as scratch:
        read_models(scene_file, plant, Copies(scene_file, strict, Path(scratch)))
    names = Names(plant, scene_graph.model_inspector())
    without_limits(strict, plant, names)
    free = plant.GetFloatingBaseBodies()
    every = [plant.get_joint(index) for index in plant.GetJointIndices()]
    joints = [joint_of(joint, names) for joint in every if joint.child_body().index() not in free]
    read = [mimic for mimic in map(mimic_of, couplings(plant, names)) if mimic is not None]
    unread = [mimic for name, file in payload["models"].items() for mimic in _unread(Path(file), name, joints)]
    return {
        "roots": _roots(plant),
        "links": [*map(_drake_name, _bodies(plant))],
        "leaves": [_drake_name(body) for body in _bodies(plant) if body.index() not in {joint.parent_body().index() for joint in every}],
        "joints": [{"name": j.name, "kind": j.kind.value, "lower": j.lower, "upper": j.upper} for j in joints if j.index is not None],
        "mimics": [vars(mimic) for mimic in (*read, *unread)],
        "unread": [mimic.follower for mimic in unread],
        "state": {name: value for model, file in payload["srdf"].items() for name, value in _largest_state(model, Path(file)).items()},
    }


def _largest_state(model: str, file: Path) -> dict[str, float]:
    try:
        states = [state.positions for state in Srdf(file, file.name).states]
    except SceneError:  # The draft is loaded with this file afterwards, which says what is wrong with it.
        return {}
    return {f"{model}/{joint}": value for joint, value in max(states, key=len, default={}).items()}


def _bodies(plant: MultibodyPlant) -> list[RigidBody]:
    return [plant.get_body(BodyIndex(i)) for i in range(1, plant.num_bodies())]


def _drake_name(body: RigidBody) -> str:
    name: str = body.scoped_name().get_full()
    return name


def _roots(plant: MultibodyPlant) -> list[dict[str, Any]]:
    context, found = plant.CreateDefaultContext(), []
    for index in sorted(plant.GetFloatingBaseBodies(), key=int):
        body = plant.get_body(index)
        X_WB = plant.EvalBodyPoseInWorld(context, body)
        rpy = np.degrees(RollPitchYaw(X_WB.rotation()).vector())
        found.append({"body": body.scoped_name().get_full(), "translation": X_WB.translation().tolist(), "rpy": rpy.tolist()})
    return found


def _unread(file: Path, model: str, joints: list[Joint]) -> list[Mimic]:
    """Returns what SDFormat's own <mimic> says, which Drake does not read."""
    if file.suffix.lower() != ".sdf":
        return []
    tree = ElementTree.TreeBuilder()

    def install(parser: expat.XMLParserType) -> None:
        parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = tree.start, tree.end, tree.data

    parse_xml(file.read_bytes(), file.name, "scene_model", install)
    own = [j.name for j in joints if j.name.startswith((f"{model}/", f"{model}::"))]
    full = {name.removeprefix(model).partition("/")[2]: name for name in own}
    found = []
    for joint in tree.close().iter("joint"):
        for mimic in joint.iterfind("axis/mimic"):
            follower, leader = full.get(joint.get("name", "")), full.get(mimic.get("joint", ""))
            if follower is not None and leader is not None:
                factor, offset, reference = (
                    float(mimic.findtext(key, default)) for key, default in (("multiplier", "1"), ("offset", "0"), ("reference", "0"))
                )
                found.append(Mimic(follower, leader, factor, offset - factor * reference))
    return found
