"""Scene files are drafted for models as people write them: poses, models in models, mimic joints, slides without limits."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import yaml

from certifier.errors import SceneError
from certifier.model import Scene
from certifier.scene.draft import Draft, Part, draft
from certifier.scene.drake_model import build_diagram, drake_name
from certifier.scene.tree import Tree
from tests.certifier.scene.workshop import ARM, BOX, LIMIT

BALL = '<collision name="c"><geometry><sphere><radius>0.02</radius></sphere></geometry></collision>'


def drafted(directory: Path, world: str, suffix: str = "sdf") -> Draft:
    """A draft of the small arm, far from a world of this text."""
    (directory / "arm.urdf").write_text(ARM.format(kind="revolute", limit=LIMIT, shape=BOX, more=""))
    (directory / f"world.{suffix}").write_text(world)
    return draft(directory / "arm.urdf", [Part(directory / f"world.{suffix}")], directory / "scene.yaml", {})


def said(made: Draft, key: str) -> dict[str, object]:
    return yaml.safe_load(made.text.replace("!Rpy", "")).get(key, {})


def positions(made: Draft) -> dict[str, list[float]]:
    """Where the world's links stand, metres."""
    tree = Tree(list(made.scene.joints), list(made.scene.bodies))
    return {body: X[:3, 3].round(6).tolist() for body, X in tree.anchored.items() if not body.startswith(("world", "arm"))}


def sdf(inside: str) -> str:
    return f'<sdf version="1.11">{inside}</sdf>'


def test_links_stand_where_their_file_says(tmp_path: Path) -> None:
    """Two loose links, one of which holds a third by a fixed joint, in a model that stands elsewhere and is turned."""
    made = drafted(
        tmp_path,
        sdf(
            f"""<model name="m"><pose>5 1 0 0 0 1.5707963267948966</pose>
            <link name="a"><pose>1 0 2 0.3 0 0</pose>{BALL}</link>
            <link name="b"><pose>0 1 0 0 0 0</pose>{BALL}</link>
            <joint name="glue" type="fixed"><parent>b</parent><child>c</child></joint>
            <link name="c"><pose>0 1 1 0 0 0</pose>{BALL}</link></model>"""
        ),
    )
    assert positions(made) == {"m/a": [5, 2, 2], "m/b": [4, 1, 0], "m/c": [4, 1, 1]}
    (weld,) = [joint for joint in made.scene.joints if joint.child == "m/a"]
    turned = np.array([[0, -np.cos(0.3), np.sin(0.3)], [1, 0, 0], [0, np.sin(0.3), np.cos(0.3)]])
    np.testing.assert_allclose((weld.X_PF @ np.linalg.inv(weld.X_BM))[:3, :3], turned, atol=1e-9)


@pytest.mark.parametrize("static", ["", "<static>true</static>"])
def test_models_in_a_model_stand_where_their_file_says(tmp_path: Path, static: str) -> None:
    inner = f'<model name="in"><pose>3 0 0 0 0 0</pose><link name="a">{BALL}</link></model>'
    made = drafted(tmp_path, sdf(f'<model name="m">{static}<pose>1 0 0 0 0 0</pose><link name="a">{BALL}</link>{inner}</model>'))
    assert positions(made) == {"m/a": [1, 0, 0], "m::in/a": [4, 0, 0]}


def test_a_world_of_one_model_is_drafted_and_one_of_two_is_refused_with_what_to_do(tmp_path: Path) -> None:
    one, two = (f'<model name="{name}"><pose>{x} 0 0 0 0 0</pose><link name="a">{BALL}</link></model>' for name, x in (("x", 2), ("y", 3)))
    assert positions(drafted(tmp_path, sdf(f'<world name="w">{one}</world>'))) == {"x/a": [2, 0, 0]}
    for several in (f'<world name="w">{one}{two}</world>', one + two):
        with pytest.raises(SceneError, match=r"single <model>|one model") as refused:
            drafted(tmp_path, sdf(several))
        assert "put them all into one <model>" in refused.value.hint
    assert positions(drafted(tmp_path, sdf(f'<model name="w">{one}{two}</model>'))) == {"w::x/a": [2, 0, 0], "w::y/a": [3, 0, 0]}


