"""The names of URDF stand here: what is read of a file, what is harmless where, and what is refused with words of its own.

docs/scenes.md has the same as a table, which a test compares with this module.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from certifier.errors import close_matches


@dataclass(frozen=True)
class Known:
    """What an element that is read consists of.

    Attributes:
        needed: attributes that must be there.
        read: attributes that may be there.
        harmless: attributes that say nothing about where the robot can be.
        holds: elements that must be inside.
    """

    needed: tuple[str, ...] = ()
    read: tuple[str, ...] = ()
    harmless: tuple[str, ...] = ()
    holds: tuple[str, ...] = ()

    @property
    def attributes(self) -> tuple[str, ...]:
        return self.needed + self.read + self.harmless


_POSE = ("xyz", "rpy")
_RATES = ("effort", "velocity", "acceleration", "deceleration", "jerk")
_ROUND = Known(needed=("radius", "length"))

READ: Mapping[tuple[str, str], Known] = {
    ("", "robot"): Known(read=("name",), harmless=("version", "xsi:schemaLocation", "xsi:noNamespaceSchemaLocation")),
    ("robot", "link"): Known(needed=("name",), harmless=("type", "concave")),
    ("robot", "joint"): Known(needed=("name", "type"), harmless=("dont_collapse",), holds=("parent", "child")),
    ("robot", "frame"): Known(needed=("name", "link"), read=_POSE),
    ("robot", "drake:collision_filter_group"): Known(needed=("name",), read=("ignore",)),
    ("drake:collision_filter_group", "drake:member"): Known(needed=("link",)),
    ("drake:collision_filter_group", "drake:member_group"): Known(needed=("name",)),
    ("drake:collision_filter_group", "drake:ignored_collision_filter_group"): Known(needed=("name",)),
    ("link", "origin"): Known(read=_POSE),
    ("link", "collision"): Known(read=("name",), harmless=("group", "concave", "id"), holds=("geometry",)),
    ("collision", "origin"): Known(read=_POSE),
    ("collision", "geometry"): Known(harmless=("name",)),
    ("geometry", "box"): Known(needed=("size",)),
    ("geometry", "sphere"): Known(needed=("radius",)),
    ("geometry", "cylinder"): _ROUND,
    ("geometry", "capsule"): _ROUND,
    ("geometry", "drake:capsule"): _ROUND,
    ("geometry", "drake:ellipsoid"): Known(needed=("a", "b", "c")),
    ("geometry", "mesh"): Known(needed=("filename",), read=("scale",)),
    ("joint", "parent"): Known(needed=("link",)),
    ("joint", "child"): Known(needed=("link",)),
    ("joint", "origin"): Known(read=_POSE),
    ("joint", "axis"): Known(needed=("xyz",)),
    ("joint", "limit"): Known(
        read=("lower", "upper"),
        harmless=(*_RATES, "drake:acceleration", "drake:jerk", "command_effort", "current", "gear_velocity", "damping", "friction"),
    ),
    ("joint", "mimic"): Known(needed=("joint",), read=("multiplier", "offset")),
}
"""By the names of the parent and of the element. The parent of the root is empty."""

_SIMULATED = ("gravity", "kinematic", "self_collide", "velocity_decay", "surface", "contact", "gazebo", "sensor")

HARMLESS: Mapping[str, tuple[str, ...]] = {
    "robot": ("material", "transmission", "gazebo", "ros2_control", "sensor", "mujoco", "webots"),
    "link": ("visual", "inertial", "material", "self_filter", "self_collision_checking", "collision_checking", *_SIMULATED),
    "collision": ("material", "verbose", "drake:proximity_properties", "drake_compliance", "contact_coefficients", *_SIMULATED),
    "geometry": ("drake:declare_convex",),
    "mesh": ("drake:declare_convex",),
    "joint": ("dynamics", "safety_controller", "calibration", "gazebo", "hardwareInterface", "damping", "friction"),
}
"""By the parent's name: elements that are not looked into, because they say nothing about where the robot can be."""

