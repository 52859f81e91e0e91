"""SRDF files: which pairs they take away, what they name, and what is refused. The oracle is MoveIt's rule, written out anew."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from certifier.errors import SceneError
from certifier.model import Scene
from certifier.scene.bundle import load_bundle, pack_bundle
from certifier.scene.formats.srdf import Srdf
from tests.certifier.scene.workshop import parsed, write

LINKS = ("base", "l1", "l2", "l3")
BALL = '<collision><geometry><sphere radius="0.02"/></geometry></collision>'
CHAIN = (
    '<robot name="arm">'
    + "".join(f'<link name="{link}">{BALL}</link>' for link in LINKS)
    + "".join(
        f'<joint name="j{i}" type="revolute"><parent link="{a}"/><child link="{b}"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>'
        '<limit lower="-2" upper="2" effort="1" velocity="1"/></joint>'
        for i, (a, b) in enumerate(itertools.pairwise(LINKS), 1)
    )
    + "</robot>"
)
"""An arm of four links, each a ball, 0.3 m apart."""
STATE = '<group_state name="{name}" group="all">{joints}</group_state>'


def robot(inside: str) -> str:
    return f'<?xml version="1.0"?>\n<robot name="arm">\n{inside}\n</robot>'


def scene(directory: Path, inside: str, extra: str = "") -> Scene:
    files = {"arm.srdf": robot(inside)}
    return parsed(write(directory, arm=CHAIN, extra=f"srdf: {{arm: arm.srdf}}\n{extra}", files=files))


def ignored(made: Scene) -> dict[frozenset[str], str]:
    """The reasons by the pairs of links of the arm that are ignored."""
    link = {g.name: g.body.removeprefix("arm/") for g in made.geometries}
    return {frozenset((link[i.a], link[i.b])): i.reason for i in made.ignored}


def test_disabled_pairs_are_ignored_with_their_reasons_and_one_line_says_how_many(tmp_path: Path) -> None:
    made = scene(
        tmp_path,
        '<disable_collisions link1="base" link2="l1" reason="Adjacent"/><disable_collisions link1="l2" link2="base" reason="Never"/>'
        '<disable_collisions link1="base" link2="l3"/><disable_collisions link1="l3" link2="base" reason="Never"/>',
    )
    assert ignored(made) == {frozenset(("base", "l2")): "arm.srdf: Never", frozenset(("base", "l3")): "arm.srdf: no reason given"}
    said = [warning for warning in made.warnings if "srdf" in warning]
    assert said == [
        "arm.srdf: 2 pairs of bodies are ignored: 1 Never, 1 no reason given; 2 of them touch at none of 201 configurations tried: "
        "without the entries, these are certified"
    ]
    assert not [warning for warning in made.warnings if "but touch at none" in warning]


def test_an_entry_of_the_scene_file_comes_first_and_has_a_finding_of_its_own(tmp_path: Path) -> None:
    disabled = '<disable_collisions link1="base" link2="l2" reason="Never"/>'
    made = scene(tmp_path, disabled, "ignore: [{pair: [arm/base, arm/l2], reason: mine}]\n")
    assert ignored(made) == {frozenset(("base", "l2")): "mine"}
    assert not [warning for warning in made.warnings if "srdf" in warning]
    assert [warning for warning in made.warnings if "arm/base and arm/l2 are ignored, but touch at none" in warning]


PAIRS = [frozenset(pair) for pair in itertools.combinations(LINKS, 2)]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=15)
@given(
    st.dictionaries(st.sampled_from(PAIRS), st.sampled_from(["disable", "enable"])),
    st.lists(st.sampled_from(LINKS), unique=True, max_size=3),
    st.randoms(),
)
def test_pairs_follow_the_rule_of_moveit(tmp_path: Path, said: dict[frozenset[str], str], undefaulted: list[str], random) -> None:
    """MoveIt asks the entry of the pair, and where there is none whether collisions of one of the links are disabled by default."""
    lines = [f'<{how}_collisions link1="{min(pair)}" link2="{max(pair)}"/>' for pair, how in said.items()]
    lines += [f'<disable_default_collisions link="{link}"/>' for link in undefaulted]
    random.shuffle(lines)
    made = scene(tmp_path, "\n".join(lines))
    neighbours = {frozenset(pair) for pair in itertools.pairwise(LINKS)}
    expected = {
        pair for pair in PAIRS if pair not in neighbours and (said[pair] == "disable" if pair in said else not pair.isdisjoint(undefaulted))
    }
    assert set(ignored(made)) == expected
    link = {g.name: g.body.removeprefix("arm/") for g in made.geometries}
    certified = {frozenset((link[p.a], link[p.b])) for p in made.pairs if p.a.startswith("arm/") and p.b.startswith("arm/")}
    assert certified == {*PAIRS} - neighbours - expected
    assert len([p for p in made.pairs if "room/" in p.a + p.b]) == 3, "pairs with the room stay, whatever the file says"


def test_states_are_configurations_and_those_that_cannot_be_are_left_out_with_a_warning(tmp_path: Path) -> None:
    joints = '<joint name="j1" value="0.5"/><joint name="j2" value=" -1. "/>'
    base = '<virtual_joint name="v" type="planar" parent_frame="world" child_link="base"/>'
    made = scene(
        tmp_path,
        base
        + STATE.format(name="home", joints=joints + '<joint name="v" value="1"/><joint name="free" value="0 0 0 0 0 0 1"/>')
        + STATE.format(name="far", joints='<joint name="j1" value="2.001"/>')
        + STATE.format(name="held", joints='<joint name="j3" value="0.25"/><joint name="j1" value="0"/>')
        + STATE.format(name="moved", joints='<joint name="j3" value="0.26"/>')
        + STATE.format(name="odd", joints='<joint name="jj1" value="0"/>')
        + STATE.format(name="a,b", joints=joints)
        + STATE.format(name="none", joints="")
        + '<group_state name="lone"><joint name="j2" value="0"/></group_state>',
        "fix: {j3: 0.25}\nconfigurations: {rest: [0, 1], partly: {j2: 0.1}}\n",
    )
    assert made.configurations == {
        "arm/all/home": {"arm/j1": 0.5, "arm/j2": -1.0},
        "arm/all/held": {"arm/j1": 0.0},
        "arm/lone": {"arm/j2": 0.0},
        "rest": {"arm/j1": 0.0, "arm/j2": 1.0},
        "partly": {"arm/j2": 0.1},
    }
    left_out = {w.split("the state ")[1].split(" is left out: ")[0]: w for w in made.warnings if "left out" in w}
    assert list(left_out) == ["arm/all/far", "arm/all/moved", "arm/all/odd", "arm/all/a,b", "arm/all/none"]
    assert "joint arm/j1 is at 2.001 rad, not between its limits -2 and 2 rad" in left_out["arm/all/far"]
    assert "held at 0.25, and the state has it at 0.26" in left_out["arm/all/moved"]
    assert "did you mean arm/j1" in left_out["arm/all/odd"]
    assert all(warning.startswith("arm.srdf:3: ") for warning in left_out.values())


def test_configurations_are_not_part_of_the_hash_and_come_back_from_the_document(tmp_path: Path) -> None:
    plain = parsed(write(tmp_path, arm=CHAIN))
    named = scene(tmp_path, STATE.format(name="home", joints='<joint name="j1" value="0.5"/>'))
    assert plain.hash == named.hash
    assert "configurations" not in plain.to_document()
    assert Scene.from_document(named.to_document()).configurations == named.configurations == {"arm/all/home": {"arm/j1": 0.5}}


@pytest.mark.parametrize(
    "given", [{"home": {"arm/j9": 0.0}}, {"home": {"arm/j1": "0"}}, {"1": {"arm/j1": 0.0}}, {"a,b": {}}, [1], {"a": 1}]
)
def test_documents_with_other_configurations_are_refused(tmp_path: Path, given: object) -> None:
    document = parsed(write(tmp_path, arm=CHAIN)).to_document()
    with pytest.raises(SceneError):
        Scene.from_document({**document, "configurations": given})


@pytest.mark.parametrize(
    ("inside", "line", "what"),
    [
        ('<disable_collision link1="base" link2="l1"/>', 3, "did you mean disable_collisions"),
        ('<disable_collisions link1="base" link="l1"/>', 3, "link is not known"),
        ('<disable_collisions link1="base"/>', 3, "has no link2"),
        ('<disable_collisions link1="base" link2=" base "/>', 3, "are both 'base'"),
        ('<disable_collisions link1="base" link2="l9"/>', 3, "'l9' is no link of arm"),
        ('<enable_collisions link1="l8" link2="l1"/>', 3, "'l8' is no link of arm"),
        ('<disable_default_collisions link="l7"/>', 3, "'l7' is no link of arm"),
        ('<enable_collisions link1="l1" link2="base"/>\n<disable_collisions link1="base" link2="l1"/>', 4, "enabled in line 3"),
        ('<group name="g">\n<disable_collisions link1="base" link2="l1"/></group>', 4, "is not read"),
        ('<xacro:macro name="x"/>', 3, "not XML: unbound prefix|macro"),
        ('<group name="${prefix}arm"/>', 3, "not expanded"),
        ("<group_state/>", 3, "has no name"),
        (STATE.format(name="a", joints='<joint name="j1" value="1,5"/>'), 3, "instead of 1 finite decimal number"),
        (STATE.format(name="a", joints='<joint name="j1" value="nan"/>'), 3, "instead of 1 finite decimal number"),
        (STATE.format(name="a", joints='<joint name="j1" value="1e7"/>'), 3, "of at most 1e"),
        (STATE.format(name="a", joints='<joint name="j1" value="1"/>\n<joint name="j1" value="1"/>'), 4, "twice"),
        (STATE.format(name="a", joints="") + "\n" + STATE.format(name="a", joints=""), 4, "stands in line 3 already"),
        (STATE.format(name="a", joints='<joint name="j1"/>'), 3, "has no value"),
        ("<link name='l1'/>", 3, "not known in <robot>"),
        ("<group name='g'>" * 60, 3, "nested|not XML"),
    ],
)
def test_what_is_not_srdf_is_refused_with_file_and_line(tmp_path: Path, inside: str, line: int, what: str) -> None:
    with pytest.raises(SceneError, match=rf"arm\.srdf:{line}: ") as refused:
        scene(tmp_path, inside)
    assert refused.value.field == "srdf.arm"
    assert refused.value.hint
    assert re.search(what, f"{refused.value.message} {refused.value.hint}")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(st.text(st.sampled_from("<>/=\"' abrobotlinkgroup_state1.e-&;\n"), max_size=120) | st.binary(max_size=60))
def test_no_text_does_anything_but_be_read_or_refused(tmp_path: Path, text: str | bytes) -> None:
    path = tmp_path / "any.srdf"
    path.write_bytes(text if isinstance(text, bytes) else robot(text).encode())
    try:
        Srdf(path, "any.srdf")
        code = "scene_srdf"
    except SceneError as error:
        code = error.code
    assert code == "scene_srdf"


@pytest.mark.parametrize(
    ("extra", "field", "what"),
    [
        ("srdf: {arm: none.srdf}", "srdf.arm", "no file"),
        ("srdf: {arms: arm.srdf}", "srdf.arms", "'arms' is no model"),
        ("srdf: {arm: arm.xml}", "srdf.arm", "ends in .srdf"),
        ("srdf: {arm: /arm.srdf}", "srdf.arm", "not a relative path"),
        ("srdf: {arm: package://moveit/arm.srdf}", "srdf.arm", "unknown package"),
        ("srdf: [arm.srdf]", "srdf", "names of models"),
        ("configurations: [home]", "configurations", "joint positions"),
        ("configurations: {'a,b': {j1: 0}}", "configurations", "cannot be the name"),
        ("configurations: {q_star: {j1: 0}}", "configurations", "cannot be the name"),
        ("configurations: {'1e3': {j1: 0}}", "configurations", "cannot be the name"),
        ("configurations: {home: {}}", "configurations.home", "positions by joint"),
        ("configurations: {home: {j1: x}}", "configurations.home.j1", "must be a number"),
        ("configurations: {home: {j4: 0}}", "configurations.home.j4", "is no joint of the scene"),
        ("configurations: {home: {j1: 0, arm/j1: 0}}", "configurations.home.arm/j1", "named twice"),
        ("configurations: {home: {j1: 2.1}}", "configurations.home.arm/j1", "not between its limits"),
        ("configurations: {home: [0, 0]}", "configurations.home", "2 numbers for 3 joints"),
        ("configurations: {home: [0, .nan, 0]}", "configurations.home[1]", "must be a number"),
    ],
)
def test_what_a_scene_file_says_wrongly_is_refused_with_the_field(tmp_path: Path, extra: str, field: str, what: str) -> None:
    with pytest.raises(SceneError, match=what) as refused:
        parsed(write(tmp_path, arm=CHAIN, extra=extra + "\n", files={"arm.srdf": robot("")}))
    assert refused.value.field == field


def test_a_position_outside_of_the_window_of_a_turn_is_refused(tmp_path: Path) -> None:
    turning = CHAIN.replace('lower="-2" upper="2"', 'lower="-6" upper="6"')
    for value, error in ((2.9, ""), (-3.4, ""), (3.1, "outside of the window"), (6.1, "not between its limits")):
        path = write(tmp_path, arm=turning, extra=f"configurations: {{home: {{j1: {value}}}}}\n")
        if error:
            with pytest.raises(SceneError, match=error):
                parsed(path)
        else:
            assert parsed(path).configurations == {"home": {"arm/j1": value}}


def test_the_file_travels_in_the_bundle(tmp_path: Path) -> None:
    inside = STATE.format(name="home", joints='<joint name="j1" value="0.5"/>') + '<disable_collisions link1="base" link2="l2"/>'
    here = scene(tmp_path, inside)
    there = load_bundle(pack_bundle(tmp_path / "scene.yaml")).scene
    assert there.hash == here.hash
    assert there.configurations == here.configurations
    (tmp_path / "arm.srdf").write_text('<!DOCTYPE robot [<!ENTITY a "a">]>' + robot(inside))
    with pytest.raises(SceneError, match="document type"):
        load_bundle(pack_bundle(tmp_path / "scene.yaml"))
