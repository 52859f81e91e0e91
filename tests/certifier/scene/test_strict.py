"""Model files that Drake would read otherwise than they are written are refused, with file and line; others are not.

Drake 1.51.1 takes nearly every model of these tables without an error (docs/scenes.md); what it refuses, it refuses without the line.
"""

import numpy as np
import pytest

from certifier.errors import SceneError
from certifier.scene import load_bundle, load_scene, pack_bundle
from certifier.scene.draft import draft
from certifier.scene.file import read_scene_file
from certifier.scene.strict import StrictReader
from tests.certifier.scene.workshop import ROOM, SCENE, parsed, write

TETRAHEDRON = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
SDF = """<sdf version="1.7"><model name="room"><link name="walls">
  <collision name="wall">
    <pose>{pose}</pose>
    <geometry>{shape}</geometry></collision>
</link>{more}</model></sdf>
"""
BOX = "<box><size>0.1 1 1</size></box>"
TURN = """<link name="door"/><joint name="turn" type="revolute"><parent>walls</parent><child>door</child><axis><xyz>0 0 1</xyz><limit>
  {}</limit></axis></joint>"""
POSE = "0.6 0 0.3 0 0 0"
MJCF = """<mujoco model="arm">{top}
  <worldbody><body name="base"><geom name="foot" size="0.1"/>
    <body name="hand" {body}>
      <joint name="turn" type="hinge" range="-60 60" axis="0 0 1" {joint}/>
      <geom name="palm" {geom}/>
      {more}
    </body></body></worldbody></mujoco>
"""
MUJOCO = "directives: [{add_model: {name: arm, file: arm.xml}}, {add_model: {name: room, file: room.sdf}}, "
MUJOCO += "{add_weld: {parent: world, child: room::walls}}]\n"
HALF = ["1,5", "1.0abc", "0x10", "1_0"]
"""What Drake reads the beginning of as a number."""


def sdf(*, pose=POSE, shape=BOX, more=""):
    return {"files": {"room.sdf": SDF.format(pose=pose, shape=shape, more=more)}}


def mjcf(*, top="", body="", joint="", geom='size="0.1" pos="0.5 0 0"', more="", **files):
    return {"scene": MUJOCO, "files": {"arm.xml": MJCF.format(top=top, body=body, joint=joint, geom=geom, more=more), **files}}


def limits(lower):
    return {"limit": f'<limit lower="{lower}" upper="2" effort="1" velocity="1"/>'}


