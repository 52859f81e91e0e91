"""Joints that are swept: at all their positions, by Drake's kinematics, the bodies behind them are in those that stand for them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from scipy.spatial import ConvexHull

from certifier.errors import SceneError
from certifier.kinematics import Kinematics
from certifier.model import Geometry, Scene
from certifier.pair.collisions import in_collision
from certifier.scene.hull import nearest_in_hull
from tests.certifier.scene.workshop import SCENE, parsed, write

LIMITS = '<limit lower="{}" upper="{}" effort="1" velocity="1"/>'
SHAPES = {
    "box": '<box size="0.02 0.03 0.1"/>',
    "cylinder": '<cylinder radius="0.02" length="0.08"/>',
    "ball": '<sphere radius="0.03"/>',
    "capsule": '<capsule radius="0.02" length="0.06"/>',
}


def finger(
    name: str, on: str, kind: str, axis: str, limits: tuple[float, float], shape: str, mimic: str = "", xyz: str = "0.3 0 0.3"
) -> str:
    return f"""<joint name="{name}" type="{kind}"><parent link="{on}"/><child link="{name}_link"/>
      <origin xyz="{xyz}" rpy="0.3 0.2 0.1"/><axis xyz="{axis}"/>{LIMITS.format(*limits)}{mimic}</joint>
      <link name="{name}_link"><collision name="pad"><origin xyz="0.05 0.01 0.02" rpy="0.2 0 0.4"/>
      <geometry>{SHAPES[shape]}</geometry></collision></link>"""


def mimic(joint: str, multiplier: float, offset: float = 0.0) -> str:
    return f'<mimic joint="{joint}" multiplier="{multiplier}" offset="{offset}"/>'


def slides(shape: str) -> str:
    other = finger("other", "hand", "prismatic", "0 -1 0", (-0.01, 0.09), shape, mimic("grip", 1.5, 0.004))
    return finger("grip", "hand", "prismatic", "0 1 0", (0.0, 0.05), shape) + other


def knuckles(shape: str) -> str:
    """As on a Robotiq 2F-85: a tip turns back by as much as its knuckle turns; the other finger mirrors the first one."""
    tips = [("left_tip", "grip_link", -1.0), ("right_tip", "right_link", 1.0)]
    return (
        finger("grip", "hand", "revolute", "0 0.6 0.8", (0.0, 0.8), shape)
        + finger("right", "hand", "revolute", "0 0.6 0.8", (-0.9, 0.9), shape, mimic("grip", -1.0))
        + "".join(finger(name, on, "revolute", "0 0.6 0.8", (-0.9, 0.9), shape, mimic("grip", m), "0.06 0 0") for name, on, m in tips)
    )


def mixed(shape: str) -> str:
    """A turn behind a slide that is a joint of its own, on a link behind a weld; half a turn and more."""
    return finger("lift", "hand", "prismatic", "1 0 0", (-0.05, 0.1), shape) + finger(
        "grip", "lift_link", "revolute", "1 0 0", (-2.5, 1.5), shape
    )


HANDS = {
    "slides": (slides, "fix: {grip: swept}\n", {"grip": (0.0, 0.05)}, {"other": ("grip", 1.5, 0.004)}),
    "narrower": (slides, "fix: {grip: swept}\nlimits: {grip: [0.01, 0.02]}\n", {"grip": (0.01, 0.02)}, {"other": ("grip", 1.5, 0.004)}),
    "knuckles": (
        knuckles,
        "fix: {arm/grip: swept}\n",
        {"grip": (0.0, 0.8)},
        {"right": ("grip", -1.0, 0.0), "left_tip": ("grip", -1.0, 0.0), "right_tip": ("grip", 1.0, 0.0)},
    ),
    "mixed": (mixed, "fix: {lift: swept, grip: swept}\n", {"lift": (-0.05, 0.1), "grip": (-2.5, 1.5)}, {}),
    "half": (mixed, "fix: {lift: 0.03, grip: swept}\n", {"lift": (0.03, 0.03), "grip": (-2.5, 1.5)}, {}),
}


class Hand:
    """The arm with a hand by Drake alone, whose joints all move, and positions of the hand."""

    def __init__(self, file: Path, ranges, follows) -> None:
        self.plant = MultibodyPlant(0.0)
        (self._model,) = Parser(self.plant).AddModels(str(file))
        self.plant.WeldFrames(self.plant.world_frame(), self.plant.GetFrameByName("base"))
        self.plant.Finalize()
        self._context, self._ranges, self._follows = self.plant.CreateDefaultContext(), ranges, follows

    def positions(self, rng: np.random.Generator) -> dict[str, float]:
        """Random ones; one in four is at an end of the range."""
        at = {}
        for name, (lower, upper) in self._ranges.items():
            at[name] = float(rng.choice([lower, upper])) if rng.random() < 0.25 else rng.uniform(lower, upper)
        return at | {name: factor * at[leader] + offset for name, (leader, factor, offset) in self._follows.items()}

    def pose(self, body: str, positions: dict[str, float], turn: float = 0.0) -> np.ndarray:
        for name, value in {"turn": turn, **positions}.items():
            joint = self.plant.GetJointByName(name, self._model)
            (joint.set_angle if joint.type_name() == "revolute" else joint.set_translation)(self._context, value)
        return self.plant.EvalBodyPoseInWorld(self._context, self.plant.GetBodyByName(body, self._model)).GetAsMatrix4()


def within(points: np.ndarray, geometry: Geometry, radius: float) -> bool:
    """Whether balls of this radius about the points are in the geometry: by its faces, or by its support in many directions."""
    directions = np.random.default_rng(1).normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    supports = (geometry.vertices @ directions.T).max(axis=0) + geometry.radius
    if geometry.radius == 0:
        hull = ConvexHull(geometry.vertices)
        directions, supports = hull.equations[:, :3], -hull.equations[:, 3]
    return bool(((points @ directions.T).max(axis=0) + radius <= supports).all())


def ranges_of(hand: str) -> list[str]:
    """The joints of a hand."""
    return [*HANDS[hand][2], *HANDS[hand][3]]


def both(tmp_path: Path, hand: str, shape: str) -> tuple[Scene, Scene, Hand]:
    """The scene with joints swept, the one with all of them held somewhere, and Drake's."""
    more, fix, ranges, follows = HANDS[hand]
    (tmp_path / "held").mkdir()
    held = {name: (lower + upper) / 2 for name, (lower, upper) in ranges.items()}
    still = parsed(write(tmp_path / "held", more=more(shape), extra=f"fix: {held}\n"))
    return parsed(write(tmp_path, more=more(shape), extra=fix)), still, Hand(tmp_path / "arm.urdf", ranges, follows)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("hand", HANDS)
