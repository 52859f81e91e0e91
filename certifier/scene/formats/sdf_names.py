"""The names that SDFormat files may have, wherever they make bodies, joints and collision geometry.

Every element has its place in one of four tables. What stands in none of them is not known, and is refused. docs/scenes.md has them.
"""

from __future__ import annotations

MODELS = ("model", "include", "frame")
SHAPES = ("box", "sphere", "cylinder", "capsule", "ellipsoid", "plane", "mesh", "drake:capsule", "drake:ellipsoid", "empty")

ONCE: dict[str, tuple[str, ...]] = {
    "sdf": ("world",),
    "model": ("pose", "static"),
    "include": ("uri", "name", "pose", "static", "placement_frame"),
    "frame": ("pose",),
    "link": ("pose", "kinematic", "must_be_base_link"),
    "collision": ("pose", "geometry"),
    "geometry": SHAPES,
    "box": ("size",),
    "sphere": ("radius",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "ellipsoid": ("radii",),
    "plane": ("normal",),
    "mesh": ("uri", "scale", "drake:declare_convex"),
    "drake:capsule": ("radius", "length"),
    "drake:ellipsoid": ("a", "b", "c"),
    "joint": ("parent", "child", "pose", "axis", "axis2", "drake:mimic"),
    "axis": ("xyz", "limit", "use_parent_model_frame", "mimic"),
    "axis2": ("xyz", "limit", "use_parent_model_frame"),
    "limit": ("lower", "upper"),
    "mimic": ("multiplier", "offset", "reference"),
}
"""What is read, and may stand once in its parent, by the parent."""

MANY: dict[str, tuple[str, ...]] = {
    "sdf": ("model",),
    "world": MODELS,
    "model": ("link", "joint", *MODELS, "drake:collision_filter_group"),
    "link": ("collision",),
    "drake:collision_filter_group": ("drake:member", "drake:member_group", "drake:ignored_collision_filter_group"),
}
"""What is read, and may stand in its parent more than once, by the parent."""

HARMLESS: dict[str, tuple[str, ...]] = {
    "world": (
        *("gravity", "physics", "scene", "light", "gui", "plugin", "audio", "wind", "atmosphere", "magnetic_field", "road"),
        "spherical_coordinates",
    ),
    "model": (
        *("self_collide", "enable_wind", "allow_auto_disable", "gripper", "plugin", "drake:linear_bushing_rpy"),
        "drake:linear_spring_damper",
    ),
    "include": ("plugin",),
    "link": (
        *("visual", "inertial", "sensor", "light", "projector", "audio_sink", "audio_source", "battery", "particle_emitter", "plugin"),
        *("velocity_decay", "gravity", "enable_wind", "self_collide"),
    ),
    "collision": ("surface", "max_contacts", "laser_retro", "density", "auto_inertia_params", "drake:proximity_properties"),
    "plane": ("size",),
    "mesh": ("convex_decomposition",),
    "joint": (
        *("physics", "sensor", "plugin", "gearbox_ratio", "gearbox_reference_body", "thread_pitch", "screw_thread_pitch"),
        *("drake:rotor_inertia", "drake:gear_ratio", "drake:controller_gains"),
    ),
    "axis": ("dynamics",),
    "axis2": ("dynamics",),
    "limit": ("effort", "velocity", "stiffness", "dissipation", "drake:acceleration"),
}
"""What moves nothing and has no collision geometry in it, or makes ciris certify more pairs than there are, by the parent.

A plane is infinite to Drake, and the hull of a mesh holds every decomposition of it. Nothing looks into these elements.
"""

REFUSED: dict[str, dict[str, str]] = {
    "sdf": dict.fromkeys(("actor", "light"), "a file is one model"),
    "world": {
        "joint": "put it into a model",
        "actor": "its geometry would be left out",
        "population": "its models would be left out; write them out",
        "state": "Drake takes the poses of the models themselves; write the poses there",
    },
    "model": {
        "drake:joint": "write revolute, prismatic and fixed joints; three of them stand for a planar one",
        **dict.fromkeys(("drake:ball_constraint", "drake:tendon_constraint"), "only trees of joints are read"),
    },
    "include": {"experimental:params": "it changes the included model; write the changed model"},
    "geometry": {
        **dict.fromkeys(("heightmap", "polyline", "image"), "write primitives or OBJ meshes"),
        "cone": "write a mesh",
    },
    "mesh": {"submesh": "Drake would take the whole file; write that part as a file of its own"},
}
"""What SDFormat or Drake has and is not read, and what to write instead, by the parent."""

ATTRIBUTES: dict[str, tuple[str, ...]] = {
    "sdf": ("version",),
    "world": ("name",),
    "model": ("name", "canonical_link", "placement_frame"),
    "include": ("merge",),
    "frame": ("name", "attached_to"),
    "link": ("name",),
    "collision": ("name",),
    "mesh": ("optimization",),
    "joint": ("name", "type"),
    "mimic": ("joint", "axis"),
    "drake:mimic": ("joint", "multiplier", "offset"),
    "drake:collision_filter_group": ("name",),
    "xyz": ("expressed_in",),
    "pose": ("relative_to", "rotation_format", "degrees", "frame"),
}
"""The attributes of the elements that are read; those that are not named here have none."""

JOINTS = ("revolute", "prismatic", "continuous", "fixed", "ball", "universal", "screw", "revolute2", "gearbox")
"""The types of joints. Those after the first four are refused when the tree is made."""
VERSIONS = ("1.4", "1.5", "1.6", "1.7", "1.8", "1.9", "1.10", "1.11", "1.12")
WITH_POSE_FRAMES = VERSIONS[:3]
"""In these versions a pose has a frame; in later ones it has relative_to."""


FILES = frozenset(["uri", "drake:diffuse_map"])
"""The text of these is a file, which Drake looks for also in what is only drawn."""

READ = frozenset(["sdf"]).union(*ONCE.values(), *MANY.values())
"""The elements that are read somewhere."""

CONTAINERS = frozenset([*ONCE, *MANY])
"""These have other elements in them, and no text."""


_PREFIXES = frozenset(["", "drake", "experimental", "xacro"])


def local(name: str) -> str:
    """Returns a name without its prefix."""
    return name.rpartition(":")[2]


def is_custom(name: str) -> bool:
    """Says whether an element or attribute has a prefix of the user's own, as SDFormat allows. Drake does not read it."""
    return name.rpartition(":")[0] not in _PREFIXES


MEANT = frozenset(local(name) for name in READ.union(*REFUSED.values()))
"""The names of what is read or refused, without prefixes."""


def known(parent: str) -> list[str]:
    """Returns the elements that may stand in a parent."""
    return [*ONCE.get(parent, ()), *MANY.get(parent, ()), *HARMLESS.get(parent, ())]