LEFT_OUT: Mapping[str, tuple[str, ...]] = {"robot": ("transmission",), "joint": HARMLESS["joint"]}
"""By the parent's name: harmless elements that Drake would read. It warns of some of them, or stops."""

UNREAD_FILES = frozenset(["gazebo", "sensor", "mujoco", "webots", "ros2_control"])
"""In these, Drake looks for no file."""

UNREAD_GROUP = ("robot", "drake:collision_filter_group")
"""With another prefix for Drake's namespace, it is not read, so it hides no pair."""

OPAQUE = frozenset(name for names in HARMLESS.values() for name in names)
NAMES = frozenset(name for _, name in READ)
_SHAPES = frozenset(name for place, name in READ if place == "geometry")
_DRAWN = {"origin", "geometry", *_SHAPES}
MAY_HOLD: Mapping[str, frozenset[str]] = {
    "gazebo": NAMES,
    **dict.fromkeys(("transmission", "ros2_control"), NAMES - {"link", "collision"}),
    **dict.fromkeys(("sensor", "mujoco", "webots"), NAMES - {"link", "collision", "joint"}),
    **dict.fromkeys(("visual", "self_filter"), frozenset(_DRAWN)),
    "inertial": frozenset(["origin"]),
    "collision_checking": _SHAPES,
}
"""Names that are read elsewhere and may stand in an element that is not looked into. In other such elements none may."""

_BETWEEN = "it acts between bodies, which is not read", "take it out; only independent joints are supported"
_LEFT_OUT = "with it, Drake can leave out the element", "take the attribute out, or the element"
REFUSED: Mapping[tuple[str, str], tuple[str, str]] = {
    **{
        ("robot", f"drake:{name}"): _BETWEEN
        for name in ("linear_bushing_rpy", "linear_spring_damper", "ball_constraint", "distance_constraint", "tendon_constraint")
    },
    ("robot", "loop_joint"): _BETWEEN,
    ("link", "@drake_ignore"): _LEFT_OUT,
    ("joint", "@drake_ignore"): _LEFT_OUT,
    ("origin", "@quat_xyzw"): ("quaternions of URDF 1.1 are not read by Drake", "write the rotation as rpy"),
}
"""Why, and what to do. By the names of parent and element, or of element and ``@`` attribute."""

DRAKE = "http://drake.mit.edu"
"""The namespace of Drake's own names. Drake knows them by the prefix ``drake:`` alone."""

XACRO = "xacro"
EXPAND = 'expand the file with xacro first, or write xmlns:xacro="http://www.ros.org/wiki/xacro" into <robot>'
_MACROS = frozenset(["macro", "property", "include", "insert_block", "if", "unless"])
"""Old files use these names without the prefix ``xacro:``."""

MOVING = ("revolute", "continuous", "prismatic")
TYPES = (*MOVING, "fixed")
UNSUPPORTED: Mapping[str, str] = {
    "floating": "leave the joint out, and weld its child by add_weld in the scene file",
    "planar": "write two slides and a turn, as docs/scenes.md does for a mobile base",
    **dict.fromkeys(("ball", "screw", "universal", "curvilinear"), "replace it by joints that turn or slide, or weld its bodies"),
}
"""Types of joints that are known and not supported, and what to do."""


def is_macro(parent: str, name: str) -> bool:
    """Says whether an element is xacro's."""
    return name.startswith(XACRO) or (parent == "robot" and name in _MACROS)


def nearest_element(parent: str, name: str) -> str:
    """Returns a hint for an element that is not known in its parent."""
    inside = [element for place, element in READ if place == parent]
    homes = [f"<{place}>" for place, element in READ if element == name and place not in ("", parent, "link" if name == "origin" else "")]
    if homes:
        return f"<{name}> belongs in {' or '.join(homes)}"
    near = close_matches(name.lower(), [*inside, *HARMLESS.get(parent, ())])
    return near or (f"known in <{parent}>: {', '.join(inside)}" if inside else "take it out")


def nearest_attribute(known: Known, name: str) -> str:
    """Returns a hint for an attribute that is not known in its element."""
    names = list(known.attributes)
    return close_matches(name.lower(), names) or (f"known attributes: {', '.join(names)}" if names else "take it out")
