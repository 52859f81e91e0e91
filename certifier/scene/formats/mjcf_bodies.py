"""Bodies and joints of MJCF are checked here."""

from __future__ import annotations

import math
from typing import NoReturn

from certifier.scene.formats.mjcf_names import ORIENTATIONS
from certifier.scene.formats.mjcf_tree import Node, numbers, refuse
from certifier.scene.formats.ranges import POSITION, RANGE_HINT, SCALE

COUNTS: dict[str, tuple[int, ...]] = {
    "pos": (3,),
    "quat": (4,),
    "axisangle": (4,),
    "euler": (3,),
    "xyaxes": (6,),
    "zaxis": (3,),
    "axis": (3,),
    "range": (2,),
    "ref": (1,),
}
COUNTS |= {"fromto": (6,), "scale": (3,), "size": (1, 2, 3)}
_RANGES = {**dict.fromkeys(("pos", "fromto", "euler", "axisangle", "ref"), POSITION), "scale": SCALE}
_LENGTHS = 1e-6, 1e6
"""Vectors that stand for directions and rotations have lengths between these. Far beyond, Drake loses them, or MuJoCo takes them for 0."""
_OPPOSITE = 1e-9
"""A zaxis that is so near to -z without being it is turned about another axis in Drake than in MuJoCo."""


def check_numbers(node: Node) -> None:
    """Checks the numbers of a body, joint, geom or mesh that are written at it, and not in a class."""
    for key, counts in COUNTS.items():
        if key in node.attributes:
            found = numbers(node, key, counts)
            if key in _RANGES and (wrong := _RANGES[key].outside(found)) is not None:
                refuse(node, f"{key} of <{node.name}> has {wrong:g} in it, and its magnitude must be {_RANGES[key]}", hint=RANGE_HINT)
    for key in ("axis", "quat", "zaxis"):
        if key in node.attributes:
            _check_length(node, key, numbers(node, key, COUNTS[key]))
    if "axisangle" in node.attributes:
        _check_length(node, "axisangle", numbers(node, "axisangle", (4,))[:3])
    if "xyaxes" in node.attributes:
        _check_axes(node, numbers(node, "xyaxes", (6,)))
    if "zaxis" in node.attributes:
        x, y, z = numbers(node, "zaxis", (3,))
        if (x or y) and 1 + z / math.hypot(x, y, z) < _OPPOSITE:
            refuse(node, "zaxis is so near to -z that Drake turns it about another axis than MuJoCo", hint="write it as quat")
    if len(written := [key for key in ORIENTATIONS if key in node.attributes]) > 1:
        refuse(node, f"<{node.name}> has {' and '.join(written)}, and only one orientation is read")
    if "range" in node.attributes:
        lower, upper = numbers(node, "range", (2,))
        if lower >= upper and node.attributes.get("limited") != "false":
            refuse(node, f"the limits of a joint are {lower:.9g} and {upper:.9g}; the lower one must be less")


def check_joint(node: Node, attributes: dict[str, str], autolimits: bool) -> None:
    """Checks a joint.

    Args:
        attributes: its own and those of its class.
        autolimits: whether a range limits a joint that does not say whether it is limited.
    """
    kind = attributes.get("type", "hinge")
    if kind not in ("hinge", "slide", "free"):
        hint = "write a body with a hinge for each of its axes" if kind == "ball" else "types that are read: hinge, slide, free"
        refuse(node, f"a joint of the type {kind[:80]!a} is not read", hint=hint)
    if kind == "free":
        return
    limited = attributes.get("limited", "auto")
    if limited not in ("true", "false", "auto"):
        refuse(node, f"limited is {limited[:80]!a}, and must be true, false or auto")
    if limited == "true" and "range" not in attributes:
        refuse(node, "the joint is limited and has no range")
    if limited == "auto" and "range" in attributes and not autolimits:
        refuse(node, "the joint has a range and autolimits is false, so it must say whether it is limited")


def check_body(node: Node, joints: list[dict[str, str]]) -> None:
    """Checks a body and the joints in it together.

    Drake puts the pose of a body behind all but the last of its joints, MuJoCo before the first. That is the same where the pose is none,
    and where it only shifts the body and those joints only slide.

    Args:
        joints: the attributes of the joints in it, their own and those of their classes.
    """
    if node.attributes.get("mocap", "false") != "false":
        refuse(node, "mocap of <body> is refused: Drake does not read it", hint="remove it, and weld the body where it stands")
    kinds = [joint.get("type", "hinge") for joint in joints] + ["free"] * len(node.under("freejoint"))
    assert node.parent is not None
    if "free" in kinds:
        _check_free(node, len(kinds))
    elif len(kinds) > 1 and _turned(node):
        _refuse_joints(node, "turns it")
    elif len(kinds) > 1 and any(numbers(node, "pos", (3,)) if "pos" in node.attributes else ()) and "hinge" in kinds[:-1]:
        _refuse_joints(node, "shifts it")


def _refuse_joints(node: Node, what: str) -> NoReturn:
    hint = "write a body for each joint: the outer one has the pose and the first joint, and each of the others is in the one before"
    name = node.attributes.get("name", "")
    refuse(
        node,
        f"the body {name[:80]!a} has several joints and a pose that {what}, which Drake puts behind all joints but the last",
        hint=hint,
    )


def _check_free(node: Node, joints: int) -> None:
    if joints > 1:
        refuse(node, "a body with a free joint must have no other joint")
    if node.parent is None or node.parent.name != "worldbody":
        refuse(node, "a free joint is only read in a body of <worldbody>")
    for joint in node.under("freejoint"):
        if joint.attributes.get("align", "auto") == "true":
            refuse(joint, "align of <freejoint> is refused: MuJoCo moves the body's frame, and Drake does not", hint="remove it")


def _turned(node: Node) -> bool:
    """Says whether a body has an orientation that is not plainly none."""
    plain = {"quat": [1.0, 0.0, 0.0, 0.0], "euler": [0.0, 0.0, 0.0]}
    return any(key in node.attributes and numbers(node, key, COUNTS[key]) != plain.get(key) for key in ORIENTATIONS)


def _check_axes(node: Node, axes: list[float]) -> None:
    x, y = axes[:3], axes[3:]
    cross = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]]
    for axis in (x, y):
        _check_length(node, "xyaxes", axis)
    if math.hypot(*cross) < _LENGTHS[0] * math.hypot(*x) * math.hypot(*y):
        refuse(node, f"the axes in xyaxes of <{node.name}> must not be parallel")


def _check_length(node: Node, key: str, vector: list[float]) -> None:
    length = math.hypot(*vector)
    if not _LENGTHS[0] <= length <= _LENGTHS[1]:
        refuse(node, f"{key} of <{node.name}> has the length {length:.3g}; it must be from {_LENGTHS[0]:g} to {_LENGTHS[1]:g}")
