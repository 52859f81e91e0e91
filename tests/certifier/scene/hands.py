"""Hands of two fingers of which one follows the other, and where Drake has their bodies, from the models as they are."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np

from certifier.kinematics import Kinematics
from certifier.model import WORLD, Pair, Scene
from certifier.scene.names import Names
from certifier.verify.kinematics import ExactKinematics, exact
from tests.certifier.scene.test_sweep import finger, mimic
from tests.certifier.scene.workshop import parsed, write
from tests.oracles.original import original_diagram

IGNORED = "ignore: [{pair: [arm/grip_link, arm/other_link], reason: they meet where they grasp}]\n"


def jaws(kind: str, factor: float, offset: float, limits: tuple[float, float] = (-0.3, 0.4), own: tuple[float, float] = (-2, 2)) -> str:
    """Two fingers on the hand, of which the second one follows the first one; both are turned against it."""
    other = finger("other", "hand", kind, "0.6 0.8 0", own, "box", mimic("grip", factor, offset), "0.2 0.1 0.3")
    return finger("grip", "hand", kind, "0 -0.6 0.8", limits, "box") + other


class Original:
    """What Drake makes of a scene file. A joint is where its name says, and the others at 0."""

    def __init__(self, path: Path, follows: dict[str, tuple[str, float, float]]) -> None:
        self._diagram, self._follows = original_diagram(path), follows
        self._context = self._diagram.CreateDefaultContext()
        self._inspector = self._diagram.scene_graph().model_inspector()

    def place(self, scene: Scene, q: np.ndarray) -> None:
        plant, at = self._diagram.plant(), {joint.name: float(x) for joint, x in zip(scene.moving, q, strict=True)}
        at |= {name: factor * at[leader] + offset for name, (leader, factor, offset) in self._follows.items()}
        positions = np.zeros(plant.num_positions())
        for name, value in at.items():
            model, joint = name.split("/")
            positions[plant.GetJointByName(joint, plant.GetModelInstanceByName(model)).position_start()] = value
        plant.SetPositions(self._diagram.mutable_plant_context(self._context), positions)

    def pose(self, name: str) -> np.ndarray:
        plant = self._diagram.plant()
        if name == WORLD:
            return np.eye(4)
        model, body = name.split("/")
        return plant.EvalBodyPoseInWorld(
            self._diagram.plant_context(self._context), plant.GetBodyByName(body, plant.GetModelInstanceByName(model))
        ).GetAsMatrix4()

    def touching(self, scene: Scene) -> set[Pair]:
        query = self._diagram.scene_graph().get_query_output_port().Eval(self._diagram.scene_graph_context(self._context))
        names = Names(self._diagram.plant(), self._inspector)
        found = {Pair(*sorted((names.geometry(p.id_A), names.geometry(p.id_B)))) for p in query.ComputePointPairPenetration()}
        return found & set(scene.pairs)


def exact_pose(scene: Scene, q: np.ndarray, frame: str, body: str) -> np.ndarray:
    """By the verifier's kinematics."""
    X = ExactKinematics.at(scene, [exact(x) for x in scene.to_s(q)]).pose(frame, body)
    return np.array([[float(Fraction(int((x / X[3][3]).p), int((x / X[3][3]).q))) for x in row] for row in X])


def our_pose(scene: Scene, q: np.ndarray, frame: str, body: str) -> np.ndarray:
    X = Kinematics.of(scene).numerators(frame, body, scene.to_s(q)[None])[0]
    return X / X[3, 3]


def gripper(tmp_path: Path, at: float, factor: float = 1.0) -> tuple[Path, Scene]:
    """A hand that turns, with fingers that open to both sides, and a post beside the second finger, which follows.

    It moves ``factor`` times as far. The fingers overlap where grip is less than -0.02 / (1 + |factor|).
    """
    first, last = sorted((-0.02 * factor, 0.1 * factor))
    pad = '<link name="{0}"><collision name="pad"><geometry><box size="0.02 0.02 0.1"/></geometry></collision></link>'
    joint = """<joint name="{0}" type="prismatic"><parent link="hand"/><child link="{0}_link"/><origin xyz="0 {1} 0.15"/>
      <axis xyz="0 {2} 0"/><limit lower="{3}" upper="{4}" effort="1" velocity="1"/>{5}</joint>"""
    fingers = pad.format("grip_link") + pad.format("other_link")
    fingers += joint.format("grip", 0.02, 1, -0.02, 0.1, "")
    fingers += joint.format("other", -0.02, -np.sign(factor), first, last, mimic("grip", factor))
    arm = f"""<robot name="arm"><link name="base"/><joint name="turn" type="revolute"><parent link="base"/><child link="hand"/>
      <axis xyz="0 0 1"/><limit lower="-0.5" upper="0.5" effort="1" velocity="1"/></joint>
      <link name="hand"><collision name="palm"><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>{fingers}</robot>"""
    room = f"""<sdf version="1.7"><model name="room"><link name="walls"><collision name="post"><pose>0 {at} 0.15 0 0 0</pose>
      <geometry><box><size>0.02 0.02 0.1</size></box></geometry></collision></link></model></sdf>"""
    path = write(tmp_path, arm=arm, files={"room.sdf": room}, extra="ignore: [{pair: [arm/hand, room/walls], reason: r}]\n")
    return path, parsed(path)
