"""Errors of model files: URDF, SDFormat and MJCF, as certifier/scene/formats/ reads them."""

from __future__ import annotations

from tests.certifier.scene.workshop import BOX, LIMIT
from tests.errors.rows import rows
from tests.errors.scenes import BALL_JOINT, MEND, linked, mjcf, room

EXPAND = "expand the file with xacro first: xacro FILE > robot.urdf"
LINK = "<link name='more'/><joint name='{}' type='fixed'><parent link='{}'/><child link='{}'/></joint>"
ZERO_AXIS = "<joint name='j' type='continuous'><parent link='hand'/><child link='l'/><axis xyz='0 0 0'/>"


def turn(limit: str) -> dict[str, str]:
    return {"limit": f"<limit {limit}/>"}


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
            "{what} is {...} instead of {wanted}",
            MEND,
            lambda t: t.scene(shape='<sphere radius="1,5"/>'),
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
        ("scene_model", "directives", "{what} must not be 0", MEND, lambda t: t.scene(shape="<mesh filename='m.obj' scale='1 1 0'/>")),
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
            "xyz of <axis> has the length {length}; it must be {...} to {...}, best 1",
            MEND,
            lambda t: t.scene(limit=f"{LIMIT}</joint><link name='l'/>{ZERO_AXIS}"),
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
                    "the quaternion of <pose> is 0 0 0 0, which is no rotation",
                    MEND,
                    lambda t: t.scene(**linked("<pose rotation_format='quat_xyzw'>0 0 0 0 0 0 0</pose>")),
                ),
            ]
        ),
    ),
    *rows(
        "certifier/scene/formats/mjcf.py",
        ("scene_model", "directives", "<{name}> in a body is not read by Drake", MEND, lambda t: t.scene(**mjcf("<frame/>"))),
        ("scene_model", "directives", "{key} of <{name}> is not read by Drake", MEND, lambda t: t.scene(**mjcf("<joint refpos='1'/>"))),
        (
            "scene_model",
            "directives",
            "ref of <{name}> is not read by Drake: measure the joint's positions from 0",
            MEND,
            lambda t: t.scene(**mjcf("<joint ref='1'/>")),
        ),
    ),
]
