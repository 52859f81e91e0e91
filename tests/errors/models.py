"""Errors of model files: URDF, SDFormat and MJCF, as certifier/scene/formats/ reads them."""

from __future__ import annotations

from tests.certifier.scene.workshop import BOX, LIMIT
from tests.errors.rows import rows
from tests.errors.scenes import BALL_JOINT, MEND, MUJOCO, linked, room
from tests.errors.scenes import mjcf as body

EXPAND = "expand the file with xacro first: xacro FILE > robot.urdf"
RANGE = "mend the number; lengths are in metres"
LINK = "<link name='more'/><joint name='{}' type='fixed'><parent link='{}'/><child link='{}'/></joint>"
ZERO_AXIS = "<joint name='j' type='continuous'><parent link='hand'/><child link='l'/><axis xyz='0 0 0'/>"


def turn(limit: str) -> dict[str, str]:
    return {"limit": f"<limit {limit}/>"}


PAIR = "<contact><pair geom1='a' geom2='a'/></contact>"


def model(text: str) -> dict[str, object]:
    return {"scene": MUJOCO, "files": {"m.xml": f"<mujoco model='m'>{text}</mujoco>"}}


FORMATS = [
    *rows(
        "certifier/scene/formats/model_file.py",
        (
            "scene_model",
            "directives",
            "the limits of a joint are {lower} and {upper}; the lower one must not be greater",
            MEND,
            lambda t: t.scene(limit='<limit lower="2" upper="-1" effort="1" velocity="1"/>'),
        ),
        (
            "scene_model",
            "directives",
            "{what} is {...} instead of {...}",
            MEND,
            lambda t: t.scene(shape='<sphere radius="1,5"/>'),
        ),
        (
            "scene_model",
            "directives",
            "{what} has {wrong} in it, and its magnitude must be {allowed}",
            RANGE,
            lambda t: t.scene(shape='<sphere radius="1e-300"/>'),
        ),
        (
            "scene_model",
            "directives",
            "{what} has the length {length}; it must be {DIRECTION}, best 1",
            MEND,
            lambda t: t.scene(limit=f"{LIMIT}</joint><link name='l'/>{ZERO_AXIS}"),
        ),
        (
            "scene_model",
            "directives",
            "<geometry> has more than one shape, and Drake would read one",
            MEND,
            lambda t: t.scene(shape='<sphere radius="0.1"/><box size="9 9 9"/>'),
        ),
        (
            "scene_model",
            "directives",
            "<{name}> has a second <{name}>, and Drake would read the first",
            MEND,
            lambda t: t.scene(shape='<box size="1 1 1"/><box size="9 9 9"/>'),
        ),
    ),
    *rows(
        "certifier/scene/formats/urdf.py",
        *(
            ("scene_model", "directives", message, EXPAND, provoke)
            for message, provoke in (
                ("<{name}> is a macro that was not expanded", lambda t: t.scene(more="<xacro:gripper/>")),
                ("{key} of <{name}> is {...}, which was not expanded", lambda t: t.scene(more="<link name='${name}'/>")),
            )
        ),
        (
            "scene_model",
            "directives",
            "<{name}> in <{parent}> is not read",
            "<{name}> belongs in <{...}>",
            lambda t: t.scene(more="<material><collision/></material>"),
        ),
        (
            "scene_model",
            "directives",
            "<{name}>: {why}",
            "take it out; only independent joints are supported",
            lambda t: t.scene(more="<drake:ball_constraint/>"),
        ),
        ("scene_model", "directives", "<{name}> is not known {where}", "did you mean {...}?", lambda t: t.scene(more="<lnik/>")),
        ("scene_model", "directives", "<{name}> is not known {where}", "known in <{parent}>: {...}", lambda t: t.scene(more="<group/>")),
        (
            "scene_model",
            "directives",
            "<{name}> is not known {where}",
            "take it out",
            lambda t: t.scene(shape="<box size='1 1 1'><x/></box>"),
        ),
        ("scene_model", "directives", "<{name}> is not known {where}", "<{name}> belongs in <{...}>", lambda t: t.scene(more=BOX)),
        (
            "scene_model",
            "directives",
            "{key} of <{name}>: {why}",
            "write the rotation as rpy",
            lambda t: t.scene(more="<link name='l'><collision><origin quat_xyzw='0 0 0 1'/></collision></link>"),
        ),
        (
            "scene_model",
            "directives",
            "{key} of <{name}>: {why}",
            "take the attribute out, or the element",
            lambda t: t.scene(more="<link name='l' drake_ignore='true'/>"),
        ),
        (
            "scene_model",
            "directives",
            "{key} is not known in <{name}>",
            "did you mean {...}?",
            lambda t: t.scene(shape=BOX.replace("s", "z")),
        ),
        (
            "scene_model",
            "directives",
            "{key} is not known in <{name}>",
            "known attributes: {...}",
            lambda t: t.scene(shape="<sphere thick='1'/>"),
        ),
        ("scene_model", "directives", "<{name}> has no {key}", MEND, lambda t: t.scene(shape="<sphere/>")),
        (
            "scene_model",
            "directives",
            "<{name}> holds the text {...}, which is not read",
            MEND,
            lambda t: t.scene(shape=f"0.1 {BOX}"),
        ),
        ("scene_model", "directives", "{what} must be positive, and is {...}", MEND, lambda t: t.scene(shape='<sphere radius="0"/>')),
        (
            "scene_model",
            "directives",
            "the name of <collision> is empty",
            "give it a name of its own, or leave name out",
            lambda t: t.scene(more=f"<link name='l'><collision name=''><geometry>{BOX}</geometry></collision></link>"),
        ),
        (
            "scene_model",
            "directives",
            "<origin> in <link> is not read",
            "<origin> belongs in {...}",
            lambda t: t.scene(more="<link name='l'><origin xyz='0 0 1'/></link>"),
        ),
        ("scene_model", "directives", "<{name}> has no <{name}>", MEND, lambda t: t.scene(more="<link name='l'><collision/></link>")),
        ("scene_model", "directives", "<geometry> has no shape", "shapes: {...}", lambda t: t.scene(shape="")),
        (
            "scene_model",
            "directives",
            "a second {...} is called {...}; the first is in line {line}",
            "rename one of them",
            lambda t: t.scene(more="<link name='hand'/>"),
        ),
        *(
            ("unsupported_joint", "directives", "joint {...} is a {...} joint; {...} are supported", hint, provoke)
            for hint, provoke in (
                ("leave the joint out, and weld its child by add_weld in the scene file", lambda t: t.scene(kind="floating")),
                ("write two slides and a turn, as docs/scenes.md does for a mobile base", lambda t: t.scene(kind="planar")),
                ("replace it by joints that turn or slide, or weld its bodies", lambda t: t.scene(more=BALL_JOINT)),
                ("did you mean {...}?", lambda t: t.scene(kind="Revolute")),
                ("supported: {...}", lambda t: t.scene(kind="xyz")),
            )
        ),
        (
            "scene_model",
            "directives",
            "link {name} is the child of another joint too, in line {line}",
            "only trees are supported",
            lambda t: t.scene(more=LINK.format("j", "base", "hand")),
        ),
        (
            "scene_model",
            "directives",
            "the <limit> of a revolute joint has no {key}",
            "write lower and upper in radians, or make the joint continuous",
            lambda t: t.scene(**turn("upper='1'")),
        ),
        (
            "scene_model",
            "directives",
            "<{name}> names the {what} {...}, which is not in the file",
            "did you mean {...}?",
            lambda t: t.scene(more=LINK.format("j", "hnad", "more")),
        ),
        (
            "scene_model",
            "directives",
            "<{name}> names the {what} {...}, which is not in the file",
            "the file has {...} {what}s",
            lambda t: t.scene(more=LINK.format("j", "qqqq", "more")),
        ),
    ),
    *rows(
        "certifier/scene/formats/sdf.py",
        (
            "scene_model",
            "directives",
            "<{name}> must be positive, and Drake would read another number",
            MEND,
            lambda t: t.scene(**room("<sphere><radius>0</radius></sphere>")),
        ),
        (
            "scene_model",
            "directives",
            "<{name}> has no <{missing}>, and Drake would make one up",
            MEND,
            lambda t: t.scene(**room("<sphere></sphere>")),
        ),
        (
            "scene_model",
            "directives",
            "<{name}> holds more than text, and Drake would read a part of it",
            MEND,
            lambda t: t.scene(**room("<sphere><radius>1<!-- --> 5</radius></sphere>")),
        ),
        *(
            ("scene_model", "directives", message, hint, provoke)
            for message, hint, provoke in [
                ("<{name}> is not known in <{parent}>", "did you mean {...}?", lambda t: t.scene(**linked("<colision/>"))),
                ("<{name}> is not known in <{parent}>", "known there: {...}", lambda t: t.scene(**linked("<zzz/>"))),
                ("the attribute {...} of <{name}> is not known", "did you mean {...}?", lambda t: t.scene(**linked("<pose degres='1'/>"))),
                ("the attribute {...} of <{name}> is not known", "known there: {...}", lambda t: t.scene(**linked("<pose zzz='1'/>"))),
                ("<{name}> in <{parent}> is not read", "{...}", lambda t: t.scene(**room("<cone/>"))),
                ("<{name}> holds the text {...}, which nobody reads", MEND, lambda t: t.scene(**linked("1 2 3"))),
                (
                    "a second <{name}> is called {...}",
                    "give each its own name",
                    lambda t: t.scene(**linked("</link><link name='walls'>")),
                ),
                (
                    "<{name}> in <{place}> is not read",
                    "write it outside of what SDFormat does not know",
                    lambda t: t.scene(**linked("<my:data><collision/></my:data>")),
                ),
                ("<mesh> has no <uri>", MEND, lambda t: t.scene(**room("<mesh/>"))),
                ("<collision> has no <geometry>", MEND, lambda t: t.scene(**linked("<collision name='x'/>"))),
                ("<geometry> has no shape; <empty/> would say that there is none", MEND, lambda t: t.scene(**room(""))),
                (
                    "<joint> has an <axis2>, which its type does not have",
                    MEND,
                    lambda t: t.scene(**linked("</link><joint name='j' type='fixed'><axis2/></joint><link name='z'>")),
                ),
                (
                    "{key} of <{name}> is {...}",
                    "did you mean {...}?",
                    lambda t: t.scene(**linked("</link><joint name='j' type='revolut'/><link name='z'>")),
                ),
                (
                    "{key} of <{name}> is {...}",
                    "known: {...}",
                    lambda t: t.scene(**linked("</link><joint name='j' type=''/><link name='z'>")),
                ),
                (
                    "{what} is {...} instead of true or false",
                    MEND,
                    lambda t: t.scene(**linked("</link><static>yes</static><link name='z'>")),
                ),
                (
                    "{what} is true, and Drake does not read it",
                    "say by joints what holds the link",
                    lambda t: t.scene(**linked("<kinematic>true</kinematic>")),
                ),
                (
                    "rotation_format of <pose> is {...}",
                    "known: {...}",
                    lambda t: t.scene(**linked("<pose rotation_format='quat_wxyz'>0 0 0 1 0 0 0</pose>")),
                ),
                (
                    "SDFormat 1.7 and later have no frame of <pose>",
                    "write relative_to",
                    lambda t: t.scene(**linked("<pose frame='x'/>")),
                ),
                (
                    "the quaternion of <pose> has the length {...} instead of 1, and Drake would not make it 1",
                    "write more digits, or roll, pitch and yaw with degrees",
                    lambda t: t.scene(**linked("<pose rotation_format='quat_xyzw'>0 0 0 0 0 0 0</pose>")),
                ),
            ]
        ),
    ),
    *rows(
        "certifier/scene/formats/mjcf_tree.py",
        ("scene_model", "directives", "{key} of <{name}> is {...} instead of {...}", MEND, lambda t: t.scene(**body("<geom size='1,5'/>"))),
        (
            "scene_model",
            "directives",
            "<include> must have the attribute file and nothing else",
            MEND,
            lambda t: t.scene(**model("<include/>")),
        ),
        (
            "scene_model",
            "directives",
            "{...} is no file that was found",
            "paths start at the directory of the model's first file, also in files that it includes",
            lambda t: t.scene(**model("<include file='x.xml'/>")),
        ),
        (
            "scene_model",
            "directives",
            "{...} is included twice, which MuJoCo does not accept",
            MEND,
            lambda t: t.scene(**model("<include file='m.xml'/>")),
        ),
    ),
    *rows(
        "certifier/scene/formats/mjcf_names.py",
        (
            "scene_model",
            "directives",
            "the model begins with <{...}> instead of <mujoco>",
            MEND,
            lambda t: t.scene(scene=MUJOCO, files={"m.xml": "<mujocoinclude/>"}),
        ),
        ("scene_model", "directives", "<{name}> in <{name}> is refused: {...}", MEND, lambda t: t.scene(**body("<frame/>"))),
        (
            "scene_model",
            "directives",
            "<{...}> in <{name}> is not known",
            "did you mean geom?",
            lambda t: t.scene(**body("<goem size='1'/>")),
        ),
        ("scene_model", "directives", "{key} of <{name}> is refused: {...}", MEND, lambda t: t.scene(**body("<geom fitscale='1'/>"))),
        (
            "scene_model",
            "directives",
            "{...} of <{name}> is not known",
            "did you mean {...}?",
            lambda t: t.scene(**body("<geom siez='1'/>")),
        ),
    ),
    *rows(
        "certifier/scene/formats/mjcf_defaults.py",
        (
            "scene_model",
            "directives",
            "{key} comes from a class around {...}, which has no <{name}>: Drake does not look there",
            'write <{name}/> into <default class="{...}">',
            lambda t: t.scene(**model("<default><geom type='box'/><default class='c'/></default><worldbody><geom class='c'/></worldbody>")),
        ),
        (
            "scene_model",
            "directives",
            "the class of the outer <default> is {...}, and MuJoCo calls it main",
            "put a <default> around it",
            lambda t: t.scene(**model("<default class='c'/>")),
        ),
        (
            "scene_model",
            "directives",
            "a <default> in another one must have a class of its own, and {...} is none",
            MEND,
            lambda t: t.scene(**model("<default><default/></default>")),
        ),
        (
            "scene_model",
            "directives",
            "the class {...} has a second <{name}>, and Drake would read only this one",
            MEND,
            lambda t: t.scene(**model("<default><geom/><geom/></default>")),
        ),
        (
            "scene_model",
            "directives",
            "the class {...} is not known",
            "did you mean {...}?",
            lambda t: t.scene(**body("<geom class='mains'/>")),
        ),
    ),
    *rows(
        "certifier/scene/formats/mjcf_bodies.py",
        (
            "scene_model",
            "directives",
            "zaxis is so near to -z that Drake turns it about another axis than MuJoCo",
            "write it as quat",
            lambda t: t.scene(**body("<geom zaxis='1e-8 0 -1'/>")),
        ),
        (
            "scene_model",
            "directives",
            "<{name}> has {...}, and only one orientation is read",
            MEND,
            lambda t: t.scene(**body("<geom quat='1 0 0 0' euler='0 0 0'/>")),
        ),
        (
            "scene_model",
            "directives",
            "the limits of a joint are {lower} and {upper}; the lower one must be less",
            MEND,
            lambda t: t.scene(**body("<joint range='1 1'/>")),
        ),
        (
            "scene_model",
            "directives",
            "a joint of the type {...} is not read",
            "write a body with a hinge for each of its axes",
            lambda t: t.scene(**body("<joint type='ball'/>")),
        ),
        (
            "scene_model",
            "directives",
            "a joint of the type {...} is not read",
            "types that are read: hinge, slide, free",
            lambda t: t.scene(**body("<joint type='revolute'/>")),
        ),
        (
            "scene_model",
            "directives",
            "limited is {...}, and must be true, false or auto",
            MEND,
            lambda t: t.scene(**body("<joint limited='yes'/>")),
        ),
        ("scene_model", "directives", "the joint is limited and has no range", MEND, lambda t: t.scene(**body("<joint limited='true'/>"))),
        (
            "scene_model",
            "directives",
            "the joint has a range and autolimits is false, so it must say whether it is limited",
            MEND,
            lambda t: t.scene(**model("<compiler autolimits='false'/><worldbody><body><joint range='0 1'/></body></worldbody>")),
        ),
        (
            "scene_model",
            "directives",
            "mocap of <body> is refused: Drake does not read it",
            "remove it, and weld the body where it stands",
            lambda t: t.scene(**model("<worldbody><body mocap='true'/></worldbody>")),
        ),
        (
            "scene_model",
            "directives",
            "the body {...} has several joints and a pose that {what}, which Drake puts behind all joints but the last",
            "write a body for each joint: the outer one has the pose and the first joint, and each of the others is in the one before",
            lambda t: t.scene(**model("<worldbody><body pos='1 0 0'><joint/><joint/></body></worldbody>")),
        ),
        (
            "scene_model",
            "directives",
            "a body with a free joint must have no other joint",
            MEND,
            lambda t: t.scene(**body("<joint/><freejoint/>")),
        ),
        (
            "scene_model",
            "directives",
            "a free joint is only read in a body of <worldbody>",
            MEND,
            lambda t: t.scene(**body("<body><freejoint/></body>")),
        ),
        (
            "scene_model",
            "directives",
            "align of <freejoint> is refused: MuJoCo moves the body's frame, and Drake does not",
            "remove it",
            lambda t: t.scene(**body("<freejoint align='true'/>")),
        ),
        (
            "scene_model",
            "directives",
            "{key} of <{name}> has {wrong} in it, and its magnitude must be {...}",
            RANGE,
            lambda t: t.scene(**body("<geom size='1' pos='1e90 0 0'/>")),
        ),
        (
            "scene_model",
            "directives",
            "the axes in xyaxes of <{name}> must not be parallel",
            MEND,
            lambda t: t.scene(**body("<geom xyaxes='1 0 0 2 0 0'/>")),
        ),
        (
            "scene_model",
            "directives",
            "{key} of <{name}> has the length {length}; it must be from {...} to {...}",
            MEND,
            lambda t: t.scene(**body("<joint axis='0 0 0'/>")),
        ),
    ),
    *rows(
        "certifier/scene/formats/mjcf_geoms.py",
        (
            "scene_model",
            "directives",
            "{key} of <geom> is {...} instead of a whole number of at most 9 digits",
            MEND,
            lambda t: t.scene(**body("<geom contype='0x1'/>")),
        ),
        (
            "scene_model",
            "directives",
            "a geom of the type {...} is not read",
            "types that are read: {...}",
            lambda t: t.scene(**body("<geom type='hfield'/>")),
        ),
        (
            "scene_model",
            "directives",
            "a {kind} with a mesh is not read: MuJoCo fits it to the mesh",
            "remove mesh, and write the size",
            lambda t: t.scene(**body("<geom mesh='m'/>")),
        ),
        (
            "scene_model",
            "directives",
            "fromto of a {kind} is not read",
            "write pos, an orientation and size",
            lambda t: t.scene(**body("<geom type='box' fromto='0 0 0 1 0 0' size='1'/>")),
        ),
        (
            "scene_model",
            "directives",
            "<geom> has fromto and {...}, and MuJoCo accepts only one of them",
            MEND,
            lambda t: t.scene(**body("<geom type='capsule' fromto='0 0 0 1 0 0' pos='1 0 0' size='1'/>")),
        ),
        (
            "scene_model",
            "directives",
            "the ends of fromto must be at least {_SHORT} m from each other",
            MEND,
            lambda t: t.scene(**body("<geom type='capsule' fromto='0 0 0 0 0 0' size='1'/>")),
        ),
        (
            "scene_model",
            "directives",
            "size of a {kind} has too few numbers: {...} instead of {count}",
            MEND,
            lambda t: t.scene(**body("<geom/>")),
        ),
        (
            "scene_model",
            "directives",
            "size of a {kind} must be positive, and {...} is in it",
            MEND,
            lambda t: t.scene(**body("<geom size='0'/>")),
        ),
        (
            "scene_model",
            "directives",
            "size of a {kind} has {wrong} in it, and must be {SIZE}",
            RANGE,
            lambda t: t.scene(**body("<geom size='1e-300'/>")),
        ),
        (
            "scene_model",
            "directives",
            "a plane needs 3 numbers in size: two that are not negative, and one that is positive",
            MEND,
            lambda t: t.scene(**body("<geom type='plane'/>")),
        ),
        (
            "scene_model",
            "directives",
            "a plane is only read on a body that does not move",
            "use a box",
            lambda t: t.scene(**body("<joint/><geom type='plane' size='1 1 1'/>")),
        ),
        (
            "scene_model",
            "directives",
            "a second mesh is called {...}",
            MEND,
            lambda t: t.scene(**model("<asset><mesh file='m.obj'/><mesh name='m' file='n.obj'/></asset>")),
        ),
        (
            "scene_model",
            "directives",
            "the mesh {...} of <geom> is not known",
            MEND,
            lambda t: t.scene(**body("<geom type='mesh' mesh='m'/>")),
        ),
        (
            "scene_model",
            "directives",
            "the <mesh> has no file, and Drake reads meshes only from files",
            MEND,
            lambda t: t.scene(**model("<asset><mesh name='m'/></asset><worldbody><geom type='mesh' mesh='m'/></worldbody>")),
        ),
        (
            "scene_model",
            "directives",
            "{...} {what} only OBJ meshes are read",
            "convert it to OBJ, or remove what is only drawn",
            lambda t: t.scene(**model("<asset><mesh file='m.stl'/></asset>")),
        ),
    ),
    *rows(
        "certifier/scene/formats/mjcf_contacts.py",
        (
            "scene_model",
            "directives",
            "Drake leaves out this <pair>: contype and conaffinity of {...} are 0",
            "give its geoms the bits 1, and name pairs that never collide in <exclude>",
            lambda t: t.scene(**model("<worldbody><geom name='a' size='1' contype='0' conaffinity='0'/></worldbody>" + PAIR)),
        ),
        (
            "scene_model",
            "directives",
            "{message}: their bodies are one, neighbours or excluded",
            "remove the <pair>, or the <exclude>",
            lambda t: t.scene(**model("<worldbody><geom name='a' size='1'/></worldbody><contact><pair geom1='a' geom2='a'/></contact>")),
        ),
        (
            "scene_model",
            "directives",
            "{key} of <{name}> is {...}, which is no {what} of the model",
            "did you mean {...}?",
            lambda t: t.scene(**model("<worldbody><geom name='a' size='1'/></worldbody><contact><pair geom1='aa' geom2='a'/></contact>")),
        ),
    ),
    *rows(
        "certifier/scene/formats/mjcf.py",
        (
            "scene_model",
            "directives",
            "{key} of <compiler> is {...}, and must be {...}",
            MEND,
            lambda t: t.scene(**model("<compiler angle='rad'/>")),
        ),
        (
            "scene_model",
            "directives",
            "{...} is what Drake calls another geom of the body as well, which has no name",
            "name both",
            lambda t: t.scene(**body("<geom size='1'/><geom name='geom0' size='1'/>")),
        ),
        (
            "scene_model",
            "directives",
            "the name {...} of <{name}> is empty or taken",
            "give it a name of its own",
            lambda t: t.scene(**body("<geom name='a' size='1'/><geom name='a' size='1'/>")),
        ),
        (
            "scene_model",
            "directives",
            "<{name}> in <equality> is refused: only joints that move freely are read",
            "remove it, or set active to false; a region then holds for joints that move freely, and so for coupled ones",
            lambda t: t.scene(**model("<equality><weld/></equality>")),
        ),
        (
            "scene_model",
            "directives",
            "range of <{name}> is refused: limits of tendons are not read",
            "remove the range; a region then holds for joints that move freely, and so for limited ones",
            lambda t: t.scene(**model("<tendon><fixed range='0 1'/></tendon>")),
        ),
        (
            "scene_model",
            "directives",
            "filterparent of <flag> is refused: bodies that a joint connects make no pair here",
            "remove it",
            lambda t: t.scene(**model("<option><flag filterparent='disable'/></option>")),
        ),
    ),
]
