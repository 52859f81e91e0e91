"""From model files to a Scene: names, shapes, pairs; and an error that names whatever cannot be used."""

import re

import numpy as np
import pytest

from certifier.errors import SceneError
from certifier.model import JointKind, Pair
from tests.certifier.scene.workshop import ARM, BOX, LIMIT, ROOM, SCENE, parsed, write

TETRAHEDRON = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
FINGER = """<link name="finger"><collision><geometry><sphere radius="0.02"/></geometry></collision></link>
  <joint name="{name}" type="{kind}"><parent link="hand"/><child link="finger"/><origin xyz="0.3 0 0.3"/><axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/>{more}</joint>"""


def ball_mesh(count):
    """An OBJ file of points spread over a ball of radius 0.1, every three of them a face."""
    points = np.random.default_rng(0).standard_normal((count, 3))
    points *= 0.1 / np.linalg.norm(points, axis=1, keepdims=True)
    faces = "".join(f"f {i} {i + 1} {i + 2}\n" for i in range(1, count - 1))
    return "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in points.tolist()) + faces


def test_names_joints_and_pairs(tmp_path):
    scene = parsed(write(tmp_path))
    assert scene.bodies == ("world", "arm/base", "arm/hand", "room/walls")
    assert [g.name for g in scene.geometries] == ["arm/base/foot", "arm/hand/palm", "room/walls/wall"]
    assert scene.pairs == (Pair("arm/hand/palm", "room/walls/wall"),)
    (turn,) = scene.moving
    assert (turn.name, turn.kind, turn.parent, turn.child) == ("arm/turn", JointKind.REVOLUTE, "arm/base", "arm/hand")
    assert (turn.lower, turn.upper, turn.index) == (-1, 2, 0)
    np.testing.assert_array_equal(scene.q_star, [0.5])
    np.testing.assert_allclose(scene.geometry("arm/hand/palm").vertices.mean(axis=0), [0.3, 0, 0], atol=1e-15)
    assert scene.provenance["directives"] in SCENE


def test_nameless_geometries_are_told_apart(tmp_path):
    arm = ARM.replace(' name="foot"', "").replace(' name="palm"', "").format(kind="revolute", limit=LIMIT, shape=BOX, more="")
    twice = '<collision><geometry><sphere radius="0.1"/></geometry></collision>' * 2
    scene = parsed(write(tmp_path, arm=arm.replace('<link name="hand">', '<link name="hand">' + twice)))
    assert [g.name for g in scene.geometries][:4] == ["arm/base/Box", "arm/hand/Sphere", "arm/hand/Sphere_1", "arm/hand/Box"]


def test_mjcf_with_a_floor_in_the_world(tmp_path):
    arm = """<mujoco model="arm"><worldbody><geom type="plane" size="1 1 1"/>
      <body name="base" pos="0 0 0.5"><joint name="turn" type="hinge" axis="0 1 0" range="-90 45"/>
      <geom name="rod" type="capsule" fromto="0 0 0 0.3 0 0" size="0.05"/></body></worldbody></mujoco>"""
    scene = parsed(write(tmp_path, "directives: [{add_model: {name: arm, file: arm.xml}}]\n", files={"arm.xml": arm}))
    assert scene.pairs == (Pair("arm/base/rod", "world/geom0"),)
    np.testing.assert_allclose([scene.q_lower[0], scene.q_upper[0]], [-np.pi / 2, np.pi / 4])
    np.testing.assert_allclose(sorted(scene.geometry("arm/base/rod").vertices.tolist()), [[0, 0, 0], [0.3, 0, 0]], atol=1e-12)


