"""Joints that turn a whole turn and more, joints that are held or coupled, and limits of the scene file's own."""

import re

import numpy as np
import pytest
import yaml
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from certifier.errors import RegionError, SceneError
from certifier.kinematics import Kinematics
from certifier.model import JointKind, Scene
from certifier.scene.file import KEYS
from certifier.seeding.limits import check_limits
from certifier.verify.scene import check_scene
from planner.membership import to_s
from tests.certifier.scene.workshop import EXAMPLES, LIMIT, ROOM, parsed, write

WIDE = LIMIT.replace('"-1"', f'"{-2 * np.pi!r}"').replace('"2"', f'"{2 * np.pi!r}"')
FINGERS = """<link name="left"><collision><geometry><box size="0.02 0.02 0.1"/></geometry></collision></link>
  <joint name="grip" type="prismatic"><parent link="hand"/><child link="left"/><origin xyz="0.3 0 0.3" rpy="0.3 0.2 0.1"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.05" effort="1" velocity="1"/></joint>
  <link name="right"><collision><geometry><box size="0.02 0.02 0.1"/></geometry></collision></link>
  <joint name="other" type="prismatic"><parent link="hand"/><child link="right"/><origin xyz="0.3 0 0.3"/>
    <axis xyz="0 -1 0"/><limit lower="-0.01" upper="0.09" effort="1" velocity="1"/>
    <mimic joint="grip" multiplier="1.5" offset="0.004"/></joint>"""


def model_pose(directory, q, body):
    """Where Drake puts a body of the arm at joint positions by name, with the base as the scene welds it."""
    plant = MultibodyPlant(0.0)
    (model,) = Parser(plant).AddModels(str(directory / "arm.urdf"))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    for name, value in q.items():
        joint = plant.GetJointByName(name, model)
        (joint.set_angle if joint.type_name() == "revolute" else joint.set_translation)(context, value)
    base = plant.GetBodyByName("base", model)
    return plant.GetBodyByName(body, model).body_frame().CalcPose(context, base.body_frame()).GetAsMatrix4()


def within(angle: str) -> str:
    return f'<limit lower="-{angle}" upper="{angle}" effort="1" velocity="1"/>'


@pytest.mark.parametrize(
    ("change", "extra", "own", "window"),
    [
        ({"limit": WIDE}, "", (-2 * np.pi, 2 * np.pi), (-170, 170)),
        ({"limit": WIDE}, "q_star: [1]\n", (-2 * np.pi, 2 * np.pi), (1 - np.radians(170), 1 + np.radians(170))),
        ({"kind": "continuous", "limit": ""}, "", (None, None), (-170, 170)),
        ({"limit": within("3.14159265")}, "", (-3.14159265, 3.14159265), (-170, 170)),
        ({"limit": within("3.14")}, "", (-3.14, 3.14), (-170, 170)),
        ({}, "q_star: [-2]\n", (-1, 2), (-1, -2 + np.radians(170))),
    ],
)
def test_a_joint_that_turns_far_has_a_window_about_q_star(tmp_path, change, extra, own, window):
    scene = parsed(write(tmp_path, extra=extra, **change))
    (turn,) = scene.moving
    lower, upper = np.radians(window) if window == (-170, 170) else window
    assert turn.own_limits == own
    assert (turn.lower, turn.upper) == pytest.approx((lower, upper))
    assert turn.lower < scene.q_star[0] + np.pi
    assert any(w.startswith("joint arm/turn may turn 179 degrees from q*") for w in scene.warnings)
    outside = any(w == "q_star of joint arm/turn is -2 rad, which is not within its limits, -1 to 2 rad" for w in scene.warnings)
    assert outside is (extra == "q_star: [-2]\n")
    again = Scene.from_document(scene.to_document())
    assert again.moving[0].own_limits == own
    assert again.hash == scene.hash
    check_scene(scene)


def test_a_joint_that_stays_away_from_half_a_turn_has_its_own_limits(tmp_path):
    scene = parsed(write(tmp_path, limit=within("3.12")))
    assert (scene.moving[0].lower, scene.moving[0].upper, scene.moving[0].own_limits) == (-3.12, 3.12, None)