def test_packages_of_included_models_are_found_above(tmp_path: Path) -> None:
    (tmp_path / "shop").mkdir()
    (tmp_path / "shop" / "table.sdf").write_text(sdf(f'<model name="table"><link name="top">{BALL}</link></model>'))
    include = "<include><uri>model://shop/table.sdf</uri><pose>0 3 0 0 0 0</pose></include>"
    made = drafted(tmp_path, sdf(f'<model name="hall">{include}</model>'))
    assert said(made, "packages") == {"shop": "shop"}
    assert positions(made) == {"hall::table/top": [0, 3, 0]}


def finger(name: str, more: str, lower: float = 0.0, axis: str = "") -> str:
    return f"""<link name="{name}">{BALL}</link><joint name="j{name}" type="prismatic"><parent>palm</parent><child>{name}</child>
      <axis><xyz>1 0 0</xyz><limit><lower>{lower}</lower><upper>0.05</upper></limit>{axis}</axis>{more}</joint>"""


def hand(*fingers: str) -> str:
    return sdf(f'<model name="g"><pose>5 0 0 0 0 0</pose><link name="palm"/>{"".join(fingers)}</model>')


def test_a_joint_that_others_mimic_is_held_where_all_are_within_their_limits(tmp_path: Path) -> None:
    """0.02 - l is within 0.01 and 0.05 for an l of 0.01 and less; half of it plus 0.001 is 0.003 and more for an l of 0.004 and more."""
    minus, half = ("<drake:mimic joint='jl' multiplier='-1' offset='0.02'/>", "<drake:mimic joint='jl' multiplier='0.5' offset='0.001'/>")
    made = drafted(tmp_path, hand(finger("l", ""), finger("r", minus, 0.01), finger("s", half, 0.003)))
    assert said(made, "fix") == {"g/jl": pytest.approx(0.004)}
    assert made.scene.n == 1
    with pytest.raises(SceneError, match=r"g/jr follows g/jl, as -1 times its position plus 0.02; .* for g/jr 0.03 to 0.05"):
        drafted(tmp_path, hand(finger("l", ""), finger("r", minus, 0.03)))


def test_mimic_joints_that_drake_does_not_read_are_held_with_the_others(tmp_path: Path) -> None:
    axis = '<mimic joint="jl"><multiplier>2</multiplier><offset>0.01</offset><reference>0.02</reference></mimic>'
    made = drafted(tmp_path, hand(finger("l", ""), finger("r", "", axis=axis)))
    assert said(made, "fix") == {"g/jl": pytest.approx(0.015), "g/jr": pytest.approx(0.0, abs=1e-12)}
    assert made.scene.n == 1


@pytest.mark.parametrize(
    ("model", "where"),
    [
        (hand(finger("l", ""), finger("r", "<drake:mimic joint='jl' multiplier='1,5' offset='0'/>")), "multiplier of <drake:mimic>"),
        (hand(finger("l", ""), finger("r", "", axis="<mimic joint='jl'><multiplier>1 2</multiplier></mimic>")), "<multiplier>"),
    ],
)
def test_numbers_of_mimic_joints_are_read_as_written(tmp_path: Path, model: str, where: str) -> None:
    """Drake would take 1,5 for 1."""
    with pytest.raises(SceneError, match=f"world.sdf:.*{where} is '1[, ][25]' instead of 1 finite decimal number"):
        drafted(tmp_path, model)


def test_a_slide_without_limits_is_drafted_with_a_guess(tmp_path: Path) -> None:
    """URDF wants limits there, but people leave them out; of joints that mimic each other, none needs a guess."""

    def slide(name: str, limit: str) -> str:
        return f"""<link name="{name}"/><joint name="j{name}" type="prismatic"><parent link="base"/><child link="{name}"/>
          <axis xyz="1 0 0"/>{limit}</joint>"""

    limits = ("", '<limit lower="0.2"/>', '<limit upper="-3"/>', '<limit lower="0" upper="2"/>')
    slides = "".join(slide("abcd"[i], limit) for i, limit in enumerate(limits)) + slide("e", "<mimic joint='jf'/>") + slide("f", "")
    made = drafted(tmp_path, f'<robot name="u"><link name="base"/>{slides}</robot>', "urdf")
    assert said(made, "limits") == {"u/ja": [-1, 1], "u/jb": [0.2, 1.2], "u/jc": [-4, -3]}
    assert said(made, "fix") == {"u/jf": 0}
    assert "this is a guess" in made.text