@pytest.mark.parametrize(
    ("shape", "vertices", "radius", "exact"),
    [
        ('<box size="0.1 0.2 0.3"/>', 8, 0.0, True),
        ('<sphere radius="0.1"/>', 1, 0.1, True),
        ('<capsule radius="0.1" length="0.2"/>', 2, 0.1, True),
        ('<cylinder radius="0.1" length="0.2"/>', 10, 0.0, False),
        ('<drake:ellipsoid a="0.1" b="0.2" c="0.3"/>', 20, 0.0, False),
        ('<mesh filename="t.obj"/>', 4, 0.0, False),
        ('<mesh filename="t.obj"><drake:declare_convex/></mesh>', 4, 0.0, True),
        ('<mesh filename="ball.obj" scale="2 2 2"/>', 20, 0.0, False),
    ],
)
def test_every_shape(tmp_path, shape, vertices, radius, exact):
    mesh = ball_mesh(200)
    options = "cylinder_sides: 5\nmesh: {max_vertices: 20}\n"
    scene = parsed(write(tmp_path, shape=shape, extra=options, files={"t.obj": TETRAHEDRON, "ball.obj": mesh}))
    palm = scene.geometry("arm/hand/palm")
    assert len(palm.vertices) == vertices if "ball" not in shape else 8 <= len(palm.vertices) <= vertices
    assert palm.radius == radius
    assert (palm.substitution is None) is exact
    assert any(w.startswith("arm/hand/palm: ") for w in scene.warnings) is (palm.inflation > 0)
    assert palm.shape["X_BG"][0][3] == 0.3
    if "ball" in shape:
        assert 0 < palm.inflation < 0.2
        farthest = np.linalg.norm(palm.vertices - [0.3, 0, 0], axis=1).max()
        assert farthest - 0.2 <= palm.inflation + 1e-12


def test_a_plane_becomes_a_box_out_of_reach(tmp_path):
    plane = ROOM.replace("<box><size>0.1 1 1</size></box>", "<plane><normal>0 0 1</normal></plane>").replace("0.6 0 0.3", "0.6 0 0.1")
    scene = parsed(write(tmp_path, files={"room.sdf": plane}))
    wall = scene.geometry("room/walls/wall")
    lower, upper = wall.vertices.min(axis=0), wall.vertices.max(axis=0)
    reach = 0.3 + np.linalg.norm([0.35, 0.05, 0.05])
    assert upper[2] == pytest.approx(0.1)
    assert np.all(lower <= 1e-12 - reach)
    assert np.all(upper[:2] >= reach - 1e-12)
    assert wall.shape["kind"] == "half_space"
    assert "half-space" in wall.substitution


def test_pairs_are_sorted_and_need_a_moving_joint_between(tmp_path):
    scene = parsed(write(tmp_path, more=FINGER.format(name="grip", kind="fixed", more="")))
    assert [(p.a, p.b) for p in scene.pairs] == [
        ("arm/base/foot", "arm/finger/Sphere"),
        ("arm/finger/Sphere", "room/walls/wall"),
        ("arm/hand/palm", "room/walls/wall"),
    ]
    free = parsed(write(tmp_path, more=FINGER.format(name="grip", kind="prismatic", more="")))
    assert free.n == 2
    assert free.pairs == scene.pairs


@pytest.mark.parametrize("names", ["[arm/hand, room/walls]", "[room/walls/wall, arm/hand]", "[arm/hand/palm, room/walls/wall]"])
def test_ignored_pairs_are_kept_with_their_reason(tmp_path, names):
    scene = parsed(write(tmp_path, extra=f"ignore: [{{pair: {names}, reason: a soft wall}}]\n"))
    assert scene.pairs == ()
    assert [(i.a, i.b, i.reason) for i in scene.ignored] == [("arm/hand/palm", "room/walls/wall", "a soft wall")]
    assert any("no pair of bodies can collide" in w for w in scene.warnings)


def test_ignoring_nothing_is_remarked_on(tmp_path):
    scene = parsed(write(tmp_path, extra="ignore: [[arm/base, arm/hand]]\n"))
    assert scene.ignored == ()
    assert any("ignore[0]: arm/base and arm/hand have no pair" in w for w in scene.warnings)


def test_the_hash_is_of_the_content(tmp_path):
    scene = parsed(write(tmp_path))
    assert parsed(write(tmp_path, extra="name: other\n")).hash == scene.hash
    assert parsed(write(tmp_path, extra="padding: 0.01\n")).hash != scene.hash
    assert parsed(write(tmp_path, limit=LIMIT.replace("2", "1.9"))).hash != scene.hash