def test_every_body_is_within_what_stands_for_it_at_all_positions(tmp_path, hand, shape):
    scene, still, drake = both(tmp_path, hand, shape)
    kinematics, rng = Kinematics.of(scene), np.random.default_rng(0)
    behind = [g for g in still.geometries if "all positions" in (scene.geometry(g.name).substitution or "")]
    assert len(behind) == (1 if hand == "half" else len(ranges_of(hand)))
    assert scene.n == 1
    assert [g.name for g in scene.geometries] == [g.name for g in still.geometries]
    for geometry in behind:
        own = scene.geometry(geometry.name)
        X = kinematics.numerators("arm/hand", own.body, np.zeros((1, 1)))[0]
        for _ in range(25):
            at = drake.positions(rng)
            pose = np.linalg.inv(drake.pose("hand", at)) @ drake.pose(own.body.removeprefix("arm/"), at)
            points = geometry.vertices @ pose[:3, :3].T + pose[:3, 3]
            assert within((points - X[:3, 3]) @ X[:3, :3], own, geometry.radius), (geometry.name, at)
        assert len(own.vertices) <= 32


@pytest.mark.parametrize("hand", HANDS)
def test_the_inflation_bounds_how_far_it_reaches_beyond_all_positions(tmp_path, hand):
    """Of the vertices from the hull of the places at very many positions; and it is small where nothing has to be left out."""
    scene, still, drake = both(tmp_path, hand, "box")
    kinematics, rng = Kinematics.of(scene), np.random.default_rng(0)
    for geometry in still.geometries:
        own = scene.geometry(geometry.name)
        if not np.array_equal(own.vertices, geometry.vertices):
            X = kinematics.numerators("arm/hand", own.body, np.zeros((1, 1)))[0]
            places = []
            for at in [drake.positions(rng) for _ in range(300)]:
                pose = np.linalg.inv(drake.pose("hand", at)) @ drake.pose(own.body.removeprefix("arm/"), at)
                places.append(((geometry.vertices @ pose[:3, :3].T + pose[:3, 3]) - X[:3, 3]) @ X[:3, :3])
            farthest = max(nearest_in_hull(vertex, np.concatenate(places))[1] for vertex in own.vertices)
            assert farthest <= own.inflation + 1e-3, "places at random positions leave a little out"
            assert own.inflation < (1e-8 if "slide" in hand or hand == "narrower" else 0.03)
            assert own.substitution.startswith("box -> hull of ")


