"""Errors of what scenes are made of: models, meshes, joints and pairs."""

from __future__ import annotations

from pathlib import Path

from certifier.jobs.reference import Reference
from certifier.scene import load_scene
from certifier.scene.draft import draft
from tests.certifier.scene.workshop import LIMIT, SCENE
from tests.errors.trial import Table, Trial

D = "directives: [{add_model: {name: a, file: a.urdf}}]\n"
WELD = "{{add_weld: {{parent: world, child: a::l, X_PC: {{{}}}}}}}"
MIMIC = '<joint name="follow" type="revolute"><parent link="hand"/><child link="tip"/><axis xyz="0 0 1"/><mimic joint="turn"/>'
MIMIC += '<limit lower="-1" upper="2" effort="1" velocity="1"/></joint><link name="tip"/>'
BESIDE = MIMIC.replace('"hand"', '"base"').replace(
    '<link name="tip"/>', '<link name="tip"><collision name="pad"><geometry><sphere radius="0.01"/></geometry></collision></link>'
)
"""A body that turns beside the hand, and with it."""
APART = "ignore: [{pair: [arm/hand, arm/tip], reason: r}]"
TIP = MIMIC.replace('<mimic joint="turn"/>', "")
FREE = SCENE.replace("  - add_weld: {parent: world, child: room::walls}\n", "")
SDF_SHAPE = """<sdf version="1.7"><model name="room"><link name="walls"><collision name="wall"><geometry>{}</geometry></collision></link>
</model></sdf>"""
MOVING_PLANE = """<sdf version="1.7"><model name="arm"><link name="base"/><link name="hand"><collision name="palm">
<geometry><plane/></geometry></collision></link>
<joint name="turn" type="revolute"><parent>base</parent><child>hand</child><axis><xyz>0 0 1</xyz></axis></joint></model></sdf>"""
LID = """<sdf version="1.9"><model name="lid"><link name="frame"/><link name="floor"><collision name="plane"><geometry><plane>
<normal>0 0 1</normal></plane></geometry></collision></link><joint name="hinge" type="revolute"><parent>frame</parent>
<child>floor</child><axis><xyz>1 0 0</xyz><limit><lower>0</lower><upper>0.1</upper></limit></axis></joint></model></sdf>"""
ADDED_LID = "  - add_model: {name: lid, file: lid.sdf}\n  - add_weld: {parent: world, child: lid::frame}\n"
FAR = (
    """<robot name="r"><link name="base"/><link name="hand"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="hand"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"""
    + MIMIC.replace("<mimic ", '<mimic offset="9" ')
    + "</robot>"
)
BALL_JOINT = """<drake:joint name="b" type="ball"><parent link="hand"/><child link="ball"/></drake:joint><link name="ball"/>"""
NESTED = '<sdf version="1.9"><model name="room"><model name="shelf"><link name="board"/></model></model></sdf>'
TETRAHEDRON = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
FAR_MESH = "v 0 0 0\nv 1e7 0 0\nv 0 1e7 0\nv 0 0 1e7\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
ADDED_MESH = "  - add_model: {name: m, file: m.obj}\n  - add_weld: {parent: world, child: m::m}\n"
MUJOCO = "directives: [{add_model: {name: m, file: m.xml}}]\n"
TOO_FAR = """  - add_frame: {name: far, X_PF: {base_frame: world, translation: [9e5, 0, 0]}}
  - add_weld: {parent: far, child: room::walls, X_PC: {translation: [9e5, 0, 0]}}"""
TWICE = "directives:\n- add_model: {name: m, file: m.xml}\n"
IN_WORLD = "<mujoco><worldbody><geom name='w' size='1'/></worldbody></mujoco>"


def room(shape: str) -> dict[str, dict[str, str]]:
    return {"files": {"room.sdf": SDF_SHAPE.format(shape)}}


