"""Errors of model files: URDF, SDFormat and MJCF, as certifier/scene/formats/ reads them."""

from __future__ import annotations

from tests.errors.rows import rows
from tests.errors.scenes import MEND, mjcf, room

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