def test_a_ball_on_a_slide_becomes_a_capsule(tmp_path):
    scene, *_ = both(tmp_path, "slides", "ball")
    pad = scene.geometry("arm/grip_link/pad")
    assert len(pad.vertices) == 2
    assert pad.radius == pytest.approx(0.03, abs=1e-8)
    assert np.linalg.norm(pad.vertices[1] - pad.vertices[0]) == pytest.approx(0.05, abs=1e-8)
    assert 0 < pad.inflation < 1e-8


@pytest.mark.parametrize("hand", ["slides", "knuckles"])
def test_what_is_free_is_free_with_every_opening(tmp_path, hand):
    """The arm turns towards the wall; Drake measures the hand's bodies at random openings, each by itself."""
    scene, still, drake = both(tmp_path, hand, "box")
    wall = scene.geometry("room/walls/wall")
    lower = wall.vertices.min(axis=0)
    rng, free, closer = np.random.default_rng(3), 0, 0
    for turn in rng.uniform(scene.q_lower[0], scene.q_upper[0], 60):
        collides = in_collision(scene, scene.to_s(np.array([[turn]])))[0]
        reach = -np.inf
        for at in [drake.positions(rng) for _ in range(20)]:
            for geometry in still.geometries:
                if geometry.name.endswith("pad"):
                    pose = drake.pose(geometry.body.removeprefix("arm/"), at, turn)
                    reach = max(reach, (geometry.vertices @ pose[:3, :3].T + pose[:3, 3])[:, 0].max())
        free, closer = free + (not collides), closer + (collides and reach < lower[0])
        if not collides:
            assert reach < lower[0]
    assert free > 10


def test_a_joint_that_the_tree_turns_round_is_swept_the_same(tmp_path):
    """A table stands on its tray, so its leg hangs on the slide that the model has above the tray."""
    table = """<robot name="table"><link name="leg"><collision name="post"><geometry><box size="0.1 0.1 0.4"/></geometry></collision></link>
      <joint name="turn" type="revolute"><parent link="leg"/><child link="tray"/><origin xyz="0.1 0.2 0.3" rpy="0.3 0 0"/>
      <axis xyz="0 0 1"/><limit lower="-0.2" upper="0.7" effort="1" velocity="1"/></joint><link name="tray"/></robot>"""
    scene_file = SCENE + "  - add_model: {name: table, file: table.urdf}\n  - add_weld: {parent: world, child: table::tray}\n"
    path = write(tmp_path, scene_file, extra="fix: {table/turn: swept}\n", files={"table.urdf": table})
    scene = parsed(path)
    post = scene.geometry("table/leg/post")
    X = Kinematics.of(scene).numerators("world", "table/leg", np.zeros((1, scene.n)))[0]
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModels(str(tmp_path / "table.urdf"))
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("tray"))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    corners = np.array([[x, y, z] for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (-0.2, 0.2)])
    for angle in np.linspace(-0.2, 0.7, 50):
        plant.GetJointByName("turn").set_angle(context, angle)
        pose = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName("leg")).GetAsMatrix4()
        assert within((corners @ pose[:3, :3].T + pose[:3, 3] - X[:3, 3]) @ X[:3, :3], post, 0.0)


def test_the_scene_says_what_is_swept(tmp_path):
    scene, still, _ = both(tmp_path, "knuckles", "box")
    (said,) = [w for w in scene.warnings if "is swept" in w]
    followers = "arm/right, arm/left_tip, arm/right_tip"
    assert said.startswith(f"joint arm/grip is swept from 0 to 0.8 rad, and with it {followers}: what hangs on it counts at all positions")
    assert not [w for w in still.warnings if "is swept" in w]
    assert {(p.a, p.b) for p in scene.pairs} == {(p.a, p.b) for p in still.pairs}
    assert scene.hash != still.hash