def linked(more: str) -> dict[str, dict[str, str]]:
    """Returns a room with more in its link."""
    return {"files": {"room.sdf": SDF_SHAPE.format("<box><size>1 1 1</size></box>").replace("</collision>", f"</collision>{more}")}}


def mjcf(body: str) -> dict[str, object]:
    return {"scene": MUJOCO, "files": {"m.xml": f"<mujoco model='m'><worldbody><body name='b'>{body}</body></worldbody></mujoco>"}}


def mesh(text: str | bytes) -> dict[str, object]:
    return {"shape": '<mesh filename="m.obj"/>', "files": {"m.obj": text}}


def drafted(t: Trial, robot: Path) -> None:
    draft(robot, [], t.directory / "scene.yaml", {}, {})


def beside(t: Trial) -> None:
    """Loads two models in two directories, each of which includes a file beside it."""
    for name in ("one", "two"):
        (t.directory / name).mkdir()
        for file, text in (
            ("a.sdf", INCLUDE.format("b.sdf")),
            ("b.sdf", '<sdf version="1.9"><model name="b"><link name="l"/></model></sdf>'),
        ):
            (t.directory / name / file).write_text(text)
    t.load("directives:\n- add_model: {name: a, file: one/a.sdf}\n- add_model: {name: b, file: two/a.sdf}\n")


def linked_away(t: Trial) -> None:
    """Loads a model by a path that goes up from a link to a directory elsewhere."""
    (t.directory / "far" / "away").mkdir(parents=True)
    (t.directory / "link").symlink_to(t.directory / "far" / "away")
    t.load(D.replace("a.urdf", "link/../a.urdf"))


