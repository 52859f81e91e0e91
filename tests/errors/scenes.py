"""Errors of what scenes are made of: models, meshes, joints and pairs."""

from __future__ import annotations

from pathlib import Path

from certifier.model import ALPHABET
from certifier.scene import load_scene
from certifier.scene.draft import draft
from tests.certifier.scene.workshop import SCENE
from tests.errors.rows import Row, Trial, rows

D = "directives: [{add_model: {name: a, file: a.urdf}}]\n"
YAML = "mend the YAML there; docs/scenes.md shows a scene file"
NAMES = f"names have {ALPHABET}"
BELOW = "name a directory above it under packages, and write package://NAME/FILE"
MODEL = "name a model file: URDF, SDFormat or MJCF"
MESH = "export the mesh again"
MEND = "mend the model there"
BY_PACKAGE = "write model://NAME/FILE, and name the directory of the file as NAME under packages in the scene file"
WELD = "{{add_weld: {{parent: world, child: a::l, X_PC: {{{}}}}}}}"
NOT_YAML = "line {...}: a key must be text"

MIMIC = '<joint name="follow" type="revolute"><parent link="hand"/><child link="tip"/><axis xyz="0 0 1"/><mimic joint="turn"/>'
MIMIC += '<limit lower="-1" upper="2" effort="1" velocity="1"/></joint><link name="tip"/>'
FREE = SCENE.replace("  - add_weld: {parent: world, child: room::walls}\n", "")
SDF_SHAPE = """<sdf version="1.7"><model name="room"><link name="walls"><collision name="wall"><geometry>{}</geometry></collision></link>
</model></sdf>"""
MOVING_PLANE = """<sdf version="1.7"><model name="arm"><link name="base"/><link name="hand"><collision name="palm">
<geometry><plane/></geometry></collision></link>
<joint name="turn" type="revolute"><parent>base</parent><child>hand</child><axis><xyz>0 0 1</xyz></axis></joint></model></sdf>"""
FAR = (
    """<robot name="r"><link name="base"/><link name="hand"/>
<joint name="turn" type="revolute"><parent link="base"/><child link="hand"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"""
    + MIMIC.replace("<mimic ", '<mimic offset="9" ')
    + "</robot>"
)
BALL_JOINT = """<drake:joint name="b" type="ball"><parent link="hand"/><child link="ball"/></drake:joint><link name="ball"/>"""
ONE_MODEL = "a file is one model: name a file for each, or put them all into one <model>, in place of <world>, "
ONE_MODEL += "without its physics, lights and gui"
NESTED = '<sdf version="1.9"><model name="room"><model name="shelf"><link name="board"/></model></model></sdf>'
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
    draft(robot, [], t.directory / "scene.yaml", {})


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