REFUSED = [
    *(({"shape": f'<sphere radius="{x}"/>'}, "arm.urdf:7", "radius of <sphere>") for x in HALF),
    *(({"shape": f'<box size="1 1 {x}"/>'}, "arm.urdf:7", "size of <box>") for x in HALF),
    *((limits(x), "arm.urdf:5", "lower of <limit>") for x in HALF),
    (limits("3"), "arm.urdf:5", "limits of a joint are 3 and 2"),
    (sdf(more=TURN.format("<lower>2</lower><upper>1</upper>")), "room.sdf:5", "limits of a joint are 2 and 1"),
    (mjcf(top='<default><joint range="1 -1"/></default>'), "arm.xml:1", "limits of a joint are 1 and -1"),
    ({"shape": '<box size="1 nan 1"/>'}, "arm.urdf:7", "size of <box>"),
    ({"shape": '<sphere radius="0.1"/><box size="9 9 9"/>'}, "arm.urdf:7", "more than one shape"),
    ({"shape": '<box size="1 1 1"/><box size="9 9 9"/>'}, "arm.urdf:7", "second <box>"),
    ({"shape": '<sphere radius="0.1"/></geometry><geometry><box size="9 9 9"/>'}, "arm.urdf:7", "second <geometry>"),
    ({"limit": limits("-1")["limit"] + limits("-0.5")["limit"]}, "arm.urdf:5", "second <limit>"),
    ({"shape": '<mesh filename="t.obj" scale="1 1 1,5"/>', "files": {"t.obj": TETRAHEDRON}}, "arm.urdf:7", "scale of <mesh>"),
    ({"shape": '<mesh filename="t.obj" scale="nan 1 1"/>', "files": {"t.obj": TETRAHEDRON}}, "arm.urdf:7", "scale of <mesh>"),
    ({"shape": '<mesh filename="m.obj"/>', "files": {"m.obj": TETRAHEDRON.replace("v 0.1", "v nan")}}, "m.obj:2", "is not a vertex"),
    *((sdf(shape=f"<sphere><radius>{x}</radius></sphere>"), "room.sdf:4", "<radius>") for x in [*HALF, "1 2", "1.2.3", "nan", "-1", "0"]),
    *((sdf(pose=f"0.6 0 {x} 0 0 0"), "room.sdf:3", "<pose>") for x in HALF),
    *((sdf(shape=f"<box><size>{x}</size></box>"), "room.sdf:4", "<size>") for x in ["1 1 1 1", "1 1.2.3 1", "-1 1 1", "1 1 1e-400"]),
    (sdf(shape="<sphere><radius>1<!-- or --> 5</radius></sphere>"), "room.sdf:4", "holds more than text"),
    (sdf(shape="<sphere><radius><![CDATA[1]]>5</radius></sphere>"), "room.sdf:4", "holds more than text"),
    (sdf(shape="<sphere><radius>1</radius><radius>2</radius></sphere>"), "room.sdf:4", "second <radius>"),
    (sdf(shape="<mesh><uri>t<!-- or -->.obj</uri></mesh>"), "room.sdf:4", "holds more than text"),
    (sdf(more="<include><uri>arm<!-- or -->.urdf</uri></include>"), "room.sdf:5", "holds more than text"),
    (sdf(shape="<sphere/>"), "room.sdf:4", "has no <radius>"),
    (sdf(shape="<cylinder><radius>1</radius></cylinder>"), "room.sdf:4", "has no <length>"),
    (sdf(shape=BOX + "<sphere><radius>9</radius></sphere>"), "room.sdf:4", "more than one shape"),
    (sdf(shape=BOX + BOX), "room.sdf:4", "second <box>"),
    (sdf(shape=f"{BOX}</geometry><geometry>{BOX}"), "room.sdf:4", "second <geometry>"),
    (sdf(shape="<ellipsoid><radii>1 1 1 1</radii></ellipsoid>"), "room.sdf:4", "<radii>"),
    (sdf(shape="<drake:ellipsoid><a>1</a><b>1,5</b><c>1</c></drake:ellipsoid>"), "room.sdf:4", "<b>"),
    (sdf(shape="<plane><normal>0 0 1 5</normal></plane>"), "room.sdf:4", "<normal>"),
    (sdf(more="<include><uri>room.txt</uri></include>"), "room.sdf:5", "is no file that was found"),
    *((mjcf(geom=f'size="{x}"'), "arm.xml:5", f"size of a sphere has {x} in it") for x in ("1e-10", "1.1e+06")),
    (mjcf(geom='type="box" size="1e20 1e-20 1"'), "arm.xml:5", "size of a box has 1e+20 in it"),
    (mjcf(geom='size="0.1" pos="0 1e90 0"'), "arm.xml:5", "pos of <geom> has 1e+90 in it"),
    (mjcf(geom='type="capsule" fromto="0 0 0 0 0 2e6" size="1"'), "arm.xml:5", "fromto of <geom> has 2e+06 in it"),
    (mjcf(body='pos="-1e90 0 0"'), "arm.xml:3", "pos of <body> has -1e+90 in it"),
    (mjcf(top='<default><mesh scale="1 0 1"/></default>'), "arm.xml:1", "scale of <mesh> has 0 in it"),
    (mjcf(top='<asset><mesh file="t.obj" scale="1 1 1e-300"/></asset>', **{"t.obj": TETRAHEDRON}), "arm.xml:1", "has 1e-300 in it"),
    (
        mjcf(
            top='<asset><mesh name="m" file="t.obj"/></asset><default><mesh scale="1e8 1 1"/></default>',
            geom='type="mesh" mesh="m"',
            **{"t.obj": TETRAHEDRON},
        ),
        "arm.xml:1",
        "'t.obj' has a coordinate of 1e+07 m; at most 1e+06 m is read",
    ),
    ({"shape": '<mesh filename="m.obj"/>', "files": {"m.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\n"}}, "m.obj:1", "the file has no faces"),
    ({"shape": '<mesh filename="t.obj" scale="1e8"/>', "files": {"t.obj": TETRAHEDRON}}, "arm.urdf:7", "'t.obj' has a coordinate of 1e+07"),
    (
        {"files": {"t.obj": TETRAHEDRON, **sdf(shape="<mesh><uri>t.obj</uri><scale>1 1e8 1</scale></mesh>")["files"]}},
        "room.sdf:4",
        "'t.obj' has a coordinate of 1e+07",
    ),
    (mjcf(geom='size="abc"'), "arm.xml:5", "size of <geom>"),
    (mjcf(geom='size="1,5"'), "arm.xml:5", "size of <geom>"),
    (mjcf(geom='size="0.1" pos="0 0 1,5"'), "arm.xml:5", "pos of <geom>"),
    (mjcf(geom='size="0.1" quat="1 0 0 1abc"'), "arm.xml:5", "quat of <geom>"),
    (mjcf(body='pos="0 0 1,5"'), "arm.xml:3", "pos of <body>"),
    (mjcf(body='mocap="true"'), "arm.xml:3", "mocap"),
    (mjcf(top='<default><geom pos="0 0 1,5"/></default>'), "arm.xml:1", "pos of <geom>"),
    (mjcf(more='<frame pos="5 0 0"><geom size="2"/></frame>'), "arm.xml:6", "<frame>"),
    (mjcf(more='<replicate count="3"><geom size="2"/></replicate>'), "arm.xml:6", "<replicate>"),
    (mjcf(top='<asset><mesh file="t.obj" refpos="1 0 0"/></asset>', **{"t.obj": TETRAHEDRON}), "arm.xml:1", "refpos"),
    (mjcf(more='<include file="p.txt"/>', **{"p.txt": '<mujoco>\n<geom size="1,5"/></mujoco>'}), "p.txt:2", "size of <geom>"),
    (mjcf(more='<geom type="mesh" mesh="none"/>'), "arm.xml:6", "the mesh 'none' of <geom> is not known"),
    (mjcf(more='<geom type="hfield" size="1"/>'), "arm.xml:6", "hfield"),
]


