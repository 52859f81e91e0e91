"""Random MJCF models, each from a seed: of everything that is read, and spoilt by something that is refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import SubElement

import numpy as np

from tests.certifier.scene.mjcf_maker import Maker


@dataclass
class Model:
    """A model on disk.

    Attributes:
        path: its first file.
        floating: where bodies with a free joint stand, by their names.
        spoilt: what was done to it that is refused, or None.
    """

    path: Path
    floating: dict[str, str]
    spoilt: str | None = None

    @property
    def scene(self) -> str:
        """The text of a scene file of the model alone."""
        lines = ["directives:", f"  - add_model: {{name: robot, file: {self.path.name}}}"]
        for body, pos in self.floating.items():
            place = ", ".join(pos.split())
            lines.append(f"  - add_weld: {{parent: world, child: robot::{body}, X_PC: {{translation: [{place}]}}}}")
        return "\n".join(lines) + "\n"


def random_model(seed: int, directory: Path, spoil: bool = False) -> Model:
    """Writes a random model into a directory; with ``spoil``, something is in it that Drake reads otherwise than MuJoCo."""
    maker = Maker(np.random.default_rng(seed))
    maker.compile()
    maker.defaults()
    maker.assets()
    maker.world()
    maker.rest()
    name = None
    if spoil:
        name = list(SPOILERS)[seed % len(SPOILERS)]
        SPOILERS[name](maker)
    return Model(maker.write(directory), maker.floating, name)


def _into_body(element: str, more: str = "", **attributes: str) -> Callable[[Maker], None]:
    """Puts an element into a body."""

    def spoil(maker: Maker) -> None:
        bodies = list(maker.root.iter("body"))
        child = SubElement(bodies[int(maker.rng.integers(len(bodies)))], element, attributes)
        if more:
            child.append(ElementTree.fromstring(more))

    return spoil


def _into_root(text: str) -> Callable[[Maker], None]:
    """Adds a section to the model, in which BODY, JOINT and GEOM stand for the names of some."""

    def spoil(maker: Maker) -> None:
        filled = text
        for mark, kind in (("BODY", "body"), ("JOINT", "joint")):
            names = [e.attrib["name"] for e in maker.root.iter(kind) if "name" in e.attrib]
            filled = filled.replace(mark, str(maker.rng.choice(names)))
        maker.root.append(ElementTree.fromstring(filled))

    return spoil


def _on_some(kind: str, **attributes: str) -> Callable[[Maker], None]:
    """Gives attributes to one of the elements of a kind that are no defaults."""

    def spoil(maker: Maker) -> None:
        places = [e for part in ("worldbody", "asset") for top in maker.root.iter(part) for e in top.iter(kind)]
        places[int(maker.rng.integers(len(places)))].attrib.update(attributes)

    return spoil


def _joints_behind_a_pose(maker: Maker) -> None:
    body = next(e for e in maker.root.iter("body") if not e.findall("freejoint"))
    for k in range(2):
        SubElement(body, "joint", name=f"extra{k}", axis="0 0 1", range="-0.5 0.5")
    body.set("pos", "0.3 0.1 0.2")


def _pair_of_drawn(maker: Maker) -> None:
    bodies = list(maker.root.iter("body"))
    bits = {"contype": "0", "conaffinity": "0", "type": "box", "size": "0.3 0.3 0.3"}
    SubElement(bodies[-1], "geom", {"name": "drawn", **bits})
    SubElement(next(maker.root.iter("worldbody")), "geom", {"name": "post", **bits})
    SubElement(SubElement(maker.root, "contact"), "pair", geom1="drawn", geom2="post")


def _gap(maker: Maker) -> None:
    """Makes a small model of a class without <geom> in one with a <geom> that counts."""
    for part in list(maker.root):
        if part.tag != "compiler":
            maker.root.remove(part)
    maker.floating.clear()
    outer = SubElement(maker.root, "default")
    SubElement(outer, "geom", type="box", contype="2")
    SubElement(SubElement(outer, "default", {"class": "gap"}), "joint", damping="1")
    body = SubElement(SubElement(maker.root, "worldbody"), "body", name="b0")
    SubElement(body, "joint", name="j0", range="-1 1")
    SubElement(body, "geom", {"class": "gap", "size": "0.1 0.1 0.1"})


def _without_range(maker: Maker) -> None:
    for joint in maker.root.iter("joint"):
        joint.attrib.pop("range", None)
    next(joint for world in maker.root.iter("worldbody") for joint in world.iter("joint") if "name" in joint.attrib).set("limited", "true")


def _without_size(maker: Maker) -> None:
    for geom in maker.root.iter("geom"):
        geom.attrib.pop("size", None)
    SubElement(next(maker.root.iter("body")), "geom", type="sphere")


def _unnamed(maker: Maker) -> None:
    """Gives a geom the name by which Drake calls the one without a name before it."""
    body = next(maker.root.iter("body"))
    for geom in body.findall("geom"):
        body.remove(geom)
    SubElement(body, "geom", type="sphere", size="0.1")
    SubElement(body, "geom", type="sphere", size="0.2", name="geom0")


def _twice(maker: Maker) -> None:
    for body in (next(maker.root.iter("body")), next(maker.root.iter("worldbody"))):
        SubElement(body, "geom", name="twice", type="sphere", size="0.1")


SPOILERS: dict[str, Callable[[Maker], None]] = {
    "joints behind a pose": _joints_behind_a_pose,
    "pair of drawn geoms": _pair_of_drawn,
    "class without geom": _gap,
    "frame": _into_body("frame", "<geom size='2'/>", pos="1 0 0"),
    "replicate": _into_body("replicate", "<geom size='0.1'/>", count="3", offset="1 0 0"),
    "geom of two sizes": _into_body("geom", type="box", size="0.1 0.1"),
    "geom without size": _without_size,
    "geom of size 0": _into_body("geom", type="sphere", size="0"),
    "box around a mesh": _into_body("geom", type="box", mesh="wedge"),
    "box from to": _into_body("geom", type="box", fromto="0 0 0 1 0 0", size="0.1"),
    "unknown mesh": _into_body("geom", type="mesh", mesh="nothing"),
    "height field": _into_body("geom", type="hfield", hfield="h"),
    "ball joint": _into_body("joint", type="ball"),
    "misspelt geom": _into_body("goem", size="0.2"),
    "misspelt size": _on_some("geom", siez="0.2"),
    "misspelt pos": _on_some("body", pso="0.2 0 0"),
    "refpos": _on_some("mesh", refpos="0.1 0 0"),
    "refquat": _on_some("mesh", refquat="1 1 0 0"),
    "axis of length 0": _on_some("joint", axis="0 0 0"),
    "zaxis beside -z": _into_body(
        "body",
        "<geom type='sphere' size='0.1' pos='0.5 0.2 0.1' quat='1 0 0 0' contype='1' class='main'/>",
        name="aside",
        zaxis="1e-8 0 -1",
    ),
    "huge quat": _into_body("geom", type="box", size="0.1 0.2 0.3", quat="1e200 0 0 1e200"),
    "range without room": _on_some("joint", range="0.1 0.1", limited="auto"),
    "limited without range": _without_range,
    "mocap": _on_some("body", mocap="true"),
    "weld": _into_root("<equality><weld body1='BODY'/></equality>"),
    "coupled joints": _into_root("<equality><joint joint1='JOINT' polycoef='0.1 0 0 0 0'/></equality>"),
    "limited tendon": _into_root("<tendon><fixed range='0 1'><joint joint='JOINT' coef='1'/></fixed></tendon>"),
    "alignfree": _into_root("<compiler alignfree='true'/>"),
    "strippath": _into_root("<compiler strippath='true'/>"),
    "body outside of worldbody": _into_root("<body name='outside'><geom size='1'/></body>"),
    "parents that collide": _into_root("<option><flag filterparent='disable'/></option>"),
    "outer class of another name": _into_root("<default class='outer'><geom type='box'/></default>"),
    "exclude of the world": _into_root("<contact><exclude body1='BODY' body2='world'/></contact>"),
    "inline mesh": _into_root("<asset><mesh name='inline' vertex='0 0 0 1 0 0 0 1 0 0 0 1'/></asset>"),
    "a name twice": _twice,
    "a name that Drake makes": _unnamed,
}
