"""Scene files are drafted for models as people write them: poses, models in models, mimic joints, slides without limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from certifier.errors import SceneError
from certifier.scene.draft import Draft, draft
from certifier.scene.tree import Tree
from tests.certifier.scene.workshop import ARM, BOX, LIMIT

BALL = '<collision name="c"><geometry><sphere><radius>0.02</radius></sphere></geometry></collision>'


def drafted(directory: Path, world: str, suffix: str = "sdf") -> Draft:
    """A draft of the small arm, far from a world of this text."""
    (directory / "arm.urdf").write_text(ARM.format(kind="revolute", limit=LIMIT, shape=BOX, more=""))
    (directory / f"world.{suffix}").write_text(world)
    return draft(directory / "arm.urdf", [directory / f"world.{suffix}"], directory / "scene.yaml", {}, {})


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