@pytest.mark.parametrize(("change", "where", "words"), REFUSED)
def test_what_drake_would_read_otherwise_is_refused(tmp_path, change, where, words):
    with pytest.raises(SceneError) as caught:
        parsed(write(tmp_path, **change))
    assert caught.value.field == "directives"
    assert caught.value.message.startswith(f"{where}:")
    assert words in caught.value.message


@pytest.mark.parametrize("kind", ["vtk", "gltf", "glb", "ply"])
@pytest.mark.parametrize("change", [lambda f: {"shape": f'<mesh filename="{f}"/>'}, lambda f: sdf(shape=f"<mesh><uri>{f}</uri></mesh>")])
def test_a_collision_mesh_of_another_kind_is_refused(tmp_path, kind, change):
    (tmp_path / f"m.{kind}").write_text("")
    with pytest.raises(SceneError, match=rf":\d: 'm\.{kind}' is collision geometry.*OBJ, STL and DAE meshes are read.*convert it"):
        parsed(write(tmp_path, **change(f"m.{kind}")))


def test_a_drawn_mesh_may_be_of_another_kind(tmp_path):
    drawn = '<link name="eye"><visual><geometry><mesh filename="m.gltf"/></geometry></visual></link>'
    drawn += '<joint name="stare" type="fixed"><parent link="hand"/><child link="eye"/></joint>'
    assert parsed(write(tmp_path, more=drawn, files={"m.gltf": "{}"})).pairs


