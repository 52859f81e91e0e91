"""What MJCF may say, by name and by value; tests/errors/models.py provokes every message once, and test_mjcf_oracle.py asks MuJoCo."""

import re

import mujoco
import numpy as np
import pytest

from certifier.errors import SceneError
from certifier.scene.formats.mjcf import Mjcf
from certifier.scene.formats.mjcf_names import ELEMENTS
from tests.certifier.scene.mjcf_table import DOC, table
from tests.certifier.scene.workshop import parsed, write

SCENE = "directives: [{add_model: {name: arm, file: arm.xml}}]\n"
TETRAHEDRON = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
ARM = """<mujoco model="arm"><compiler angle="radian"/>{top}
  <worldbody><geom name="post" type="box" size="0.02 0.02 0.4" pos="0.3 -0.2 0.4"/>
    <body name="upper" pos="0 0 0.3">
      <joint name="shoulder" range="-0.3 0.3"/>
      <geom name="up" type="capsule" fromto="0 0 0 0.3 0 0" size="0.04"/>
      <body name="wrist" {body}>
        {joints}
        <geom name="tool" {tool}/>
        {more}
      </body></body></worldbody>
  {end}</mujoco>
"""
TOOL = 'type="box" size="0.15 0.03 0.03" pos="0.15 0 0"'


def arm(tmp_path, *, top="", body="", joints="", tool=TOOL, more="", end="", **files):
    """The path of a scene file with the arm alone."""
    text = ARM.format(top=top, body=body, joints=joints, tool=tool, more=more, end=end)
    return write(tmp_path, SCENE, files={"arm.xml": text, **{name.replace("__", "."): content for name, content in files.items()}})


def classes(text):
    return f"<default>{text}</default>"


YAW = '<joint name="yaw" axis="0 0 1" range="-2 2"/>'
PITCH = '<joint name="pitch" axis="0 1 0" range="-0.5 0.5"/>'
SLIDE = '<joint name="along" type="slide" axis="1 0 0" range="-1 1"/>'
DRAWN = 'contype="0" conaffinity="0"'
MESH = '<asset><mesh name="m" file="{}"/></asset>'
GEOM = '<geom name="fore" {} type="mesh" mesh="m"/>'