def test_what_a_file_leaves_floating_is_welded_where_it_says(tmp_path: Path) -> None:
    body = '<body name="b" pos="2 0 1"><freejoint/><geom type="sphere" size="0.1"/></body>'
    made = drafted(tmp_path, f'<mujoco model="q"><worldbody>{body}</worldbody></mujoco>', "xml")
    assert positions(made) == {"q/b": [2, 0, 1]}


def test_a_model_in_the_robot_is_a_part_of_it(tmp_path: Path) -> None:
    """A hand in a model of its own is always in the base, so the draft ignores that, as it does for links of the robot itself."""
    ball = BALL.replace("0.02", "0.2")
    turns = "<axis><xyz>0 0 1</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis>"
    (tmp_path / "robot.sdf").write_text(
        sdf(
            f"""<model name="r"><link name="base">{ball}</link><link name="wrist"/>
            <model name="hand"><pose>0 0 0.1 0 0 0</pose><link name="palm">{ball}</link></model>
            <joint name="one" type="revolute"><parent>base</parent><child>wrist</child>{turns}</joint>
            <joint name="two" type="revolute"><parent>wrist</parent><child>hand::palm</child>{turns}</joint></model>"""
        )
    )
    made = draft(tmp_path / "robot.sdf", [], tmp_path / "scene.yaml", {}, {})
    assert [(pair.a, pair.b) for pair in made.ignored] == [("r/base/c", "r::hand/palm/c")]
    assert made.overlapping == ()


def test_a_mimic_joint_follows_the_joint_of_the_whole_name(tmp_path: Path) -> None:
    """``x/lead`` is another joint than ``lead``, whose position it does not follow."""
    joint = """<link name="{0}"/><joint name="{0}" type="revolute"><parent>base</parent><child>l{0}</child><axis><limit><lower>{1}</lower>
      <upper>1</upper></limit>{2}</axis></joint>""".replace('link name="{0}"', 'link name="l{0}"')
    joints = joint.format("lead", 0.25, "") + joint.format("x/lead", 0.5, "")
    joints += joint.format("follow", -1, '<mimic joint="lead"><multiplier>1</multiplier><offset>0</offset><reference>0</reference></mimic>')
    text = f'<sdf version="1.11"><model name="arm"><link name="base"/>{joints}</model></sdf>'
    (tmp_path / "arm.sdf").write_text(text)
    made = draft(tmp_path / "arm.sdf", [], tmp_path / "scene.yaml", {}, {})
    assert "  arm/lead: 0.25\n" in made.text
    assert "  arm/follow: 0.25\n" in made.text
    assert [joint.name for joint in made.scene.moving] == ["arm/x/lead"]


GRIPPER = (
    '<robot name="grip"><link name="palm"><collision><geometry><box size="0.04 0.04 0.04"/></geometry></collision></link>'
    '<joint name="slide" type="prismatic"><parent link="palm"/><child link="finger"/><origin xyz="0 0 0.1"/><axis xyz="1 0 0"/>'
    '<limit lower="0" upper="0.03" effort="1" velocity="1"/></joint>'
    '<link name="finger"><collision><geometry><box size="0.02 0.02 0.02"/></geometry></collision></link></robot>'
)


def cell(directory: Path, mount: Part | None = None, world: Part | None = None, srdf: Path | None = None) -> Draft:
    """A draft of the small arm with what it carries and what stands around it."""
    (directory / "arm.urdf").write_text(ARM.format(kind="revolute", limit=LIMIT, shape=BOX, more=""))
    return draft(directory / "arm.urdf", [world] if world else [], directory / "scene.yaml", {}, [mount] if mount else [], srdf)


def pose(scene: Scene, body: str, frame: str) -> np.ndarray:
    """Drake's pose of a body in the frame of another one at the middle of all limits, (4, 4)."""
    diagram = build_diagram(scene)
    plant, context = diagram.plant(), diagram.CreateDefaultContext()
    plant.SetPositions(plant.GetMyContextFromRoot(context), scene.q_star)
    at = {name: plant.GetBodyByName(drake_name(name)).body_frame() for name in (body, frame)}
    return plant.CalcRelativeTransform(plant.GetMyContextFromRoot(context), at[frame], at[body]).GetAsMatrix4()