@pytest.mark.parametrize(
    "change",
    [
        {"shape": '<sphere radius=" +1.e-1 "/>'},
        {"shape": '<box size="\n.1\t0.1 1E-1"/>'},
        {"shape": '<mesh filename="t.obj" scale="2"/>', "files": {"t.obj": TETRAHEDRON}},
        {"shape": '<mesh filename="t.obj"/><drake:declare_convex/>', "files": {"t.obj": TETRAHEDRON}},
        {"shape": '<mesh filename="t.obj" scale="-1 1 2"/>', "files": {"t.obj": TETRAHEDRON}},
        {"more": '<gazebo><sensor><origin xyz="x"/><origin/></sensor></gazebo>'},
        sdf(pose=""),
        {"files": {"room.sdf": ROOM.replace("<pose>0.6 0 0.3 0 0 0</pose>", '<pose rotation_format="quat_xyzw">0.6 0 0 0 0 0 1</pose>')}},
        {"files": {"room.sdf": ROOM.replace("<pose>", '<pose degrees="true">').replace("<box>", "<!-- a wall --><box>")}},
        sdf(more='<plugin name="p" filename="p.so"><pose>x</pose><pose>y</pose></plugin>'),
        mjcf(),
        mjcf(top='<asset><mesh name="m" file="t.obj"/></asset>', geom='type="mesh" mesh="m"', **{"t.obj": TETRAHEDRON}),
        mjcf(geom='type="capsule" fromto="0 0 0 0.3 0 0" size="0.05 9"', joint='ref="20"', body='euler="0 0 90"'),
        mjcf(more='<site size="x"/>', top='<option timestep="abc"/>'),
    ],
)
def test_what_drake_reads_as_written_is_accepted(tmp_path, change):
    assert parsed(write(tmp_path, **change)).n == 1


INCLUDED = '<include><uri>{uri}</uri><pose>0 0 1 0 0 0</pose></include><joint name="j" type="fixed"><parent>walls</parent>'
INCLUDED += "<child>more::walls</child></joint>"
MORE = SDF.replace('name="room"', 'name="more"')


def test_included_models_are_followed_through_the_killable_child(tmp_path):
    path = write(tmp_path, **sdf(more=INCLUDED.format(uri="more.sdf")))
    (tmp_path / "more.sdf").write_text(MORE.format(pose=POSE, shape=BOX, more=""))
    assert load_scene(path).hash == load_bundle(pack_bundle(path)).scene.hash
    (tmp_path / "more.sdf").write_text(MORE.format(pose=POSE, shape=BOX.replace("0.1", "0x1"), more=""))
    for load in (load_scene, lambda path: load_bundle(pack_bundle(path)).scene):
        with pytest.raises(SceneError, match=r"more\.sdf:4: <size>"):
            load(path)


@pytest.mark.parametrize("name", ["more.SDF", "more.txt"])
def test_an_included_file_that_drake_would_leave_out_is_refused(tmp_path, name):
    path = write(tmp_path, **sdf(more=f"<include><uri>{name}</uri></include>"))
    (tmp_path / name).write_text(MORE.format(pose=POSE, shape=BOX, more=""))
    with pytest.raises(SceneError, match=rf"room\.sdf:5: '{name}' would be left out by Drake"):
        load_scene(path)


def test_a_model_directory_is_refused(tmp_path):
    """Drake reads the file that its model.config names."""
    (tmp_path / "thing").mkdir()
    (tmp_path / "thing" / "model.config").write_text("<model><sdf>odd.sdf</sdf></model>")
    (tmp_path / "thing" / "odd.sdf").write_text(MORE.format(pose=POSE, shape=BOX, more=""))
    path = write(tmp_path, f"packages: {{mine: .}}{SCENE}", **sdf(more="<include><uri>model://mine/thing</uri></include>"))
    with pytest.raises(SceneError, match=r"room\.sdf:5: 'model://mine/thing' is a directory .name the model's file"):
        load_scene(path)