REFUSED = {
    "joints behind a shift": ({"body": 'pos="0.4 0 0"', "joints": YAW + PITCH}, 6, "has several joints and a pose that shifts it"),
    "joints behind a turn": ({"body": 'euler="0 0 1"', "joints": SLIDE + YAW}, 6, "has several joints and a pose that turns it"),
    "a default joint that turns": (
        {"top": classes('<joint type="hinge"/>'), "body": 'pos="0.4 0 0"', "joints": '<joint range="0 1"/>' + SLIDE},
        6,
        "has several joints",
    ),
    "a pair of a drawn geom": (
        {"more": f'<geom name="fore" {DRAWN} size="0.1"/>', "end": '<contact><pair geom1="fore" geom2="post"/></contact>'},
        11,
        "contype and conaffinity of 'fore' are 0",
    ),
    "a pair of geoms that are drawn by default": (
        {"top": classes(f"<geom {DRAWN}/>"), "end": '<contact><pair geom1="post" geom2="tool"/></contact>'},
        11,
        "contype and conaffinity of 'post' are 0",
    ),
    "a pair of neighbours": ({"joints": YAW, "end": '<contact><pair geom1="up" geom2="tool"/></contact>'}, 11, "neighbours"),
    "a pair that is excluded": (
        {
            "joints": YAW,
            "more": '<body name="tip"><joint range="0 1"/><geom name="end" size="0.1"/></body>',
            "end": '<contact><pair geom1="up" geom2="end"/><exclude body1="tip" body2="upper"/></contact>',
        },
        11,
        "excluded",
    ),
    "a VTK that collides": ({"top": MESH.format("m.vtk"), "more": GEOM.format("")}, 1, "'m.vtk' is collision geometry"),
    "a sphere of radius 0": ({"tool": 'size="0"'}, 8, "size of a sphere must be positive"),
    "a geom without size": ({"tool": ""}, 8, "size of a sphere has too few numbers: 0 instead of 1"),
    "a size of 0 in a class": ({"top": classes('<geom size="0 1 1"/>'), "tool": ""}, 8, "size of a sphere must be positive"),
    "a typo in an element": ({"more": '<goem size="1"/>'}, 9, "<goem> in <body> is not known"),
    "a typo in an attribute": ({"more": '<geom size="1" pso="1 0 0"/>'}, 9, "pso of <geom> is not known"),
    "a typo in a class": ({"top": classes('<geom siez="1"/>')}, 1, "siez of <geom> is not known"),
    "a body beside the world": ({"end": '<body><geom size="1"/></body>'}, 11, "<body> in <mujoco> is not known"),
    "a mesh's class without <mesh>": (
        {
            "top": classes('<mesh scale="2 2 2"/><default class="c"><geom/></default>')
            + '<asset><mesh name="m" class="c" file="t.obj"/></asset>',
            "t__obj": TETRAHEDRON,
        },
        1,
        "scale comes from a class around 'c'",
    ),
    "a joint's class without <joint>": (
        {"top": classes('<joint axis="0 1 0"/><default class="c"><geom/></default>'), "joints": '<joint class="c"/>'},
        7,
        "axis comes from a class around 'c'",
    ),
    "a file included twice": (
        {"more": '<include file="p.xml"/><include file="p.xml"/>', "p__xml": "<mujoco><site/></mujoco>"},
        9,
        "'p.xml' is included twice",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_drake_reads_otherwise_is_refused(tmp_path, name):
    change, line, words = REFUSED[name]
    with pytest.raises(SceneError) as caught:
        parsed(arm(tmp_path, **change))
    assert caught.value.message.startswith(f"arm.xml:{line}: ")
    assert words in caught.value.message


def test_a_fault_in_an_included_file_is_said_of_that_file(tmp_path):
    nested = '<mujocoinclude>\n<include file="parts/inner.xml"/></mujocoinclude>'
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "inner.xml").write_text("<mujocoinclude>\n\n<geom size='0'/></mujocoinclude>")
    with pytest.raises(SceneError, match=r"directives: parts/inner\.xml:3: size of a sphere"):
        parsed(arm(tmp_path, more='<include file="parts.xml"/>', parts__xml=nested))


@pytest.mark.parametrize(
    ("change", "n"),
    [
        ({"joints": YAW + PITCH}, 3),
        ({"body": 'pos="0 0 0" quat="1 0 0 0"', "joints": YAW + PITCH}, 3),
        ({"body": 'pos="0.4 0 0"', "joints": SLIDE + YAW}, 3),
        ({"body": 'pos="0.4 0 0" euler="1 0 0"', "joints": YAW}, 2),
        ({"joints": '<joint range="-1 1" ref="0.5" pos="0.1 0 0" axis="3 4 0"/>'}, 2),
        ({"joints": '<joint range="-1 1" limited="false"/>'}, 2),
        ({"end": '<equality><weld body1="wrist" active="false"/></equality>'}, 1),
        ({"end": '<contact><pair geom1="post" geom2="tool"/></contact>'}, 1),
        ({"top": classes('<geom type="box"/><default class="c"><geom/></default>'), "tool": 'class="c" size="1 1 1"'}, 1),
    ],
)
def test_what_drake_reads_as_mujoco_does_is_accepted(tmp_path, change, n):
    assert parsed(arm(tmp_path, **change)).n == n


def test_a_mesh_that_is_only_drawn_is_not_checked_as_collision_geometry(tmp_path):
    odd = TETRAHEDRON + "curv 0 1 1 2\n"
    with pytest.raises(SceneError, match=r"m\.obj:9"):
        parsed(arm(tmp_path, top=MESH.format("m.obj"), more=GEOM.format(""), m__obj=odd))
    assert parsed(arm(tmp_path, top=MESH.format("m.obj"), more=GEOM.format(DRAWN), m__obj=odd)).n == 1


def test_geoms_that_may_collide_are_counted(tmp_path):
    more = f'<geom size="1"/><geom name="eye" {DRAWN} size="1"/><include file="p.xml"/>'
    arm(tmp_path, more=more, p__xml='<mujoco><geom type="box" size="1 1 1"/></mujoco>')
    counted = [(geom.file, geom.line) for geom in Mjcf(tmp_path / "arm.xml", "arm.xml", (tmp_path / "arm.xml").read_bytes()).collisions]
    assert counted == [("post", 2), ("up", 5), ("tool", 8), ("sphere", 9), ("box", 1)]


def test_a_joint_with_a_reference_stands_there_as_written(tmp_path):
    """At its reference, the wrist is not turned: its tool reaches to x = 0.3."""
    scene = parsed(arm(tmp_path, joints='<joint name="yaw" range="0 1" ref="0.5"/>'))
    joint = next(j for j in scene.joints if j.name == "arm/yaw")
    turned = np.array([[np.cos(0.5), -np.sin(0.5), 0], [np.sin(0.5), np.cos(0.5), 0], [0, 0, 1]])
    np.testing.assert_allclose(joint.X_PF[:3, :3] @ turned @ joint.X_BM[:3, :3].T, np.eye(3), atol=1e-12)


def mujocos_names():
    """The attributes of every element, by its parent and its name, as MuJoCo prints them."""
    found, around = {}, []
    for line in mujoco.mj_printSchema(False, True).splitlines():
        if start := re.match(r"( *)(\S+) \(.\) *(.*)", line):
            del around[len(start[1]) // 3 :]
            around.append(start[2].removeprefix("(world)"))
            line = start[3]
        found.setdefault(tuple(around[-2:]), set()).update(line.split())
    return found


@pytest.mark.parametrize("place", [*(("body", name) for name in ("joint", "freejoint", "geom")), ("mujoco", "body"), ("asset", "mesh")])
def test_every_name_that_mujoco_knows_is_known(place):
    known = ELEMENTS[place[1]]
    assert mujocos_names()[place] == {*known.read, *known.unused, *known.refused}


def test_every_element_that_mujoco_knows_in_a_body_is_known():
    known = ELEMENTS["body"]
    assert {place[1] for place in mujocos_names() if place[0] == "body" and len(place) == 2} <= {
        *known.elements,
        *known.skipped,
        *known.refused_elements,
    }


def test_the_table_in_the_docs_is_that_of_the_reader():
    assert table() in DOC.read_text(), "run python -m tests.certifier.scene.mjcf_table"