def test_a_gripper_hangs_on_the_link_that_is_named_where_it_is_said(tmp_path: Path) -> None:
    (tmp_path / "grip.urdf").write_text(GRIPPER)
    made = cell(tmp_path, Part(tmp_path / "grip.urdf", "hand", (0.1, 0.2, 0.3), (90.0, 0.0, 90.0)))
    X = pose(made.scene, "grip/palm", "arm/hand")
    # Roll by 90 degrees takes y to z and z to -y; yaw by 90 degrees then takes x to y and y to -x.
    np.testing.assert_allclose(X, [[0, 0, 1, 0.1], [1, 0, 0, 0.2], [0, 1, 0, 0.3], [0, 0, 0, 1]], atol=1e-9)
    assert [joint.name for joint in made.scene.moving] == ["arm/turn", "grip/slide"]
    assert cell(tmp_path, Part(tmp_path / "grip.urdf", "arm::hand")).scene.bodies == made.scene.bodies


@pytest.mark.parametrize(
    ("link", "words"),
    [("", r"grip\.urdf@LINK; links at its ends: hand"), ("hend", "did you mean hand"), ("palm", "links at its ends: hand")],
)
def test_a_link_that_is_missing_is_asked_for_by_name(tmp_path: Path, link: str, words: str) -> None:
    (tmp_path / "grip.urdf").write_text(GRIPPER)
    with pytest.raises(SceneError) as refused:
        cell(tmp_path, Part(tmp_path / "grip.urdf", link))
    assert (refused.value.code, refused.value.field) == ("mount", "--mount")
    assert re.search(words, f"{refused.value.message} {refused.value.hint}")


def test_what_is_mounted_hangs_on_one_body(tmp_path: Path) -> None:
    (tmp_path / "two.sdf").write_text(sdf(f'<model name="two"><link name="a">{BALL}</link><link name="b">{BALL}</link></model>'))
    with pytest.raises(SceneError, match="has 2 bodies that nothing holds: two::a, two::b"):
        cell(tmp_path, Part(tmp_path / "two.sdf", "hand"))


def test_a_pose_of_a_world_moves_all_of_it_with_its_own_poses(tmp_path: Path) -> None:
    (tmp_path / "w.sdf").write_text(
        sdf(f'<model name="m"><link name="a"><pose>1 0 0 0 0 0</pose>{BALL}</link><link name="b">{BALL}</link></model>')
    )
    made = cell(tmp_path, world=Part(tmp_path / "w.sdf", "", (5.0, 0.0, 1.0), (0.0, 0.0, 90.0)))
    assert positions(made) == {"m/a": [5, 1, 1], "m/b": [5, 0, 1]}
    assert cell(tmp_path, world=Part(tmp_path / "w.sdf")).text.count("X_PC: {translation: [1.0, 0.0, 0.0]}") == 1


SRDF = '<robot name="arm"><group_state name="home" group="all"><joint name="{0}" value="0.5"/></group_state>{1}</robot>'
DISABLED = '<disable_collisions link1="base" link2="{0}" reason="Never"/>'


def test_an_srdf_file_beside_the_model_is_used_and_said(tmp_path: Path) -> None:
    assert cell(tmp_path).notes == ()
    for place in (tmp_path / "srdf" / "arm.srdf", tmp_path / "urdf" / "arm.srdf"):
        (tmp_path / "urdf").mkdir(exist_ok=True)
        place.parent.mkdir(exist_ok=True)
        place.write_text(SRDF.format("turn", DISABLED.format("hand")))
        made = cell(tmp_path / "urdf")
        assert made.scene.configurations == {"arm/all/home": {"arm/turn": 0.5}}
        assert made.notes == (f"{place} is beside the model, and the draft uses it",)
        place.write_text(SRDF.format("turn", DISABLED.format("tool")))
        made = cell(tmp_path / "urdf")
        assert made.scene.configurations == {}
        assert "not used" in made.notes[0]
        assert "'tool' is no link of arm" in made.notes[0]
        place.unlink()
    (tmp_path / "srdf" / "other.srdf").write_text(SRDF.format("turn", ""))
    assert cell(tmp_path / "urdf").notes == ("not used: other.srdf in ../srdf of the model; name one with --srdf",)
    named = cell(tmp_path / "urdf", srdf=tmp_path / "srdf" / "other.srdf")
    assert (named.scene.configurations, named.notes) == ({"arm/all/home": {"arm/turn": 0.5}}, ())
    (tmp_path / "srdf" / "other.srdf").write_text(SRDF.format("turn", DISABLED.format("tool")))
    with pytest.raises(SceneError, match="'tool' is no link of arm"):
        cell(tmp_path / "urdf", srdf=tmp_path / "srdf" / "other.srdf")