def test_directives_of_directives_are_followed(tmp_path):
    (tmp_path / "more.txt").write_text("directives: [{add_model: {name: arm, file: package://mine/arm.urdf}}]")
    scene = "packages: {mine: .}" + SCENE.replace("add_model: {name: arm, file: arm.urdf}", "add_directives: {file: more.txt}")
    assert parsed(write(tmp_path, scene)).n == 1
    with pytest.raises(SceneError, match=r"arm\.urdf:7: radius of <sphere> is '0x10'"):
        parsed(write(tmp_path, scene, shape='<sphere radius="0x10"/>'))


def test_the_points_are_the_files_and_not_drakes(tmp_path):
    path = write(tmp_path, shape='<mesh filename="t.obj" scale="2 -3 1"/>', files={"t.obj": TETRAHEDRON})
    palm = parsed(path).geometry("arm/hand/palm")
    assert sorted((palm.vertices - [0.3, 0, 0]).round(12).tolist()) == [[0, -0.3, 0], [0, 0, 0], [0, 0, 0.1], [0.2, 0, 0]]


@pytest.mark.parametrize("name", ["ha\u00efnd", "ha  nd", "hand\u202e", "hand\\n", "hand&#10;x", "h" * 201, "hand'"])
def test_a_name_beyond_the_alphabet_is_refused(tmp_path, name):
    path = write(tmp_path)
    for old in ("hand", "turn", "palm"):
        path = write(tmp_path)
        urdf = tmp_path / "arm.urdf"
        urdf.write_text(urdf.read_text().replace(f'"{old}"', f'"{name}"'), encoding="utf-8")
        with pytest.raises(SceneError, match="ASCII letters, digits") as caught:
            parsed(path)
        assert caught.value.code == "scene_name"
        assert str(caught.value).isprintable()


def test_what_drake_prints_comes_in_one_printable_line(tmp_path):
    (said,) = (w for w in parsed(write(tmp_path, **mjcf(top='<asset><mesh name="m\u202e&#10;m"/></asset>'))).warnings if "mesh asset" in w)
    assert "m\\u202e m" in said
    assert said.isprintable()


SOLID = """<sdf version="1.9"><model name="part"><static>true</static><link name="p">
<collision name="c"><geometry><mesh><uri>{}</uri></mesh></geometry></collision></link></model></sdf>"""
INCLUDES = {
    "relative": '<model name="first"><static>true</static><include><uri>sub/part.sdf</uri></include></model>',
    "package": '<model name="first"><static>true</static><include><uri>model://here/sub/part.sdf</uri></include></model>',
    "merged": '<model name="first"><static>true</static><include merge="true"><uri>sub/part.sdf</uri></include></model>',
    "in a world": '<world name="w"><include><uri>sub/part.sdf</uri><static>true</static></include></world>',
    "in an include": '<model name="first"><static>true</static><include><uri>sub/mid.sdf</uri></include></model>',
}


def with_mesh(directory, kind, uri, more=""):
    """The path of a scene whose model includes sub/part.sdf, with a mesh beside it and a smaller one of the same name one level up."""
    (directory / "sub").mkdir()
    for place, scale in ((directory, 1), (directory / "sub", 3)):
        (place / "t.obj").write_text(TETRAHEDRON.replace("0.1", str(0.1 * scale)))
    (directory / "first.sdf").write_text(f'<sdf version="1.9">{INCLUDES[kind]}</sdf>')
    (directory / "sub" / "mid.sdf").write_text(
        '<sdf version="1.9"><model name="mid"><include><uri>model://here/sub/part.sdf</uri></include></model></sdf>'
    )
    (directory / "sub" / "part.sdf").write_text(SOLID.format(uri))
    scene = f"packages: {{here: .}}{SCENE}{more}  - add_model: {{name: first, file: first.sdf}}\n"
    return write(directory, scene)