SCENES: list[Row] = [
    *rows(
        "certifier/scene/draft.py",
        ("scene_model", "", "{path} is a directory", MODEL, lambda t: drafted(t, t.directory)),
        ("scene_model", "", "there is no file {path}", MODEL, lambda t: drafted(t, t.directory / "no.urdf")),
        (
            "scene_package",
            "",
            "{name} names the package {name}, which is not above it",
            "say where it is: --package {name}=DIRECTORY",
            lambda t: drafted(t, t.write(a__urdf="<robot name='a'><link name='l'><mesh filename='package://no/m.obj'/></link></robot>")),
        ),
    ),
    *rows(
        "certifier/scene/drake_model.py",
        (
            "joint_order",
            "",
            "joint {name} is not number {index} in a depth-first walk of the tree",
            "Drake numbers joints so; load the scene from its file again",
            "a scene document that was made by hand",
        ),
        (
            "unsupported_shape",
            "",
            "geometry {name} has a radius and {...} vertices; Drake can round at most two",
            "",
            "a scene document that was made by hand",
        ),
    ),
    *rows(
        "certifier/scene/hull.py",
        (
            "hull",
            "mesh.max_vertices",
            "no polytope of {max_vertices} vertices was found around a mesh of {...} points",
            "raise it, or simplify the mesh",
            "no mesh is known for which none is found",
        ),
    ),
    *rows(
        "certifier/scene/hulls.py",
        (
            "unknown_name",
            "hulls[{k}]",
            "the scene has no body {body}",
            "`ciris scene check` lists the geometries, whose names begin with their bodies",
            lambda t: t.scene(extra="hulls: [elsewhere]\n"),
        ),
        (
            "few_parts",
            "hulls[{k}]",
            "{body} must have two or more boxes, cylinders and meshes; it has {...}",
            "leave it out of hulls",
            lambda t: t.scene(extra="hulls: [arm/hand]\n"),
        ),
    ),
    *rows(
        "certifier/scene/joints.py",
        (
            "scene_field",
            "limits.{name}",
            "{lower} to {upper} is not within the joint's own limits, {own_lower} to {own_upper}",
            "scene files can only make limits narrower",
            lambda t: t.scene(extra="limits: {turn: [-2, 1]}"),
        ),
        (
            "no_joints",
            "directives",
            "no joint of the scene can move, so there is no configuration space",
            "add a model with joints, or hold fewer of them by fix",
            lambda t: t.scene(extra="fix: {turn: 0}"),
        ),
        (
            "scene_field",
            "q_star",
            "has {...} numbers for {...} joints",
            "in order: {names}",
            lambda t: t.scene(extra="q_star: [0, 0]"),
        ),
        (
            "joint_range",
            "directives",
            "joint {name} cannot move: its limits are {lower} and {upper}",
            "hold it by fix: {{name}: {lower}}",
            lambda t: t.scene(limit='<limit lower="1" upper="1" effort="1" velocity="1"/>'),
        ),
        (
            "joint_range",
            "directives",
            "joint {name} has no finite limits",
            "give it some by limits: {{name}: [LOWER, UPPER]}",
            lambda t: t.scene(**mjcf("<joint name='j' type='slide'/><geom size='0.1'/>")),
        ),
        (
            "joint_range",
            "q_star",
            "joint {name} turns from {lower} to {upper} rad, and q* = {center} is more than 170 degrees away",
            "move q_star into the joint's limits",
            lambda t: t.scene(extra="q_star: [9]"),
        ),
        (
            "scene_field",
            "fix.{name}",
            "joint {full} is named twice",
            "leave one of them out",
            lambda t: t.scene(extra="fix: {turn: 0, arm/turn: 0}"),
        ),
        (
            "unknown_name",
            "fix.{name}",
            "{name} {what}",
            "write model/joint",
            lambda t: t.scene(
                SCENE + "  - add_model: {name: two, file: arm.urdf}\n  - add_weld: {parent: world, child: two::base}\n",
                extra="fix: {turn: 0}",
            ),
        ),
        ("unknown_name", "fix.{name}", "{name} {what}", "did you mean {...}?", lambda t: t.scene(extra="fix: {turm: 0}")),
        ("unknown_name", "fix.{name}", "{name} {what}", "joints: {...}", lambda t: t.scene(extra="fix: {zzz: 0}")),
        (
            "scene_field",
            "fix.{name}",
            "{value} is not within the joint's limits, {lower} to {upper}",
            "hold it within them",
            lambda t: t.scene(extra="fix: {turn: 9}"),
        ),
        (
            "unsupported_joint",
            "directives",
            "joints {names} are coupled (mimic), and none is held",
            "hold one of them, as in fix: {{...}: 0}; the other follows",
            lambda t: t.scene(more=MIMIC),
        ),
        (
            "scene_field",
            "fix",
            "joints {names} are coupled (mimic), and cannot be held at these positions",
            "hold one of them; the other follows",
            lambda t: t.scene(more=MIMIC, extra="fix: {turn: 0, follow: 1}"),
        ),
    ),
    *rows(
        "certifier/scene/load.py",
        (
            "scene_model_crash",
            "directives",
            "reading the models of {name} failed: {message}",
            "look for files that include themselves, broken shapes or meshes",
            lambda t: load_scene(t.write(scene__yaml=D, a__urdf="<robot name='a'/>"), timeout_s=1e-6),
        ),
    ),
    *rows(
        "certifier/scene/obj.py",
        (
            "scene_model",
            "directives",
            "the line holds a zero byte; OBJ files are text",
            MESH,
            lambda t: t.stranger(m__obj=b"v 0\0 0 0", **OBJ),
        ),
        (
            "scene_model",
            "directives",
            "the line goes on behind a backslash, which readers take differently",
            "put it on one line",
            lambda t: t.scene(**mesh("v 0 0 \\\n0\n")),
        ),
        (
            "scene_model",
            "directives",
            "{...} is not a vertex",
            "write v and three finite decimal numbers",
            lambda t: t.scene(**mesh("v 0 nan 0\n")),
        ),
        (
            "scene_model",
            "directives",
            "{...} is not a face",
            "write f and the numbers of three or more vertices",
            lambda t: t.scene(**mesh("v 0 0 0\nf 1\n")),
        ),
        ("scene_model", "directives", "{...} names a vertex that does not exist", MESH, lambda t: t.scene(**mesh("v 0 0 0\nf 1 1 0\n"))),
        (
            "scene_model",
            "directives",
            "{...} is not a statement of a polygon mesh",
            "export the mesh as polygons",
            lambda t: t.scene(**mesh("curv 0 1\n")),
        ),
        ("scene_model", "directives", "the face names vertex {farthest} of {...}", MESH, lambda t: t.scene(**mesh("v 0 0 0\nf 1 1 9\n"))),
        ("scene_model", "directives", "the file has no vertices", MESH, lambda t: t.scene(**mesh("# nothing\n"))),
        ("scene_model", "directives", "the file has no faces", MESH, lambda t: t.scene(**mesh("v 0 0 0\n"))),
    ),
    *rows(
        "certifier/scene/pairs.py",
        (
            "unknown_name",
            "{field}[{k}]",
            "{name} is neither a body nor a geometry of the scene",
            "did you mean {...}?",
            lambda t: t.scene(extra="ignore: [[arm/hamd, room/walls]]"),
        ),
        (
            "unknown_name",
            "{field}[{k}]",
            "{name} is neither a body nor a geometry of the scene",
            "`ciris scene show` and `scene check` list them",
            lambda t: t.scene(extra="ignore: [[zzzzzzz, room/walls]]"),
        ),
    ),
    *rows(
        "certifier/scene/parse.py",
        (
            "unsupported_shape",
            "directives",
            "{...}",
            "use a primitive or a mesh",
            "geometry that Drake leaves out and the strict readers take; none is known",
        ),
        (
            "scene_model",
            "directives",
            "{models}{message}",
            "mend the model or the directive",
            lambda t: t.scene(shape='<mesh filename="nothing.obj"/>'),
        ),
        (
            "scene_model",
            "directives",
            "{models}{message}",
            "geometries in the world, outside of bodies, have one name each; put them into a body, or rename them in one file",
            lambda t: t.scene(TWICE + "- add_model: {name: n, file: m.xml}\n", files={"m.xml": IN_WORLD}),
        ),
        (
            "scene_model",
            "directives",
            "{models}{message}",
            ONE_MODEL,
            lambda t: t.scene(files={"room.sdf": '<sdf version="1.9"><world name="w"/></sdf>'}),
        ),
        (
            "unsupported_joint",
            "directives",
            "joint {name} is a {...} joint; revolute, prismatic and fixed joints are supported",
            "replace it by such joints, or weld its bodies",
            "a joint that the strict readers take, and that is no such joint; none is known",
        ),
        (
            "unsupported_joint",
            "directives",
            "joint {name} is a {...} joint; revolute, prismatic and fixed joints are supported",
            "write two slides and a turn, as docs/scenes.md does for a mobile base",
            "a planar joint that the strict readers take; none is known",
        ),
        (
            "unsupported_joint",
            "directives",
            "the models close a loop by a constraint",
            "remove it; only independent joints are supported",
            "a model with a ball constraint",
        ),
        (
            "unsupported_shape",
            "directives",
            "geometry {name} is a half-space on a body that moves",
            "use a box",
            lambda t: t.scene(SCENE.replace("arm.urdf", "arm.sdf"), files={"arm.sdf": MOVING_PLANE}),
        ),
        (
            "unsupported_shape",
            "directives",
            "geometry {name} is a {__name__}, which is not supported",
            "use a primitive or a mesh",
            "a shape that Drake is yet to have",
        ),
        (
            "scene_model",
            "directives",
            "a coordinate of {...} is above {MAGNITUDE} m",
            "mend the file or the scale",
            lambda t: t.scene(f"{SCENE}{ADDED_MESH}", files={"m.obj": FAR_MESH}),
        ),
        (
            "scene_model",
            "directives",
            "joint {name} has a pose with a coordinate that is not from {...} to {MAGNITUDE} m",
            "mend the pose in the directive or in the model",
            lambda t: t.scene(SCENE.replace("  - add_weld: {parent: world, child: room::walls}", TOO_FAR)),
        ),
        (
            "scene_model",
            "directives",
            "geometry {name} is too thin for its size and for its distance from the origin of its body",
            "make it thicker, or move its body's origin to it",
            lambda t: t.scene(shape='<box size="1e6 1e-9 1"/>'),
        ),
    ),
    *rows(
        "certifier/scene/names.py",
        (
            "scene_name",
            "directives",
            "the {what} {...} has a name that is not accepted",
            NAMES,
            lambda t: t.scene(more='<link name="a&#9;b"/><joint name="f" type="fixed"><parent link="hand"/><child link="a&#9;b"/></joint>'),
        ),
        (
            "scene_name",
            "directives",
            "{...} and {owner} would both be called {name}",
            "rename one of them in its model; names are made of the model's, the body's and the geometry's, with / between them",
            lambda t: t.scene(
                more='<link name="hand/palm"/><joint name="f" type="fixed"><parent link="hand"/><child link="hand/palm"/></joint>'
            ),
        ),
    ),
    *rows(
        "certifier/scene/census.py",
        (
            "scene_geometries",
            "directives",
            "the model files have {written} collision geometries, and Drake has read {read}",
            "find the one that Drake leaves out or makes up, and write it otherwise; docs/scenes.md says what is read of a model",
            "Drake leaves out a collision geometry that is read of its file",
        ),
        (
            "scene_geometries",
            "directives",
            "Drake has read {read} collision geometries, and the scene must have each of them; it has {kept}",
            "report this with the models: it is a fault of ciris",
            "ciris loses a geometry",
        ),
    ),
    *rows(
        "certifier/scene/strict.py",
        (
            "scene_model",
            "directives",
            "{...} is a directory",
            "name a model file in it",
            lambda t: t.load(D.replace("a.urdf", ".")),
        ),
        (
            "scene_model",
            "directives",
            "{...} is no model",
            "models end in {...}",
            lambda t: t.load(D.replace("a.urdf", "a.txt") if t.write(a__txt="") else ""),
        ),
        (
            "scene_model",
            "directives",
            "is no file that was found",
            f"a relative path starts at the directory of the model; or {BY_PACKAGE}",
            lambda t: t.scene(files={"room.sdf": INCLUDE.format("no.sdf")}),
        ),
        (
            "scene_model",
            "directives",
            "is URDF, whose links Drake would place elsewhere if SDFormat includes it",
            "add it by a directive of its own",
            lambda t: t.scene(files={"room.sdf": INCLUDE.format("arm.urdf")}),
        ),
        (
            "scene_model",
            "directives",
            "is beside an included model, and Drake would look beside the model that includes it",
            BY_PACKAGE,
            below,
        ),
        (
            "scene_model",
            "directives",
            "has a coordinate of {reach} m; at most {MAGNITUDE} m is read",
            "mend the file or the scale",
            lambda t: t.scene(**mesh(FAR_MESH)),
        ),
        (
            "scene_model",
            "directives",
            "Drake has taken another mesh than the models name: {...}",
            BY_PACKAGE,
            "a version of Drake that finds meshes in other places",
        ),
        (
            "scene_model",
            "directives",
            "is a directory",
            "name the model's file in it",
            lambda t: t.scene(files={"room.sdf": INCLUDE.format(".")}),
        ),
        (
            "scene_model",
            "directives",
            "is MJCF, which Drake would place in the world and not in the model",
            "add it by a directive of its own",
            lambda t: t.scene(files={"room.sdf": INCLUDE.format("m.xml"), "m.xml": "<mujoco/>"}),
        ),
        (
            "scene_model",
            "directives",
            "is beside a model for which Drake would look in another directory",
            BY_PACKAGE,
            beside,
        ),
        (
            "scene_model",
            "directives",
            "{...} includes itself, or a file that includes it",
            "remove the circle",
            lambda t: t.scene(files={"room.sdf": INCLUDE.format("room.sdf")}),
        ),
        (
            "scene_model",
            "directives",
            "would be left out by Drake",
            "models that can be included end in {...}",
            lambda t: t.scene(files={"room.sdf": INCLUDE.format("room.txt"), "room.txt": ""}),
        ),
        (
            "scene_model",
            "directives",
            "{what} is collision geometry, and of that only OBJ meshes are read",
            "convert it to OBJ; meshes that are only drawn may be of another kind",
            lambda t: t.scene(shape='<mesh filename="m.stl"/>'),
        ),
        (
            "scene_model",
            "directives",
            "{...} is no model",
            "models end in {...}",
            lambda t: t.load(D.replace("a.urdf", "a.txt") if t.write(a__txt="") else ""),
        ),
        (
            "scene_model",
            "directives",
            "{where}: {message}",
            "{hint}",
            lambda t: t.load(D.replace("a.urdf", "package://no/a.urdf")),
        ),
        (
            "scene_model",
            "directives",
            "{where}: there is no file {...}",
            "a relative path starts at the directory of the scene file, and that of package://NAME/FILE at the package",
            lambda t: t.load(D),
        ),
    ),
    *rows(
        "certifier/scene/mimics.py",
        (
            "scene_model",
            "directives",
            "joint {joint} follows {leader}, as {factor} times its position plus {offset}; no position of {leader} has it and all other "
            "joints that follow within their limits, for {joint} {...} to {...}",
            "mend the limits, the multiplier or the offset in the model",
            lambda t: drafted(t, t.write(robot__urdf=FAR)),
        ),
    ),
    *rows(
        "certifier/scene/tree.py",
        (
            "loop",
            "directives",
            "joint {name} closes a loop of joints",
            "remove a joint of the loop; only trees are supported",
            "a loop that Drake takes",
        ),
        (
            "floating_body",
            "directives",
            "body {body} is not attached to anything",
            "weld it: add_weld: {parent: world, child: {drake_name}}",
            lambda t: t.scene(FREE),
        ),
        (
            "floating_body",
            "directives",
            "body {body} is not attached to anything",
            "weld a frame of it: {frame}, and add_weld: {parent: world, child: {outer}::stands}",
            lambda t: t.scene(FREE, files={"room.sdf": NESTED}),
        ),
    ),
    *rows(
        "certifier/scene/xml.py",
        (
            "scene_model",
            "directives",
            "{name}:{CurrentLineNumber}: the file declares a document type or entity",
            "remove it, and write out what the entities stand for",
            lambda t: t.scene(arm="<!DOCTYPE r [<!ENTITY a 'aaa'>]><robot name='r'/>"),
        ),
        ("scene_model", "directives", "{name}:{lineno}: this is not XML: {...}", "mend the file there", lambda t: t.scene(arm="<robot")),
    ),
]
INCLUDE = '<sdf version="1.7"><model name="room"><include><uri>{}</uri></include></model></sdf>'
OBJ = {
    "arm__urdf": "<robot name='arm'><link name='base'><collision><geometry><mesh filename='m.obj'/></geometry></collision></link></robot>"
}