def below(t: Trial) -> None:
    """Loads a model that includes one of another directory, beside which its mesh is."""
    (t.directory / "sub").mkdir()
    (t.directory / "sub" / "b.sdf").write_text(SDF_SHAPE.format("<mesh><uri>m.obj</uri></mesh>"))
    (t.directory / "sub" / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    t.scene(files={"room.sdf": INCLUDE.format("sub/b.sdf")})


def unreadable(t: Trial) -> None:
    """Loads a model whose mesh is a directory."""
    (t.directory / "m.obj").mkdir()
    t.scene(shape='<mesh filename="m.obj"/>')


INCLUDE = '<sdf version="1.7"><model name="room"><include><uri>{}</uri></include></model></sdf>'
OBJ = {
    "arm__urdf": "<robot name='arm'><link name='base'><collision><geometry><mesh filename='m.obj'/></geometry></collision></link></robot>"
}


SCENES: Table = {
    ("scene_model", "directives"): [
        linked_away,
        lambda t: t.stranger(m__obj=b"v 0\0 0 0", **OBJ),
        lambda t: t.scene(**mesh("v 0 0 \\\n0\n")),
        lambda t: t.scene(**mesh("v 0 nan 0\n")),
        lambda t: t.scene(**mesh("v 0 0 0\nf 1\n")),
        lambda t: t.scene(**mesh("v 0 0 0\nf 1 1 0\n")),
        lambda t: t.scene(**mesh("curv 0 1\n")),
        lambda t: t.scene(**mesh("v 0 0 0\nf 1 1 9\n")),
        lambda t: t.scene(**mesh("# nothing\n")),
        lambda t: t.scene(**mesh("v 0 0 0\n")),
        lambda t: t.scene(shape='<mesh filename="nothing.obj"/>'),
        lambda t: t.scene(shape='<mesh filename="m.vtk"/>'),
        unreadable,
        lambda t: t.scene(TWICE + "- add_model: {name: n, file: m.xml}\n", files={"m.xml": IN_WORLD}),
        lambda t: t.scene(files={"room.sdf": '<sdf version="1.9"><world name="w"/></sdf>'}),
        lambda t: t.scene(f"{SCENE}{ADDED_MESH}", files={"m.obj": FAR_MESH}),
        lambda t: t.scene(SCENE.replace("  - add_weld: {parent: world, child: room::walls}", TOO_FAR)),
        lambda t: t.scene(shape='<box size="1e6 1e-9 1"/>'),
        lambda t: t.load(D.replace("a.urdf", ".")),
        lambda t: t.load(D.replace("a.urdf", "a.txt") if t.write(a__txt="") else ""),
        lambda t: t.scene(files={"room.sdf": INCLUDE.format("no.sdf")}),
        lambda t: t.scene(files={"room.sdf": INCLUDE.format("arm.urdf")}),
        below,
        lambda t: t.scene(**mesh(FAR_MESH)),
        lambda t: t.scene(files={"room.sdf": INCLUDE.format(".")}),
        lambda t: t.scene(files={"room.sdf": INCLUDE.format("m.xml"), "m.xml": "<mujoco/>"}),
        beside,
        lambda t: t.scene(files={"room.sdf": INCLUDE.format("room.sdf")}),
        lambda t: t.scene(files={"room.sdf": INCLUDE.format("room.txt"), "room.txt": ""}),
        lambda t: t.scene(shape='<mesh filename="m.stl"/>'),
        lambda t: t.load(D.replace("a.urdf", "package://no/a.urdf")),
        lambda t: t.load(D),
        lambda t: drafted(t, t.write(robot__urdf=FAR)),
        lambda t: t.scene(arm="<!DOCTYPE r [<!ENTITY a 'aaa'>]><robot name='r'/>"),
        lambda t: t.scene(arm="<robot"),
        lambda t: t.scene(arm="<robot name='r\0'/>"),
    ],
    ("scene_model", ""): [lambda t: drafted(t, t.directory), lambda t: drafted(t, t.directory / "no.urdf")],
    ("scene_package", ""): [
        lambda t: drafted(t, t.write(a__urdf="<robot name='a'><link name='l'><mesh filename='package://no/m.obj'/></link></robot>"))
    ],
    ("unknown_name", "hulls[0]"): [lambda t: t.scene(extra="hulls: [elsewhere]\n")],
    ("few_parts", "hulls[0]"): [lambda t: t.scene(extra="hulls: [arm/hand]\n")],
    ("scene_field", "hulls[0]"): [
        lambda t: t.scene(extra="hulls: [arm/hand]\ndecompose: {arm/hand/palm: {threshold: 1}}\n", **mesh(TETRAHEDRON))
    ],
    ("unknown_name", "decompose.elsewhere"): [lambda t: t.scene(extra="decompose: {elsewhere: {threshold: 1}}\n")],
    ("decompose", "decompose.arm/hand/palm"): [
        lambda t: t.scene(extra="decompose: {arm/hand/palm: {threshold: 1}}\n"),
        lambda t: t.scene(extra="decompose: {arm/hand/palm: {threshold: 1}}\n", **mesh(TETRAHEDRON[: -len("f 2 3 4\n")])),
    ],
    ("scene_field", "limits.arm/turn"): [lambda t: t.scene(extra="limits: {turn: [-2, 1]}")],
    ("no_joints", "directives"): [lambda t: t.scene(extra="fix: {turn: 0}")],
    ("unknown_name", "limits.follow"): [lambda t: t.scene(more=BESIDE, extra=f"{APART}\nlimits: {{follow: [0, 1]}}")],
    ("unknown_name", "configurations.open.follow"): [
        lambda t: t.scene(more=BESIDE, extra=f"{APART}\nconfigurations: {{open: {{follow: 0}}}}")
    ],
    ("scene_field", "q_star"): [
        lambda t: t.scene(extra="q_star: [0, 0]"),
        lambda t: t.scene(more=BESIDE, extra=f"{APART}\nq_star: [0, 0]"),
    ],
    ("joint_range", "directives"): [
        lambda t: t.scene(more=MIMIC.replace("<mimic ", '<mimic offset="9" ')),
        lambda t: t.scene(limit='<limit lower="1" upper="1" effort="1" velocity="1"/>'),
        lambda t: t.scene(**mjcf("<joint name='j' type='slide'/><geom size='0.1'/>")),
    ],
    ("joint_range", "q_star"): [lambda t: t.scene(extra="q_star: [9]")],
    ("scene_field", "fix.arm/turn"): [
        lambda t: t.scene(extra="fix: {turn: 0, arm/turn: 0}"),
        lambda t: t.scene(extra="fix: {turn: 9}"),
        lambda t: t.scene(more=MIMIC.replace('upper="2"', 'upper="1"'), extra="fix: {turn: swept}"),
    ],
    ("unknown_name", "fix.turn"): [
        lambda t: t.scene(
            SCENE + "  - add_model: {name: two, file: arm.urdf}\n  - add_weld: {parent: world, child: two::base}\n",
            extra="fix: {turn: 0}",
        )
    ],
    ("unknown_name", "fix.turm"): [lambda t: t.scene(extra="fix: {turm: 0}")],
    ("unknown_name", "fix.zzz"): [lambda t: t.scene(extra="fix: {zzz: 0}")],
    ("unsupported_joint", "directives"): [
        lambda t: t.scene(more=MIMIC),
        lambda t: t.scene(more=MIMIC.replace("<mimic ", '<mimic multiplier="2" ')),
        lambda t: t.scene(more=MIMIC.replace("revolute", "prismatic")),
        lambda t: t.scene(kind="prismatic", more=MIMIC.replace("revolute", "prismatic").replace("<mimic ", '<mimic multiplier="2000" ')),
        lambda t: t.scene(more=BESIDE),
        lambda t: t.scene(more=BESIDE, extra=APART, limit=f'{LIMIT}<mimic joint="follow"/>'),
    ],
    ("unsupported_joint", ""): [lambda t: Reference(t.scene(more=BESIDE, extra=APART))],
    ("scene_field", "fix"): [
        lambda t: t.scene(more=MIMIC, extra="fix: {turn: 0, follow: 1}"),
        lambda t: t.scene(more=MIMIC, extra="fix: {turn: swept, follow: swept}"),
    ],
    ("scene_field", "fix.arm/follow"): [
        lambda t: t.scene(more=MIMIC, extra="fix: {turn: swept, follow: 1}"),
        lambda t: t.scene(more=MIMIC.replace("<mimic ", '<mimic multiplier="0" '), extra="fix: {follow: swept}"),
    ],
    ("joint_range", "fix.arm/turn"): [lambda t: t.scene(kind="continuous", limit="", extra="fix: {turn: swept}")],
    ("unsupported_joint", "fix.arm/turn"): [lambda t: t.scene(more=TIP, extra="fix: {turn: swept}")],
    ("unsupported_shape", "directives"): [
        lambda t: t.scene(SCENE.replace("arm.urdf", "arm.sdf"), files={"arm.sdf": MOVING_PLANE}),
        lambda t: t.scene(SCENE + ADDED_LID, files={"lid.sdf": LID}, extra="fix: {hinge: swept}"),
    ],
    ("scene_model_crash", "directives"): [lambda t: load_scene(t.write(scene__yaml=D, a__urdf="<robot name='a'/>"), timeout_s=1e-6)],
    ("unknown_name", "ignore[0][0]"): [
        lambda t: t.scene(extra="ignore: [[arm/hamd, room/walls]]"),
        lambda t: t.scene(extra="ignore: [[zzzzzzz, room/walls]]"),
    ],
    ("scene_name", "directives"): [
        lambda t: t.scene(more='<link name="a&#9;b"/><joint name="f" type="fixed"><parent link="hand"/><child link="a&#9;b"/></joint>'),
        lambda t: t.scene(
            more='<link name="hand/palm"/><joint name="f" type="fixed"><parent link="hand"/><child link="hand/palm"/></joint>'
        ),
    ],
    ("floating_body", "directives"): [lambda t: t.scene(FREE), lambda t: t.scene(FREE, files={"room.sdf": NESTED})],
}