@pytest.mark.parametrize("kind", INCLUDES)
@pytest.mark.parametrize("more", ["", "  - add_model: {name: alone, file: sub/part.sdf}\n  - add_weld: {parent: world, child: alone::p}\n"])
def test_a_mesh_of_an_included_model_that_drake_would_take_from_elsewhere_is_refused(tmp_path, kind, more):
    with pytest.raises(SceneError, match=r"sub/part\.sdf:2: 't\.obj' is beside an included model, and Drake would look") as caught:
        parsed(with_mesh(tmp_path, kind, "t.obj", more))
    assert "write model://NAME/FILE" in caught.value.hint


@pytest.mark.parametrize("kind", INCLUDES)
def test_a_mesh_of_an_included_model_may_come_from_a_package(tmp_path, kind):
    (solid,) = (g for g in parsed(with_mesh(tmp_path, kind, "package://here/sub/t.obj")).geometries if g.name.startswith("first"))
    assert np.ptp(solid.vertices, axis=0).tolist() == pytest.approx([0.3] * 3)


def test_a_mesh_of_an_included_model_may_be_relative_where_both_places_are_one(tmp_path):
    path = with_mesh(tmp_path, "relative", "t.obj")
    (tmp_path / "first.sdf").write_text((tmp_path / "first.sdf").read_text().replace("sub/part", "part"))
    (tmp_path / "part.sdf").write_text(SOLID.format("t.obj"))
    assert any(g.name.startswith("first") for g in parsed(path).geometries)


def test_a_mesh_that_no_model_names_is_not_taken(tmp_path):
    path = write(tmp_path, shape='<mesh filename="t.obj"/>', files={"t.obj": TETRAHEDRON, "other.obj": TETRAHEDRON})
    strict = StrictReader(read_scene_file(path))
    strict.check(read_scene_file(path).resolved_directives, path.name)
    assert len(strict.taken(tmp_path / "t.obj").points) == 4
    with pytest.raises(SceneError, match=r"Drake has taken another mesh than the models name: other\.obj") as caught:
        strict.taken(tmp_path / "other.obj")
    assert caught.value.code == "scene_model"


def test_urdf_in_sdformat_is_refused(tmp_path):
    """Drake places all links but the first at the origin of the URDF file."""
    path = write(tmp_path, **sdf(more="<include><uri>arm.urdf</uri></include>"))
    with pytest.raises(SceneError, match=r"room\.sdf:5: 'arm\.urdf' is URDF, whose links Drake would place elsewhere") as caught:
        parsed(path)
    assert caught.value.hint == "add it by a directive of its own"


def test_poses_that_are_too_far_away_together_are_refused(tmp_path):
    frame = "  - add_frame: {name: far, X_PF: {base_frame: world, translation: [9e5, 0, 0]}}\n"
    weld = "add_weld: {parent: far, child: room::walls, X_PC: {translation: [9e5, 0, 0]}}"
    scene = SCENE.replace("  - add_weld: {parent: world, child: room::walls}", f"{frame}  - {weld}")
    with pytest.raises(SceneError, match="joint room/far_welds_to_walls has a pose with a coordinate that is not from"):
        parsed(write(tmp_path, scene))


THIN = "<box size='1e6 1e-9 1e-9'/>"


@pytest.mark.parametrize(
    ("shape", "name", "extra"),
    [
        ('<box size="1e6 1e-9 1"/>', "palm", ""),
        ('<cylinder radius="1e-9" length="1e6"/>', "palm", ""),
        (f"{THIN}</geometry></collision><collision name='b'><geometry>{THIN}", "hull", "hulls: [arm/hand]\n"),
    ],
)
def test_a_shape_that_is_too_thin_is_refused(tmp_path, shape, name, extra):
    with pytest.raises(SceneError, match=f"geometry arm/hand/{name} is too thin for its size"):
        parsed(write(tmp_path, shape=shape, extra=extra))


