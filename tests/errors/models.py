"""Errors of model files: URDF, SDFormat and MJCF, as certifier/scene/formats/ reads them."""

from __future__ import annotations

from tests.errors.rows import rows
from tests.errors.scenes import MEND, linked, mjcf, room

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
