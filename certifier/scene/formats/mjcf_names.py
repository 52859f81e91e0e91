"""The names of MJCF stand here: which are read, which change no body and no joint, and which are refused, and why.

docs/scenes.md has them as a table, which ``python -m tests.certifier.scene.mjcf_table`` writes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from certifier.errors import close_matches
from certifier.names import escaped
from certifier.scene.formats.mjcf_tree import MEND, Node, refuse

ORIENTATIONS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")
_OWN = frozenset(["name", "class", "file"])
"""Defaults have none of these."""
_DRAKE = "Drake does not read it"


@dataclass(frozen=True)
class Known:
    """Says what is known of an element.

    Attributes:
        read: attributes that are read.
        unused: attributes that change neither bodies nor joints nor collision geometry.
        refused: attributes that are refused, and why.
        elements: elements in it that are read.
        skipped: elements in it that change neither bodies nor joints nor collision geometry. Nobody looks into them.
        partly: elements in it that are refused under a condition, and which. Nobody looks further into them.
        refused_elements: elements in it that are refused, and why.
    """

    read: frozenset[str] = frozenset()
    unused: frozenset[str] = frozenset()
    refused: Mapping[str, str] = field(default_factory=dict)
    elements: frozenset[str] = frozenset()
    skipped: frozenset[str] = frozenset()
    partly: Mapping[str, str] = field(default_factory=dict)
    refused_elements: Mapping[str, str] = field(default_factory=dict)


def _names(text: str) -> frozenset[str]:
    return frozenset(text.split())


_BODY_ELEMENTS = "body geom joint freejoint"
_BODY_SKIPPED = "inertial site camera light plugin"
_BODY_REFUSED = {
    "frame": "Drake leaves out what is in it; give each element in it its own pose",
    "replicate": "Drake leaves out what is in it; write every copy",
    "composite": "Drake leaves it out; write its bodies",
    "flexcomp": "Drake leaves it out, and only rigid bodies are certified",
    "attach": "Drake leaves it out; include the file, or add the model by a directive",
}
_PLUGIN = {"plugin": "a plugin may change the shape, and Drake does not read it"}
_ACTIVE = "accepted only where active is false"
_RANGE = "accepted only without a range, or where limited is false"

ELEMENTS: dict[str, Known] = {
    "mujoco": Known(
        read=_names("model"),
        elements=_names("compiler option default asset worldbody contact equality tendon"),
        skipped=_names("size statistic visual custom extension actuator sensor keyframe"),
        refused_elements={"deformable": "Drake leaves it out, and only rigid bodies are certified"},
    ),
    "compiler": Known(
        read=_names("angle eulerseq autolimits meshdir assetdir coordinate strippath alignfree"),
        unused=_names(
            "balanceinertia boundinertia boundmass discardvisual exactmeshinertia fitaabb fusestatic inertiafromgeom inertiagrouprange "
            "saveinertial settotalmass texturedir usethread"
        ),
        skipped=_names("lengthrange"),
    ),
    "option": Known(
        unused=_names(
            "actuatorgroupdisable apirate ccd_iterations ccd_tolerance collision cone density gravity impratio integrator iterations "
            "jacobian ls_iterations ls_tolerance magnetic mpr_iterations mpr_tolerance noslip_iterations noslip_tolerance o_friction "
            "o_margin o_solimp o_solref sdf_initpoints sdf_iterations sleep_tolerance solver timestep tolerance viscosity "
            "wind"
        ),
        elements=_names("flag"),
    ),
    "flag": Known(
        read=_names("filterparent"),
        unused=_names(
            "actuation autoreset clampctrl constraint contact damper diagexact energy equality eulerdamp frictionloss fwdinv gravity "
            "invdiscrete island limit midphase multiccd nativeccd override passive refsafe sensor sensornoise sleep spring warmstart"
        ),
    ),
    "default": Known(
        read=_names("class"),
        elements=_names("default geom joint mesh"),
        partly={"tendon": _RANGE},
        skipped=_names(
            "site camera light pair equality material texture general motor position velocity intvelocity damper cylinder muscle adhesion "
            "dcmotor pid orientation"
        ),
    ),
    "asset": Known(
        elements=_names("mesh"),
        skipped=_names("texture material skin hfield"),
        refused_elements={"model": "Drake leaves it out; include the file, or add the model by a directive"},
    ),
    "mesh": Known(
        read=_names("name class file scale"),
        unused=_names("inertia material maxhullvert normal smoothnormal texcoord"),
        refused={
            "refpos": _DRAKE,
            "refquat": _DRAKE,
            "vertex": "Drake does not read it; write the points to an OBJ file",
            "face": "Drake does not read it; write the faces to an OBJ file",
            "builtin": "Drake does not read it; write the mesh to an OBJ file",
            "params": _DRAKE,
            "content_type": "Drake takes the kind of a file from its name",
        },
        refused_elements=_PLUGIN,
    ),
    "worldbody": Known(
        elements=_names(_BODY_ELEMENTS) - {"joint", "freejoint"},
        skipped=_names(_BODY_SKIPPED) - {"inertial"},
        refused_elements=_BODY_REFUSED,
    ),
    "body": Known(
        read=_names("name childclass pos mocap").union(ORIENTATIONS),
        unused=_names("gravcomp sleep user fuse simple"),
        elements=_names(_BODY_ELEMENTS),
        skipped=_names(_BODY_SKIPPED),
        refused_elements=_BODY_REFUSED,
    ),
    "joint": Known(
        read=_names("name class type pos axis limited range ref"),
        unused=_names(
            "actuatorfrclimited actuatorfrcrange actuatorgravcomp armature damping frictionloss group margin solimpfriction solimplimit "
            "solreffriction solreflimit springdamper springref springyield stiffness user"
        ),
    ),
    "freejoint": Known(read=_names("name align"), unused=_names("group")),
    "geom": Known(
        read=_names("name class type contype conaffinity size fromto pos mesh").union(ORIENTATIONS),
        unused=_names(
            "adhesion castshadow condim density fluidcoef fluidshape friction gap group margin mass material priority rgba shellinertia "
            "solimp solmix solref surfacevel user"
        ),
        refused={"fitscale": "a geom is not fitted to a mesh here", "hfield": "height fields are not read"},
        refused_elements=_PLUGIN,
    ),
    "contact": Known(elements=_names("pair exclude")),
    "pair": Known(read=_names("geom1 geom2"), unused=_names("name class adhesion condim friction gap margin solimp solref solreffriction")),
    "exclude": Known(read=_names("body1 body2"), unused=_names("name")),
    "equality": Known(partly=dict.fromkeys(sorted(_names("connect weld joint tendon flex flexvert flexstrain")), _ACTIVE)),
    "tendon": Known(partly=dict.fromkeys(("fixed", "spatial"), _RANGE)),
}
"""By the element's name."""