def test_a_scene_without_windows_has_the_hash_that_it_always_had(tmp_path):
    scene = parsed(write(tmp_path))
    assert scene.moving[0].own_limits is None
    assert "own_limits" not in scene.to_document()["joints"][-1]


def test_configurations_a_turn_away_are_taken_to_the_window_where_the_joint_goes_there(tmp_path):
    scene = parsed(write(tmp_path, limit=WIDE))
    q = np.array([[1.0], [1.0 - 2 * np.pi], [1.0 + 2 * np.pi], [3.1], [-4.0]])
    s = to_s(scene, q)
    np.testing.assert_allclose(s[:2], np.tan(0.5), rtol=1e-12)
    assert np.isnan(s[[2, 3]]).all()  # beyond 2 pi, and in the gap between windows
    np.testing.assert_allclose(s[4], np.tan((2 * np.pi - 4.0) / 2), rtol=1e-12)
    narrow = parsed(write(tmp_path))
    assert np.isnan(to_s(narrow, np.array([[1.0 - 2 * np.pi]]))).all()
    check_limits(scene, [1.0 - 2 * np.pi])
    check_limits(scene, [2 * np.pi])
    with pytest.raises(RegionError, match="nan is no number"):
        to_s(scene, np.array([[np.nan]]))
    for value, code in ((7.0, "seed_outside_limits"), (3.1, "seed_outside_window"), (2 * np.pi + 1e-6, "seed_outside_limits")):
        with pytest.raises(RegionError) as caught:
            check_limits(scene, [value])
        assert caught.value.code == code
        assert "arm/turn" in caught.value.message


@pytest.mark.parametrize("value", [-0.9, 0.0, 1.7])
def test_a_held_joint_is_where_drake_puts_it(tmp_path, value):
    path = write(tmp_path, more=FINGERS.split('<link name="right">')[0])
    free, held = parsed(path), parsed(write(tmp_path, more=FINGERS.split('<link name="right">')[0], extra=f"fix: {{turn: {value}}}\n"))
    assert [j.name for j in held.moving] == ["arm/grip"]
    assert held.moving[0].index == 0
    assert {j.kind for j in held.joints if j.name == "arm/turn"} == {JointKind.WELD}
    wanted = model_pose(path.parent, {"turn": value, "grip": 0.03}, "left")
    frames = Kinematics.of(held), Kinematics.of(free)
    points = np.random.default_rng(0).normal(size=(4, 3))
    at = [k.points("arm/base", "arm/left", points, k.scene.to_s(q)[None])[0] for k, q in zip(frames, ([0.03], [value, 0.03]), strict=True)]
    for found in at:
        np.testing.assert_allclose(found, points @ wanted[:3, :3].T + wanted[:3, 3], atol=1e-12)


@pytest.mark.parametrize("fix", ["grip: 0.03", "arm/other: 0.049", "{grip: 0.03, other: 0.049}"])
def test_a_coupled_joint_is_held_with_the_one_that_it_follows(tmp_path, fix):
    path = write(tmp_path, more=FINGERS, extra=f"fix: {fix if fix.startswith('{') else '{' + fix + '}'}\n")
    scene = parsed(path)
    assert [j.name for j in scene.moving] == ["arm/turn"]
    kinematics = Kinematics.of(scene)
    for finger, at in (("left", {"grip": 0.03}), ("right", {"other": 0.049})):
        wanted = model_pose(path.parent, {"turn": 0.4, **at}, finger)
        found = kinematics.points("arm/base", f"arm/{finger}", np.zeros((1, 3)), scene.to_s([0.4])[None])[0, 0]
        np.testing.assert_allclose(found, wanted[:3, 3], atol=1e-9)


def test_limits_of_ones_own(tmp_path):
    scene = parsed(write(tmp_path, extra="limits: {arm/turn: [-0.5, 1.5]}\n"))
    assert (scene.q_lower[0], scene.q_upper[0]) == (-0.5, 1.5)
    assert scene.q_star[0] == 0.5
    scene = parsed(write(tmp_path, kind="continuous", limit="", extra="limits: {turn: [0, 3]}\n"))
    assert scene.moving[0].own_limits is None