def test_remarks(tmp_path):
    drawn = ARM.format(kind="revolute", limit=LIMIT, shape=BOX, more="").replace("collision", "visual", 2)
    scene = parsed(write(tmp_path, arm=drawn.replace("0.1 0.1 0.1", "30 30 0.1"), extra="q_star: [-1.11]\n"))
    said = "\n".join(scene.warnings)
    assert "body arm/base has a visual but no collision geometry" in said
    assert "arm/hand/palm is 30 m long" in said
    assert "arm/turn comes close to q* +- pi" in said
    assert "overlap in every configuration" in said
    filtered = "  - add_collision_filter_group: {name: g, members: [arm::hand, room::walls], ignored_collision_filter_groups: [g]}\n"
    assert any("filters hide arm/hand/palm and room/walls/wall" in w for w in parsed(write(tmp_path, extra=filtered)).warnings)


def test_replacements_of_one_kind_are_one_remark(tmp_path):
    """A robot may have a hundred meshes."""
    rods = "".join(
        f'<collision name="rod{i}"><geometry><cylinder radius="{radius}" length="1"/></geometry></collision>'
        for i, radius in enumerate((0.01, 0.02))
    )
    more = f'<link name="rack">{rods}</link><joint name="on" type="fixed"><parent link="base"/><child link="rack"/></joint>'
    (said,) = [w for w in parsed(write(tmp_path, more=more)).warnings if "cylinder" in w]
    assert said == "arm/rack/rod1 and 1 more: cylinder -> circumscribed prism with 12 sides, reaching at most 0.706 mm outside"


NESTED = ROOM.replace("</link></model>", '</link><model name="shelf"><link name="board"/></model></model>')


def floating(scene=SCENE):
    return scene.replace("  - add_weld: {parent: world, child: room::walls}\n", "")