PART = '<sdf version="1.9"><model name="part"><link name="p"/></model></sdf>'
WITH_PART = """<sdf version="1.9"><model name="{0}"><link name="walls"/><include><uri>{1}</uri><name>part</name></include>
  <joint name="j" type="fixed"><parent>walls</parent><child>part::{2}</child></joint></model></sdf>"""


def laid_out(directory, **files):
    """Writes files, whose names have __ for / in them, and a scene file in cell/ that adds each of the models first.sdf and second.sdf."""
    scene = SCENE.replace("arm.urdf", "../arm.urdf")
    for place, text in files.items():
        path = directory / (place.replace("__", "/") + ".sdf")
        path.parent.mkdir(exist_ok=True, parents=True)
        path.write_text(text)
        if path.stem in ("first", "second"):
            scene += f"  - add_model: {{name: {path.stem}, file: ../{path.relative_to(directory)}}}\n"
            scene += f"  - add_weld: {{parent: world, child: {path.stem}::walls}}\n"
    write(directory)
    (directory / "cell").mkdir(exist_ok=True)
    (directory / "cell" / "room.sdf").write_text(ROOM)
    (directory / "cell" / "scene.yaml").write_text(scene)
    return directory / "cell" / "scene.yaml"


def test_an_include_is_beside_the_model_and_not_beside_the_scene(tmp_path):
    path = laid_out(tmp_path, models__first=WITH_PART.format("first", "part.sdf", "p"), models__part=PART, cell__part="no model")
    scene = load_scene(path)
    assert "first::part/p" in scene.bodies
    assert scene.hash == load_bundle(pack_bundle(path)).scene.hash


def test_models_of_one_directory_may_all_include(tmp_path):
    first, second = (WITH_PART.format(name, "deep/part.sdf", "p") for name in ("first", "second"))
    path = laid_out(tmp_path, models__first=first, models__second=second, models__deep__part=PART)
    assert {"first::part/p", "second::part/p"} <= set(load_scene(path).bodies)


@pytest.mark.parametrize(
    "files",
    [
        {"one__first": WITH_PART.format("a", "part.sdf", "p"), "two__second": WITH_PART.format("b", "part.sdf", "p")},
        {"one__first": WITH_PART.format("a", "deep/mid.sdf", "walls"), "one__deep__mid": WITH_PART.format("m", "part.sdf", "p")},
    ],
)
def test_includes_that_drake_would_look_for_elsewhere_are_refused(tmp_path, files):
    """It might find another file there, or none."""
    places = {f"{directory}__part": PART for directory in ("one", "two", "one__deep", "cell")}
    with pytest.raises(SceneError, match=r"(second|mid)\.sdf:1: 'part\.sdf' is beside a model for which Drake") as caught:
        load_scene(laid_out(tmp_path, **files, **places))
    assert "write model://NAME/FILE" in caught.value.hint


def test_an_include_by_package_is_read_from_anywhere(tmp_path):
    first, mid = WITH_PART.format("a", "model://here/deep/mid.sdf", "walls"), WITH_PART.format("m", "model://here/deep/part.sdf", "p")
    path = laid_out(tmp_path, one__first=first, one__deep__mid=mid, one__deep__part=PART)
    path.write_text(f"packages: {{here: ../one}}{path.read_text()}")
    assert "first::part::part/p" in load_scene(path).bodies


def test_the_draft_of_a_model_that_includes_does_not_depend_on_its_place(tmp_path):
    model = WITH_PART.format("first", "part.sdf", "p").replace(
        "<include>", '<link name="l"/>' + TURN.format("").replace("door", "d") + "<include>"
    )
    laid_out(tmp_path, models__first=model, models__part=PART)
    drafts = [draft(tmp_path / "models" / "first.sdf", [], tmp_path / place / "scene.yaml", {}, {}) for place in ("models", "cell", ".")]
    assert len({made.scene.hash for made in drafts}) == 1