def check_names(root: Node) -> None:
    """Checks the names of every element and attribute that may matter.

    Raises:
        SceneError: ``scene_model`` with file and line, for a name that is refused or not known.
    """
    if root.name != "mujoco":
        refuse(root, f"the model begins with <{escaped(root.name[:80])}> instead of <mujoco>")
    waiting = [root]
    for node in waiting:
        known = ELEMENTS[node.name]
        names = known.elements | known.skipped | known.partly.keys()
        _check_attributes(node, known)
        for child in node.children:
            if child.name in known.refused_elements:
                refuse(child, f"<{child.name}> in <{node.name}> is refused: {known.refused_elements[child.name]}")
            if child.name not in names:
                refuse(
                    child,
                    f"<{escaped(child.name[:80])}> in <{node.name}> is not known",
                    hint=close_matches(child.name, sorted(names)) or MEND,
                )
        waiting += node.under(*known.elements)


def _check_attributes(node: Node, known: Known) -> None:
    own = _OWN if node.parent is not None and node.parent.name == "default" and node.name != "default" else frozenset()
    names = (known.read | known.unused) - own
    for key in node.attributes:
        if key in known.refused:
            refuse(node, f"{key} of <{node.name}> is refused: {known.refused[key]}")
        if key not in names:
            refuse(node, f"{escaped(key[:80])} of <{node.name}> is not known", hint=close_matches(key, sorted(names)) or MEND)