@pytest.mark.parametrize(
    ("change", "code", "field", "words"),
    [
        ({"extra": "q_star: [6]\n"}, "joint_range", "q_star", "arm/turn turns from -1 to 2 rad"),
        ({"kind": "prismatic", "limit": '<limit effort="1" velocity="1"/>'}, "joint_range", "directives", "arm/turn"),
        ({"limit": LIMIT.replace('"2"', '"-1"')}, "joint_range", "directives", "arm/turn cannot move"),
        ({"extra": "q_star: [0, 0]\n"}, "scene_field", "q_star", "2 numbers for 1 joint (in order: arm/turn)"),
        ({"kind": "fixed", "limit": ""}, "no_joints", "directives", "no joint"),
        ({"kind": "planar"}, "unsupported_joint", "directives", "arm.urdf:3: joint 'turn' is a 'planar' joint"),
        ({"kind": "planar"}, "unsupported_joint", "directives", "two slides and a turn"),
        ({"kind": "floating"}, "unsupported_joint", "directives", "arm.urdf:3: joint 'turn' is a 'floating' joint"),
        ({"scene": floating()}, "floating_body", "directives", "add_weld: {parent: world, child: room::walls}"),
        ({"files": {"room.sdf": NESTED}}, "floating_body", "directives", "X_PF: {base_frame: room::shelf::board}}, and add_weld"),
        (
            {"more": FINGER.format(name="grip", kind="revolute", more='<mimic joint="turn"/>')},
            "unsupported_joint",
            "directives",
            "arm/grip",
        ),
        ({"shape": '<mesh filename="nothing.obj"/>'}, "scene_model", "directives", "nothing.obj"),
        ({"shape": '<mesh filename="m.obj"/>', "files": {"m.obj": "rubbish\n"}}, "scene_model", "directives", "m.obj"),
        ({"shape": '<mesh filename="m.stl"/>', "files": {"m.stl": "solid\n"}}, "scene_model", "directives", "m.stl"),
        (
            {"shape": '<mesh filename="m.obj"/>', "files": {"m.obj": "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"}},
            "scene_model",
            "directives",
            "m.obj",
        ),
        ({"shape": '<cone radius="1"/>'}, "scene_model", "directives", "arm.urdf"),
        ({"shape": '<box size="1 1"/>'}, "scene_model", "directives", "instead of 3 finite decimal numbers"),
        ({"shape": '<box size="0 1 1"/>'}, "scene_model", "directives", "arm.urdf"),
        ({"limit": LIMIT.replace('"2"', '"-3"')}, "scene_model", "directives", "arm.urdf"),
        ({"limit": LIMIT.replace('"2"', '"nan"')}, "scene_model", "directives", "arm.urdf:5"),
        ({"arm": "<robot name='arm'><link"}, "scene_model", "directives", "arm.urdf:1"),
        ({"arm": "not xml"}, "scene_model", "directives", "arm.urdf"),
        ({"files": {"room.sdf": "<sdf version='1.7'><model"}}, "scene_model", "directives", "room.sdf"),
        (
            {"files": {"room.sdf": re.sub("<box>.*</box>", "<cone><radius>1</radius></cone>", ROOM)}},
            "scene_model",
            "directives",
            "room.sdf:2: <cone> in <geometry> is not read",
        ),
        ({"scene": SCENE.replace("file: arm.urdf", "file: nothing.urdf")}, "scene_model", "directives", "nothing.urdf"),
        ({"scene": SCENE.replace("add_weld", "add_wled", 1)}, "scene_model", "directives[1]", "scene.yaml:4:5"),
        ({"scene": SCENE.replace("arm::base", "arm::bass")}, "scene_model", "directives", "bass"),
        ({"scene": SCENE.replace("arm.urdf", "package://mine/arm.urdf")}, "scene_model", "directives", "mine"),
        ({"scene": SCENE.replace("arm.urdf", "package://drake_models/iiwa.urdf")}, "scene_model", "directives", "drake_models"),
        ({"scene": SCENE.replace("arm.urdf", "http://example.org/arm.urdf")}, "scene_model", "directives", "http"),
        ({"extra": "ignore: [[arm/hnad, room/walls]]\n"}, "unknown_name", "ignore[0][0]", "did you mean arm/hand"),
        ({"extra": "ignore: [[arm/hand, room/walls/wal]]\n"}, "unknown_name", "ignore[0][1]", "room/walls/wall"),
    ],
)
def test_what_cannot_be_used_is_named(tmp_path, change, code, field, words):
    with pytest.raises(SceneError) as caught:
        parsed(write(tmp_path, **change))
    error = caught.value
    assert (error.code, error.field) == (code, field), error
    assert words in str(error)
    assert "\n" not in str(error)
    assert str(tmp_path) not in str(error)


MOVING_PLANE = """<sdf version="1.7"><model name="arm"><link name="base"/><link name="hand">
  <collision name="palm"><geometry><plane/></geometry></collision></link>
  <joint name="turn" type="{kind}"><parent>base</parent><child>hand</child><axis><xyz>0 0 1</xyz>
  <limit><lower>-1</lower><upper>1</upper></limit></axis>{more}</joint></model></sdf>"""


@pytest.mark.parametrize(
    ("kind", "more", "code", "words"),
    [
        ("revolute", "", "unsupported_shape", "arm/hand/palm is a half-space on a body that moves"),
        ("ball", "", "unsupported_joint", "arm/turn is a ball joint"),
        ("universal", "<axis2><xyz>1 0 0</xyz></axis2>", "unsupported_joint", "arm/turn is a universal joint"),
        ("screw", "<screw_thread_pitch>1</screw_thread_pitch>", "unsupported_joint", "arm/turn is a screw joint"),
    ],
)
def test_what_sdf_can_say_and_we_cannot_use_is_named(tmp_path, kind, more, code, words):
    scene = SCENE.replace("arm.urdf", "arm.sdf")
    with pytest.raises(SceneError) as caught:
        parsed(write(tmp_path, scene, files={"arm.sdf": MOVING_PLANE.format(kind=kind, more=more)}))
    assert caught.value.code == code
    assert words in str(caught.value)
