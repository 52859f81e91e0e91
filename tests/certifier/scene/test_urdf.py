"""Names of URDF are checked as strictly as numbers: what Drake would drop is refused with file and line, and what is harmless is not."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from certifier.errors import SceneError
from certifier.scene.formats.urdf import Urdf
from certifier.scene.formats.urdf_names import HARMLESS, READ, REFUSED, UNSUPPORTED
from tests.certifier.scene.workshop import BOX, LIMIT, SCENE, parsed, write

ROBOT = """<robot name="arm" {robot}>
  <link name="base"/>
  <joint name="turn" type="{kind}" {joint}>
    <parent link="base"/><child link="hand"/>
    <origin xyz="0 0 0.3" {origin}/>
    <axis xyz="0 0 1" {axis}/>
    {limit}
    {in_joint}
  </joint>
  <link name="hand" {link}>
    {in_link}
    <collision name="palm" {collision}>
      <origin rpy="0 0 1"/>
      {in_collision}
      <geometry>{shape}</geometry>
    </collision>
  </link>
  {more}
</robot>
"""
PARTS = {
    **dict.fromkeys(("robot", "joint", "origin", "axis", "in_joint", "link", "in_link", "collision", "in_collision", "more"), ""),
    "kind": "revolute",
    "limit": LIMIT,
    "shape": BOX,
}


def read(directory: Path, **parts: str) -> Urdf:
    path = directory / "arm.urdf"
    path.write_text(ROBOT.format(**{**PARTS, **parts}))
    return Urdf(path, path.name, path.read_bytes())


OTHER = '<collision><geometry><box size="1 1 1"/></geometry></collision>'
LINKS = '<link name="more"/><joint name="j" type="fixed"><parent link="{}"/><child link="{}"/>{}</joint>'

REFUSED_PARTS = [
    # macros that nobody expanded
    ({"more": '<xacro:gripper parent="hand"/>'}, 18, "<xacro:gripper> is a macro", "expand the file with xacro"),
    ({"in_link": "<xacro:box/>"}, 11, "<xacro:box> is a macro", "expand the file with xacro"),
    ({"more": "<gazebo><xacro:sensor/></gazebo>"}, 18, "<xacro:sensor> is a macro", "expand the file with xacro"),
    ({"more": '<macro name="m" params=""/>'}, 18, "<macro> is a macro", "expand the file with xacro"),
    ({"shape": '<sphere radius="${r}"/>'}, 15, "radius of <sphere> is '${r}'", "expand the file with xacro"),
    ({"shape": '<mesh filename="$(find robot)/m.obj"/>'}, 15, "filename of <mesh> is '$(find robot)/m.obj'", "expand the file"),
    ({"in_link": '<visual><origin xyz="0 0 ${z}"/></visual>'}, 11, "xyz of <origin> is '0 0 ${z}'", "expand the file"),
    # elements with another name
    ({"in_link": OTHER.replace("collision", "colision")}, 11, "<colision> is not known in <link>", "did you mean collision"),
    ({"in_link": OTHER.replace("collision", "Collision")}, 11, "<Collision> is not known in <link>", "did you mean collision"),
    ({"in_link": OTHER.replace("collision", "my:collision")}, 11, "<my:collision> is not known in <link>", "did you mean collision"),
    ({"in_collision": '<orgin xyz="1 0 0"/>'}, 14, "<orgin> is not known in <collision>", "did you mean origin"),
    ({"in_joint": '<mimick joint="turn"/>'}, 8, "<mimick> is not known in <joint>", "did you mean mimic"),
    ({"shape": '<ellipsoid a="1" b="1" c="1"/>'}, 15, "<ellipsoid> is not known in <geometry>", "drake:ellipsoid"),
    ({"more": "<group><link name='l'/></group>"}, 18, "<group> is not known in <robot>", "known in <robot>"),
    # elements in another place
    ({"in_link": '<origin xyz="0 0 1"/>'}, 11, "<origin> in <link> is not read", "<origin> belongs in <collision>"),
    ({"in_joint": OTHER}, 8, "<collision> is not known in <joint>", "<collision> belongs in <link>"),
    ({"in_link": f"<geometry>{BOX}</geometry>"}, 11, "<geometry> is not known in <link>", "<geometry> belongs in <collision>"),
    ({"axis": '><limit lower="0" upper="1"/></axis><dynamics'}, 6, "<limit> is not known in <axis>", "<limit> belongs in <joint>"),
    ({"in_link": f"<visual>{OTHER}</visual>"}, 11, "<collision> in <visual> is not read", "<collision> belongs in <link>"),
    ({"in_link": "<inertial><link name='l'/></inertial>"}, 11, "<link> in <inertial> is not read", "<link> belongs in <robot>"),
    ({"in_link": LINKS.format("a", "b", "")}, 11, "<link> is not known in <link>", "<link> belongs in <robot>"),
    ({"more": "<transmission><link name='l'/></transmission>"}, 18, "<link> in <transmission> is not read", "belongs in <robot>"),
    ({"shape": "<box size='1 1 1'><origin xyz='1 0 0'/></box>"}, 15, "<origin> is not known in <box>", "<origin> belongs in"),
    (
        {"in_link": "<drake:collision_filter_group name='g'/>"},
        11,
        "<drake:collision_filter_group> is not known in <link>",
        "<drake:collision_filter_group> belongs in <robot>",
    ),
    ({"more": OTHER}, 18, "<collision> is not known in <robot>", "<collision> belongs in <link>"),
    # attributes
    ({"origin": 'xzy="1 0 0"'}, 5, "xzy is not known in <origin>", "did you mean xyz"),
    ({"origin": 'RPY="1 0 0"'}, 5, "RPY is not known in <origin>", "did you mean rpy"),
    ({"origin": 'quat_xyzw="0 0 0 1"'}, 5, "quat_xyzw of <origin>", "write the rotation as rpy"),
    ({"axis": 'rpy="0 0 1"'}, 6, "rpy is not known in <axis>", "known attributes: xyz"),
    ({"limit": '<limit Lower="-1" upper="1"/>'}, 7, "Lower is not known in <limit>", "did you mean lower"),
    ({"link": 'drake_ignore="true"'}, 10, "drake_ignore of <link>", "take the attribute out"),
    ({"joint": 'drake_ignore="true"'}, 3, "drake_ignore of <joint>", "take the attribute out"),
    ({"shape": '<sphere radius="1" diameter="2"/>'}, 15, "diameter is not known in <sphere>", "known attributes: radius"),
    ({"shape": '<mesh filename="m.obj" scale="1 1 1" Scale="2 2 2"/>'}, 15, "Scale is not known in <mesh>", "did you mean scale"),
    # text
    ({"shape": f"0.1 {BOX}"}, 15, "<geometry> holds the text '0.1'", ""),
    ({"more": "and more"}, 1, "<robot> holds the text 'and more'", ""),
    # numbers without which nothing is said
    ({"shape": "<sphere/>"}, 15, "<sphere> has no radius", ""),
    ({"shape": '<cylinder radius="1"/>'}, 15, "<cylinder> has no length", ""),
    ({"shape": "<box/>"}, 15, "<box> has no size", ""),
    ({"shape": '<drake:ellipsoid a="1" b="1"/>'}, 15, "<drake:ellipsoid> has no c", ""),
    ({"shape": "<mesh/>"}, 15, "<mesh> has no filename", ""),
    ({"shape": ""}, 15, "<geometry> has no shape", "shapes: box"),
    ({"shape": '<box size="-0.3 0.1 0.1"/>'}, 15, "size of <box> must be positive, and is -0.3 0.1 0.1", ""),
    *(
        ({"shape": f"<{shape}/>"}, 15, f"of <{shape.split()[0]}> must be positive", "")
        for shape in (
            'sphere radius="0"',
            'cylinder radius="0.1" length="0"',
            'cylinder radius="-1" length="1"',
            'capsule radius="0" length="1"',
            'drake:capsule radius="1" length="-1e-9"',
            'drake:ellipsoid a="1" b="0" c="1"',
        )
    ),
    ({"shape": '<mesh filename="m.obj" scale="1 0 1"/>'}, 15, "scale of <mesh> has 0 in it", ""),
    ({"in_link": '<visual><geometry><sphere radius="0"/></geometry></visual>'}, 11, "radius of <sphere> must be positive", ""),
    ({"in_link": "<collision/>"}, 11, "<collision> has no <geometry>", ""),
    ({"in_link": f'<collision name=""><geometry>{BOX}</geometry></collision>'}, 11, "the name of <collision> is empty", "of its own"),
    # numbers out of range
    *(({"origin": f'rpy="0 0 {x}"'}, 5, f"rpy of <origin> has {x} in it", "mend the number") for x in ("1e+90", "-1.1e+06")),
    ({"in_link": f'<collision><origin xyz="1e90 0 0"/><geometry>{BOX}</geometry></collision>'}, 11, "xyz of <origin> has 1e+90", ""),
    ({"more": "<frame name='f' link='hand' xyz='0 -2e6 0'/>"}, 18, "xyz of <frame> has -2e+06 in it", "mend the number"),
    ({"shape": '<box size="1e20 1e-20 1"/>'}, 15, "size of <box> has 1e+20 in it", "mend the number"),
    ({"shape": '<sphere radius="1e-300"/>'}, 15, "radius of <sphere> has 1e-300 in it", "mend the number"),
    ({"shape": '<capsule radius="1" length="2e6"/>'}, 15, "length of <capsule> has 2e+06 in it", "mend the number"),
    *(({"shape": f'<mesh filename="m.obj" scale="1 {x} 1"/>'}, 15, f"scale of <mesh> has {x} in it", "") for x in ("1e-09", "-1.1e+09")),
    # joints
    ({"in_joint": "", "joint": 'name2="x"'}, 3, "name2 is not known in <joint>", "did you mean name"),
    ({"more": '<joint name="j"><parent link="hand"/><child link="base"/></joint>'}, 18, "<joint> has no type", ""),
    ({"more": '<joint name="j" type="fixed"><child link="base"/></joint>'}, 18, "<joint> has no <parent>", ""),
    ({"more": '<joint name="j" type="fixed"><parent link="hand"/></joint>'}, 18, "<joint> has no <child>", ""),
    ({"more": '<joint type="fixed"><parent link="hand"/></joint>'}, 18, "<joint> has no name", ""),
    ({"more": '<link name=""/>'}, 18, "<link> has no name", ""),
    ({"more": LINKS.format("hnad", "more", "")}, 18, "<parent> names the link 'hnad', which is not in the file", "did you mean hand"),
    ({"more": LINKS.format("base", "hand", "")}, 18, "link 'hand' is the child of another joint too, in line 3", "trees"),
    ({"more": '<link name="hand"/>'}, 18, "a second link is called 'hand'; the first is in line 10", "rename"),
    ({"more": LINKS.format("hand", "more", "").replace('"j"', '"turn"')}, 18, "a second joint is called 'turn'", "rename"),
    ({"in_joint": '<mimic joint="trun"/>'}, 8, "<mimic> names the joint 'trun'", "did you mean turn"),
    ({"in_joint": "<mimic/>"}, 8, "<mimic> has no joint", ""),
    ({"in_joint": '<mimic joint="a"/><mimic joint="b"/>'}, 8, "second <mimic>", ""),
    ({"more": '<frame name="f" link="bsae"/>'}, 18, "<frame> names the link 'bsae'", "did you mean base"),
    ({"limit": ""}, 3, "the <limit> of a revolute joint has no lower", "or make the joint continuous"),
    ({"limit": '<limit lower="-1"/>'}, 7, "the <limit> of a revolute joint has no upper", "or make the joint continuous"),
    ({"limit": '<limit lower="1" upper="-1"/>'}, 7, "limits of a joint are 1 and -1", ""),
    ({"kind": "continuous", "limit": '<limit lower="1" upper="-1"/>'}, 7, "limits of a joint are 1 and -1", ""),
    ({"kind": "prismatic", "limit": '<limit lower="1" upper="-1"/>'}, 7, "limits of a joint are 1 and -1", ""),
    ({"axis": '/><axis xyz="0 0 0"'}, 6, "second <axis>", ""),
    *(({"kind": kind}, 3, f"joint 'turn' is a '{kind}' joint", hint[:20]) for kind, hint in UNSUPPORTED.items()),
    ({"kind": "Revolute"}, 3, "joint 'turn' is a 'Revolute' joint", "did you mean revolute"),
    ({"more": LINKS.format("hand", "more", "").replace("joint", "drake:joint")}, 18, "<drake:joint> is not known in <robot>", "joint"),
    *(({"more": f"<{name}/>"}, 18, f"<{name}>: it acts between bodies", "take it out") for place, name in REFUSED if place == "robot"),
]


@pytest.mark.parametrize(("parts", "line", "words", "hint"), REFUSED_PARTS)
def test_what_drake_would_drop_or_refuse_without_a_line_is_refused_with_it(tmp_path, parts, line, words, hint):
    with pytest.raises(SceneError) as caught:
        read(tmp_path, **parts)
    assert caught.value.message.startswith(f"arm.urdf:{line}: ")
    assert words in caught.value.message
    assert hint in caught.value.hint
    assert caught.value.code == ("unsupported_joint" if "joint; " in caught.value.message else "scene_model")


@pytest.mark.parametrize("root", ["robots", "Robot", "sdf", "model", "r:robot"])
def test_another_root_is_refused(tmp_path, root):
    (tmp_path / "a.urdf").write_text(f"\n<{root} name='a'><link name='l'/></{root}>")
    with pytest.raises(SceneError, match=rf"a\.urdf:2: <{root}> is not known as the root"):
        Urdf(tmp_path / "a.urdf", "a.urdf", (tmp_path / "a.urdf").read_bytes())


GAZEBO = (
    '<gazebo reference="hand"><collision><x/></collision><link name="l"/><sensor f="$(find x)"><origin xyz="x"/><origin/></sensor></gazebo>'
)
ACCEPTED = [
    {"robot": 'version="1.1" xmlns:xacro="http://www.ros.org/wiki/xacro" xmlns="http://www.ros.org"'},
    {"link": 'type="laser"', "joint": 'dont_collapse="true"', "collision": 'group="default" concave="yes"'},
    {"in_link": '<origin xyz="0 0 0" rpy="0 -0 0"/>'},
    {"in_link": "<inertial><origin xyz='0 0 0'/><mass value='1'/><inertia ixx='1'/></inertial><visual><anything/></visual>"},
    {"in_link": "<contact><lateral_friction value='1'/></contact><self_collision_checking/><sensor><origin/><origin/></sensor>"},
    {"in_link": "<self_filter><geometry><box/></geometry></self_filter><gravity>1</gravity><surface><friction/></surface>"},
    {"in_collision": "<material name='m'/><verbose value='x'/><surface/><drake:proximity_properties><x/></drake:proximity_properties>"},
    {"in_link": "<collision_checking><capsule name='palm'/></collision_checking><kinematic>0</kinematic><gazebo/><material/>"},
    {"in_collision": "<surface><contact><ode><kp>1</kp></ode></contact><friction/></surface><contact_coefficients mu='0'/>"},
    {"in_joint": "<dynamics damping='1'/><safety_controller k_velocity='1'/><calibration rising='0'/>"},
    {"limit": LIMIT.replace("/>", ' drake:acceleration="1" jerk="1" command_effort="2"/>')},
    {"more": "<transmission name='t'><joint name='turn'><x/></joint><actuator name='a'/></transmission>"},
    {"more": "<ros2_control name='r'><hardware/><joint name='turn'><command_interface/></joint><sensor/></ros2_control>"},
    {"more": f"<material name='m'><color rgba='1 1 1 1'/></material><mujoco><compiler meshdir='x'/></mujoco>{GAZEBO}"},
    {"more": "<frame name='f' link='hand' xyz='0 0 1' rpy='0 0 0'/>"},
    {"more": LINKS.format("hand", "more", '<axis xyz="0 0 0"/><limit effort="1" velocity="1"/>')},
    {"more": LINKS.format("world", "base", "")},
    {"kind": "continuous", "limit": ""},
    {"in_joint": "<hardwareInterface>x</hardwareInterface><friction>1</friction><damping>1</damping>", "collision": 'id="3"'},
    {"limit": LIMIT.replace("/>", ' damping="1" friction="2"/>'), "more": "<webots><plugin type='a'><origin/></plugin></webots>"},
    {"in_joint": "<dynamics damping='1' friction='x' extra='1'/>", "shape": '<box size="1e-9 1e6 1"/>', "origin": 'rpy="1e6 -1e6 0"'},
    {"kind": "prismatic", "limit": '<limit upper="1"/>'},
    {"shape": '<mesh filename="m.obj" scale="-1 1 2"><drake:declare_convex/></mesh>'},
    {
        "robot": 'xmlns:ns0="http://drake.mit.edu"',
        "limit": LIMIT.replace("/>", ' ns0:acceleration="1"/>'),
        "shape": '<mesh filename="m.obj"><ns0:declare_convex/></mesh>',
        "more": "<ns0:collision_filter_group name='g'><ns0:member link='hand'/></ns0:collision_filter_group>",
    },
    {
        "more": "<drake:collision_filter_group name='g'><drake:member link='hand'/><drake:member_group name='h'/>"
        "<drake:ignored_collision_filter_group name='g'/></drake:collision_filter_group>"
    },
]


@pytest.mark.parametrize("parts", ACCEPTED)
def test_what_is_harmless_is_accepted_by_name(tmp_path, parts):
    (palm,) = read(tmp_path, **parts).collisions
    assert (palm.file, palm.line) == ("palm", 12)


def test_collisions_are_counted_with_their_names_and_lines(tmp_path):
    drawn = OTHER.replace("collision", "visual")
    found = read(tmp_path, in_link=f"{OTHER}{drawn}", more=f"{GAZEBO}<link name='more'>{OTHER}</link>").collisions
    assert [(c.file, c.line) for c in found] == [("box", 11), ("palm", 12), ("box", 18)]


def test_a_floating_joint_is_refused_with_its_line(tmp_path):
    with pytest.raises(SceneError, match=r"arm\.urdf:3: joint 'turn' is a 'floating' joint") as caught:
        parsed(write(tmp_path, kind="floating", limit=""))
    assert caught.value.code == "unsupported_joint"


@pytest.mark.parametrize("limits", ["-0.5 0.5", "0 0", f"{-2 * np.pi} {2 * np.pi}", "-1e16 1e16"])
def test_limits_of_a_continuous_joint_do_not_count_and_that_is_said(tmp_path, limits):
    """So have it URDF, MuJoCo (:mod:`.test_urdf_oracle`) and everybody but Drake."""
    lower, upper = limits.split()
    path = write(tmp_path, kind="continuous", limit=f'<limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/>')
    scene = parsed(path)
    said = f"joint arm/turn is continuous, so its limits {float(lower):g} and {float(upper):g} do not count in URDF"
    assert sum(w.startswith(said) for w in scene.warnings) == 1
    assert scene.moving[0].own_limits == (None, None)
    assert scene.hash == parsed(write(tmp_path, kind="continuous", limit="")).hash


def test_limits_of_a_continuous_joint_do_not_count_behind_directives_with_a_namespace(tmp_path):
    text = "packages: {here: .}\ndirectives:\n  - add_model_instance: {name: far}\n  - add_model_instance: {name: near}\n"
    text += "  - add_directives: {file: package://here/more.yaml, model_namespace: far}\n"
    text += "  - add_directives: {file: package://here/more.yaml, model_namespace: near}\n"
    path = write(tmp_path, text, kind="continuous", limit='<limit lower="-1" upper="1"/>')
    more = "directives: [{add_model: {name: arm, file: package://here/arm.urdf}}, {add_weld: {parent: world, child: arm::base}}]"
    (tmp_path / "more.yaml").write_text(more)
    scene = parsed(path)
    assert [j.name for j in scene.moving] == ["far::arm/turn", "near::arm/turn"]
    assert [j.own_limits for j in scene.moving] == [(None, None)] * 2


@pytest.mark.parametrize("limit", ["1e16", "1e9", "1.7976931348623157e308", "1e6"])
@pytest.mark.parametrize("kind", ["urdf", "sdf", "mjcf"])
def test_a_slide_whose_limits_mean_that_there_are_none_has_none(tmp_path, kind, limit):
    sdf = f"""<sdf version="1.9"><model name="arm"><link name="base"/><link name="hand"/><joint name="turn" type="prismatic">
      <parent>base</parent><child>hand</child><axis><xyz>1 0 0</xyz><limit><lower>-{limit}</lower><upper>{limit}</upper></limit></axis>
      </joint></model></sdf>"""
    mjcf = f"""<mujoco model="arm"><worldbody><body name="base"><geom size="1"/><body name="hand"><joint name="turn" type="slide"
      limited="true" range="-{limit} {limit}"/><geom size="1"/></body></body></worldbody></mujoco>"""
    parts = {
        "urdf": {"kind": "prismatic", "limit": f'<limit lower="-{limit}" upper="{limit}"/>'},
        "sdf": {"scene": SCENE.replace("arm.urdf", "arm.sdf"), "files": {"arm.sdf": sdf}},
        "mjcf": {
            "scene": SCENE.replace("arm.urdf", "arm.xml").replace("  - add_weld: {parent: world, child: arm::base}\n", ""),
            "files": {"arm.xml": mjcf},
        },
    }[kind]
    with pytest.raises(SceneError, match="joint arm/turn has no finite limits") as caught:
        parsed(write(tmp_path, **parts))
    assert caught.value.hint == "give it some by limits: {arm/turn: [LOWER, UPPER]}"
    assert parsed(write(tmp_path, **parts, extra="limits: {turn: [-1, 1]}\n")).q_upper[0] == 1


DOCS = Path(__file__).parents[3] / "docs" / "scenes.md"


def test_the_documents_tables_are_the_readers():
    """The first table has an element, its attributes by kind; the second what is harmless in a place; the third what has a reason."""
    text = DOCS.read_text().split("### URDF\n")[1].split("\n## ")[0].split("\n### ")[0]
    rows = [[re.findall(r"`([^`]+)`", cell) for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("| `")]
    elements = {tuple(names[0].split("/")): cells for names, *cells in rows if len(cells) == 3}
    assert elements == {key: [list(known.needed), list(known.read), list(known.harmless)] for key, known in READ.items()}
    assert {names[0]: cells[0] for names, *cells in rows if len(cells) == 1} == {place: list(names) for place, names in HARMLESS.items()}
    refused = {name for names, *cells in rows if len(cells) == 2 for name in names}
    assert refused == {f"{place}/{name}".replace("/@", "@") for place, name in REFUSED} | {f"type={kind}" for kind in UNSUPPORTED}