def test_a_joint_that_others_mimic_is_held_where_the_state_of_the_maker_has_it(tmp_path: Path) -> None:
    """Of two states, the one with more joints says where. A value beyond the limits is as good as the limit."""
    model = '<robot name="g"><link name="palm"/>{}</robot>'
    joint = """<joint name="{0}" type="prismatic"><parent link="palm"/><child link="{0}_tip"/><axis xyz="1 0 0"/>{1}
    <limit lower="0" upper="0.04" effort="1" velocity="1"/></joint><link name="{0}_tip"/>"""
    (tmp_path / "g.urdf").write_text(model.format(joint.format("l", "") + joint.format("r", '<mimic joint="l"/>') + joint.format("x", "")))
    state = '<group_state name="{0}" group="all"><joint name="l" value="{1}"/>{2}</group_state>'
    for value, held in ((0.01, 0.01), (0.1, 0.04)):
        states = state.format("open", 0.03, "") + state.format("home", value, '<joint name="x" value="0.02"/>')
        (tmp_path / "g.srdf").write_text(f'<robot name="g">{states}</robot>')
        made = draft(tmp_path / "g.urdf", [], tmp_path / "scene.yaml", {})
        assert said(made, "fix") == {"g/l": held}
    (tmp_path / "g.srdf").write_text("<robot name='g'><nonsense/></robot>")
    made = draft(tmp_path / "g.urdf", [], tmp_path / "scene.yaml", {})
    assert said(made, "fix") == {"g/l": 0}
    assert "not used" in made.notes[0]


U = """v -0.2 -0.2 0\nv 0.2 -0.2 0\nv 0.2 0.2 0\nv -0.2 0.2 0\nv -0.2 -0.2 0.2\nv 0.2 -0.2 0.2\nv 0.2 0.2 0.2\nv -0.2 0.2 0.2
f 1 4 3 2\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"""
"""A box of 0.4 m and 0.2 m in height without a lid."""
CARRIED = """<robot name="arm"><link name="base"><collision name="tub"><geometry><mesh filename="tub.obj"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="mid"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint><link name="mid"/>
<joint name="nod" type="revolute"><parent link="mid"/><child link="ball"/><origin xyz="0 0 {z}"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
<link name="ball"><collision name="ball"><geometry><sphere radius="0.03"/></geometry></collision></link></robot>"""


@pytest.mark.parametrize("z", [0.15, 0.0])
def test_pairs_of_which_perhaps_only_hulls_overlap_are_marked(tmp_path: Path, z: float) -> None:
    """The ball is inside of the open tub, whose hull is full. A ball in the floor overlaps by less than the hull reaches beyond."""
    (tmp_path / "tub.obj").write_text(U)
    (tmp_path / "arm.urdf").write_text(CARRIED.format(z=z))
    made = draft(tmp_path / "arm.urdf", [], tmp_path / "scene.yaml", {})
    assert [(pair.a, pair.b) for pair in made.ignored] == [("arm/ball/ball", "arm/base/tub")]
    assert made.doubtful.keys() == {*made.ignored}
    assert "# Look at these: perhaps only their hulls overlap" in made.text
    assert "perhaps as hulls only" in made.scene.ignored[0].reason


def test_boxes_that_overlap_are_not_doubtful(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(CARRIED.format(z=0.0).replace('<mesh filename="tub.obj"/>', '<box size="0.4 0.4 0.4"/>'))
    made = draft(tmp_path / "arm.urdf", [], tmp_path / "scene.yaml", {})
    assert len(made.ignored) == 1
    assert not made.doubtful
    assert "perhaps" not in made.text