LAST = f'<joint name="last" type="prismatic"><parent link="disc"/><child link="flange"/>{LIMITS.format(0, 1)}</joint><link name="flange"/>'
SPIN = '<joint name="spin" type="continuous"><parent link="hand"/><child link="disc"/><axis xyz="0 0 1"/></joint><link name="disc"/>'
TURN = SPIN.replace("continuous", "revolute").replace("</joint>", LIMITS.format(-1, 1) + "</joint>")


@pytest.mark.parametrize(
    ("more", "extra", "code", "field", "words"),
    [
        (slides("box"), "fix: {grip: swpet}\n", "scene_field", "fix.grip", "the word swept"),
        (slides("box"), "fix: {grip: swept, other: swept}\n", "scene_field", "fix", "both are swept"),
        (slides("box"), "fix: {grip: swept, other: 0.01}\n", "scene_field", "fix.arm/other", "cannot be held"),
        (slides("box"), "fix: {other: swept}\n", "scene_field", "fix.arm/other", "give arm/other narrower limits"),
        (slides("box"), "fix: {grip: swept}\nlimits: {grip: [0, 1]}\n", "scene_field", "limits.arm/grip", "own limits"),
        (slides("box"), "fix: {gripp: swept}\n", "unknown_name", "fix.gripp", "arm/grip"),
        (SPIN, "fix: {spin: swept}\n", "joint_range", "fix.arm/spin", "no finite limits"),
        (
            SPIN.replace("continuous", "revolute").replace("</joint>", LIMITS.format(-1, 1) + "</joint>") + LAST,
            "fix: {spin: swept}\n",
            "unsupported_joint",
            "fix.arm/spin",
            "arm/last moves",
        ),
        (mixed("box"), "fix: {lift: swept}\n", "unsupported_joint", "fix.arm/lift", "arm/grip moves"),
        (slides("box"), "fix: {turn: swept, grip: swept}\n", "no_joints", "directives", "no joint of the scene can move"),
    ],
)
def test_what_cannot_be_swept_is_refused(tmp_path, more, extra, code, field, words):
    with pytest.raises(SceneError) as refusal:
        parsed(write(tmp_path, more=more, extra=extra))
    assert (refusal.value.code, refusal.value.field) == (code, field)
    assert words in str(refusal.value)


def test_limits_concern_the_joint_that_is_swept(tmp_path):
    """The other joint of that name keeps its own; a joint that is not swept keeps what the file says of it."""
    scene = parsed(write(tmp_path, more=slides("box"), extra="fix: {grip: swept}\nlimits: {arm/grip: [0, 0.01], turn: [0, 1]}\n"))
    assert scene.q_upper.tolist() == [1.0]
    assert any("from 0 to 0.01 m" in w for w in scene.warnings)


def test_a_half_space_cannot_be_swept(tmp_path):
    lid = """<sdf version="1.9"><model name="lid"><link name="frame"/><link name="floor"><collision name="plane"><geometry><plane>
      <normal>0 0 1</normal></plane></geometry></collision></link>
      <joint name="hinge" type="revolute"><parent>frame</parent><child>floor</child>
      <axis><xyz>1 0 0</xyz><limit><lower>0</lower><upper>0.1</upper></limit></axis></joint></model></sdf>"""
    scene_file = SCENE + "  - add_model: {name: lid, file: lid.sdf}\n  - add_weld: {parent: world, child: lid::frame}\n"
    with pytest.raises(SceneError, match="half-space behind a joint that is swept"):
        parsed(write(tmp_path, scene_file, extra="fix: {hinge: swept}\n", files={"lid.sdf": lid}))


def test_states_of_a_group_that_is_swept_count_for_the_other_joints(tmp_path):
    states = """<robot name="arm"><group_state name="open" group="hand"><joint name="grip" value="0.04"/></group_state>
      <group_state name="home" group="all"><joint name="turn" value="0.5"/><joint name="grip" value="0.01"/></group_state></robot>"""
    extra = "fix: {grip: swept}\nsrdf: {arm: arm.srdf}\n"
    scene = parsed(write(tmp_path, more=slides("box"), extra=extra, files={"arm.srdf": states}))
    assert scene.configurations == {"arm/all/home": {"arm/turn": 0.5}}
    assert [w for w in scene.warnings if "left out" in w] == [
        "arm.srdf:1: the state arm/hand/open is left out: it names no joint that can move"
    ]