@pytest.mark.parametrize(
    ("change", "code", "field", "words"),
    [
        ({"extra": "fix: {trun: 0}\n"}, "unknown_name", "fix.trun", "did you mean arm/turn"),
        ({"extra": "fix: {turn: 3}\n"}, "scene_field", "fix.arm/turn", "3 is not within the joint's limits, -1 to 2"),
        ({"extra": "fix: {turn: x}\n"}, "scene_field", "fix.turn", "must be a position"),
        ({"extra": "fix: {turn: 9185166224891948.0}\n"}, "scene_field", "fix.turn", "must be a number of at most 1e+06"),
        ({"extra": "q_star: [1e16]\n"}, "scene_field", "q_star[0]", "must be a number of at most 1e+06"),
        ({"extra": "limits: {turn: [-1e16, 1e16]}\n"}, "scene_field", "limits.turn[0]", "must be a number of at most 1e+06"),
        ({"extra": "fix: [turn]\n"}, "scene_field", "fix", "must map names of joints"),
        ({"extra": "fix: {turn: 0}\n"}, "no_joints", "directives", "no joint"),
        ({"extra": "limits: {turn: [0, 3]}\n"}, "scene_field", "limits.arm/turn", "0 to 3 is not within the joint's own limits, -1 to 2"),
        ({"extra": "limits: {turn: [1, 1]}\n"}, "scene_field", "limits.turn", "hold a joint by fix"),
        ({"extra": "limits: {turn: 1}\n"}, "scene_field", "limits.turn", "[lower, upper]"),
        ({"more": FINGERS.replace("1.5", "1500")}, "unsupported_joint", "directives", "hold one of them, as in fix: {arm/"),
        ({"more": FINGERS, "extra": "fix: {grip: 0.03, other: 0.03}\n"}, "scene_field", "fix", "cannot be held at these positions"),
        ({"more": FINGERS.replace('"0.09"', '"0.02"'), "extra": "fix: {grip: 0.03}\n"}, "scene_field", "fix.arm/other", "0.049"),
    ],
)
def test_what_cannot_be_is_named(tmp_path, change, code, field, words):
    with pytest.raises(SceneError) as caught:
        parsed(write(tmp_path, **change))
    assert (caught.value.code, caught.value.field) == (code, field)
    assert words in str(caught.value) + caught.value.hint


BOX_AT = '<collision name="{0}"><origin xyz="0 0 {1}"/><geometry><box size="0.02 0.02 0.02"/></geometry></collision>'
BIN = '<collision name="bin"><geometry><mesh><uri>bin.obj</uri></mesh></geometry></collision>'
TETRAHEDRON = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
RING = f"""<link name="ring">{BOX_AT.format("low", 0)}{BOX_AT.format("high", 0.1)}</link>
  <joint name="hold" type="fixed"><parent link="hand"/><child link="ring"/></joint>"""
"""A body of two parts."""


def test_the_documents_example_is_read_and_its_table_has_every_key(tmp_path):
    text = (EXAMPLES.parent / "docs" / "scenes.md").read_text()
    example = text.split("```yaml\n")[1].split("```")[0]
    listed = re.findall(r"^\| `(\w+)` \|", text.split("## Joints")[0], re.MULTILINE)
    assert tuple(listed) == KEYS
    assert {*yaml.safe_load(example), "xacro"} == {*KEYS}  # its models are not in xacro
    (tmp_path / "cell").mkdir()
    (tmp_path / "my_robot_description").mkdir()
    (tmp_path / "cell" / "arm.srdf").write_text('<robot name="arm"/>')
    with_bin = ROOM.replace("</link>", f"{BIN}</link>", 1)
    path = write(tmp_path / "cell", example, limit=WIDE, more=FINGERS + RING, files={"room.sdf": with_bin, "bin.obj": TETRAHEDRON})
    scene = parsed(path)
    assert [g.name for g in scene.geometries if g.name.startswith("room/walls/bin")] == ["room/walls/bin/part1"]
    assert [j.name for j in scene.moving] == ["arm/turn"]
    assert (scene.q_lower[0], scene.padding, scene.name) == (-1.5, 0.005, "my-cell")
