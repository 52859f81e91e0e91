"""Makes random MJCF models of everything that is read, element by element."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

SIZES = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3}
ORIENTATIONS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")
WEDGE = "v 0 0 0\nv 0.2 0 0\nv 0 0.1 0\nv 0 0 0.3\nv 0.1 0.1 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 5 4\nf 3 4 5\nf 2 3 5\n"


@dataclass
class Maker:
    """Makes a model element by element."""

    rng: np.random.Generator
    root: Element = field(default_factory=lambda: Element("mujoco", model="robot"))
    degrees: bool = True
    autolimits: bool = True
    classes: dict[str, dict[str, dict[str, str]]] = field(default_factory=dict)
    bodies: list[str] = field(default_factory=list)
    geoms: int = 0
    joints: int = 0
    floating: dict[str, str] = field(default_factory=dict)
    files: dict[str, str] = field(default_factory=dict)

    def maybe(self, chance: float = 0.5) -> bool:
        return bool(self.rng.random() < chance)

    def pick(self, *options: str) -> str:
        return str(self.rng.choice(options))

    def vector(self, count: int, low: float = -1.0, high: float = 1.0) -> str:
        return " ".join(f"{x:.5g}" for x in self.rng.uniform(low, high, count))

    def angle(self, radians: float) -> float:
        return float(np.degrees(radians)) if self.degrees else radians

    def orientation(self) -> dict[str, str]:
        kind = self.pick(*ORIENTATIONS)
        angles = [self.angle(x) for x in self.rng.uniform(-3, 3, 3)]
        special = {"zaxis": ["0 0 -1", "0 0 2", "0 0 1"], "quat": ["1 0 0 0", "0 0 0 3", "-1 0 0 0"], "axisangle": ["0 0 5 0"]}
        if kind in special and self.maybe(0.2):
            return {kind: self.pick(*special[kind])}
        match kind:
            case "axisangle":
                return {kind: f"{self.vector(3)} {angles[0]:.6g}"}
            case "euler":
                return {kind: " ".join(f"{a:.6g}" for a in angles)}
            case _:
                return {kind: self.vector({"quat": 4, "xyaxes": 6, "zaxis": 3}[kind])}

    def pose(self, chance: float = 0.7) -> dict[str, str]:
        found = {"pos": self.vector(3)} if self.maybe(chance) else {}
        return found | (self.orientation() if self.maybe(chance) else {})

    def compile(self) -> None:
        self.degrees = self.maybe()
        attributes = {"angle": "degree" if self.degrees else "radian"} if not self.degrees or self.maybe() else {}
        if self.maybe():
            attributes["eulerseq"] = "".join(self.rng.choice(list("xyzXYZ"), 3))
        if self.maybe(0.3):
            attributes[self.pick("meshdir", "assetdir")] = "parts"
        self.autolimits = self.maybe(0.8)
        if not self.autolimits or self.maybe(0.2):
            attributes["autolimits"] = "true" if self.autolimits else "false"
        for key, value in {"discardvisual": "true", "fusestatic": "true", "inertiafromgeom": "auto"}.items():
            if self.maybe(0.2):
                attributes[key] = value
        split = int(self.rng.integers(0, len(attributes) + 1)) if self.autolimits else 0
        for part in (list(attributes.items())[:split], list(attributes.items())[split:]):
            if part:
                SubElement(self.root, "compiler", dict(part))
        directory = "parts/" if {"meshdir", "assetdir"} & attributes.keys() else ""
        self.files[f"{directory}wedge.obj"] = WEDGE
        self.files[f"{directory}flat.wedge.obj"] = WEDGE.replace("0.3", "0.05")

    def defaults(self) -> None:
        """Adds classes: c1 and c2 in the outer one, c3 in c2. Each has every kind of element, empty or not."""
        self.classes["main"] = {"geom": {}, "joint": {}, "mesh": {}}
        if self.maybe(0.2):
            return
        main = SubElement(self.root, "default", {"class": "main"} if self.maybe(0.3) else {})
        self.fill(main, "main", {"geom": {}, "joint": {}, "mesh": {}})
        around, outer = "main", main
        for name in ("c1", "c2", "c3"):
            if name != "c3":
                around, outer = "main", main
            nested = SubElement(outer, "default", {"class": name})
            self.fill(nested, name, self.classes[around])
            around, outer = name, nested
        if self.maybe(0.2):
            second = SubElement(self.root, "default")
            SubElement(second, "site", size="0.1")

    def fill(self, element: Element, name: str, around: dict[str, dict[str, str]]) -> None:
        geom: dict[str, str] = {}
        if self.maybe(0.4):
            geom["type"] = self.pick(*SIZES)
        if self.maybe(0.4):
            geom["size"] = self.vector(3, 0.05, 0.2)
        if self.maybe(0.3):
            geom |= self.pose(0.5)
        if self.maybe(0.2):
            geom |= {"contype": self.pick("0", "1", "2"), "conaffinity": self.pick("0", "1", "3")}
        if self.maybe(0.3):
            geom |= {"rgba": "1 0 0 1", "friction": "1", "density": "500"}
        joint: dict[str, str] = {}
        if self.maybe(0.3):
            joint["axis"] = self.vector(3)
        if self.maybe(0.2):
            joint["pos"] = self.vector(3)
        if self.maybe(0.3):
            joint["damping"] = "1"
        if self.maybe(0.2):
            joint["limited"] = self.pick("auto", "true")
        if self.maybe(0.2):
            joint["type"] = self.pick("hinge", "slide")
        if self.maybe(0.2) and self.autolimits:
            joint["range"] = "-0.5 0.75"
        if self.maybe(0.1):
            joint["ref"] = "0.1"
        mesh = {"scale": self.vector(3, 0.5, 2)} if self.maybe(0.3) else {}
        found = {"geom": geom, "joint": joint, "mesh": mesh}
        kinds = list(found)
        self.rng.shuffle(kinds)
        for kind in kinds:
            SubElement(element, kind, found[kind])
        self.classes[name] = {kind: _merged(found[kind], around[kind]) for kind in found}

    def assets(self) -> None:
        asset = SubElement(self.root, "asset")
        SubElement(asset, "mesh", file="wedge.obj")
        scale = {"scale": self.vector(3, -2, 2)} if self.maybe() else {}
        cls = {"class": self.pick(*self.classes)} if self.maybe() else {}
        SubElement(asset, "mesh", {"name": "other", "file": "flat.wedge.obj", **scale, **cls, "maxhullvert": "8"})
        SubElement(asset, "texture", name="paint", type="2d", builtin="flat", width="10", height="10", rgb1="1 0 0")
        SubElement(asset, "material", name="paint", texture="paint")

    def geom(self, parent: Element, cls: str, still: bool) -> None:
        attributes: dict[str, str] = {}
        self.geoms += 1
        if parent.tag == "worldbody" or self.maybe(0.8):
            attributes["name"] = f"g{self.geoms}"
        if self.maybe(0.3):
            cls = attributes["class"] = self.pick(*self.classes)
        inherited = self.classes[cls]["geom"]
        if "type" not in inherited or self.maybe(0.6):
            attributes["type"] = self.pick(*SIZES, "mesh", *(("plane",) if still else ()))
            if attributes["type"] == "sphere" and "type" not in inherited and self.maybe():
                del attributes["type"]
        kind = attributes.get("type", inherited.get("type", "sphere"))
        placed = any(key in inherited for key in ("pos", *ORIENTATIONS))
        if kind in ("capsule", "cylinder") and not placed and self.maybe():
            attributes["fromto"] = self.vector(6)
            attributes["size"] = self.vector(1, 0.05, 0.2)
        else:
            attributes |= self.pose(0.5)
            if kind == "plane":
                attributes["size"] = self.pick("1 1 1", "0 0 1")
            elif kind in SIZES and ("size" not in inherited or self.maybe(0.6)):
                attributes["size"] = self.vector(int(self.rng.integers(SIZES[kind], 4)), 0.05, 0.3)
        if kind == "mesh":
            attributes["mesh"] = self.pick("wedge", "other")
        if self.maybe(0.3):
            attributes |= {"contype": self.pick("0", "1", "2", "-1"), "conaffinity": self.pick("0", "1", "3")}
        for key, value in {"group": "3", "margin": "0.001", "rgba": "0 1 0 1", "material": "paint", "condim": "3"}.items():
            if self.maybe(0.1):
                attributes[key] = value
        SubElement(parent, "geom", attributes)

    def joint(self, parent: Element, cls: str, kind: str, name: str) -> None:
        self.joints += 1
        attributes = {"name": name, "type": kind}
        if self.maybe(0.2):
            cls = attributes["class"] = self.pick(*self.classes)
        inherited = self.classes[cls]["joint"]
        if self.maybe(0.6):
            attributes["axis"] = self.vector(3)
        if self.maybe(0.4):
            attributes["pos"] = self.vector(3)
        unit = self.angle(1.0) if kind == "hinge" else 1.0
        if self.maybe(0.3):
            attributes["ref"] = f"{unit * self.rng.uniform(-0.5, 0.5):.6g}"
        needed = (kind == "slide" or inherited.get("limited") == "true") and "range" not in inherited
        if needed or self.maybe(0.7):
            lower, upper = sorted(unit * self.rng.uniform(-2.5, 2.5, 2))
            attributes["range"] = f"{lower - 0.01:.6g} {upper:.6g}"
            if self.maybe(0.3) or not self.autolimits:
                attributes["limited"] = self.pick("true", *(("false",) if kind == "hinge" else ()))
        if inherited.get("type", "hinge") == kind and self.maybe():
            del attributes["type"]
        for key in ("damping", "armature", "stiffness", "springref"):
            if self.maybe(0.1):
                attributes[key] = "0.1"
        SubElement(parent, "joint", attributes)

    def body(self, parent: Element, cls: str, depth: int, still: bool) -> None:
        name = f"b{len(self.bodies)}"
        self.bodies.append(name)
        attributes = {"name": name, **self.pose()}
        free = depth == 0 and self.maybe(0.15)
        if self.maybe(0.2) and not free:
            cls = attributes["childclass"] = self.pick(*self.classes)
        kinds = ["hinge" if self.maybe(0.7) else "slide" for _ in range(int(self.rng.choice([0, 1, 2, 3], p=[0.15, 0.65, 0.1, 0.1])))]
        if free:
            kinds = []
            attributes = {"name": name, "pos": self.vector(3)}
            self.floating[name] = attributes["pos"]
        elif len(kinds) > 1:
            attributes = {key: value for key, value in attributes.items() if key not in ORIENTATIONS}
            if "hinge" in kinds[:-1]:
                attributes.pop("pos", None)
        element = SubElement(parent, "body", attributes)
        if free:
            element.append(Element("freejoint") if self.maybe() else Element("joint", type="free"))
        for kind in kinds:
            self.joint(element, cls, kind, f"j{self.joints}")
            if len(kinds) == 1 and self.joints > 1 and self.maybe(0.15):
                del element[-1].attrib["name"]
        if self.maybe(0.3):
            SubElement(element, "inertial", pos="0 0 0", mass="1", diaginertia="1 1 1")
        still = still and not kinds and not free
        for _ in range(int(self.rng.integers(1, 4))):
            self.geom(element, cls, still)
        if self.maybe(0.1):
            element.set("gravcomp", "1")
        for extra in ("site", "camera", "light"):
            if self.maybe(0.1):
                SubElement(element, extra, name=f"{extra}_{name}")
        while len(self.bodies) < 6 and depth < 4 and self.maybe(0.6):
            self.body(element, cls, depth + 1, still)

    def world(self) -> None:
        for _ in range(1 if self.maybe(0.8) else 2):
            world = SubElement(self.root, "worldbody")
            for _ in range(int(self.rng.integers(0, 3))):
                self.geom(world, "main", True)
            self.body(world, "main", 0, True)
        while not self.joints:
            self.body(world, "main", 0, True)

    def rest(self) -> None:
        """Adds what changes no pair, and an <exclude>."""
        if self.maybe() and len(self.bodies) > 1:
            contact = SubElement(self.root, "contact")
            one, other = self.rng.choice(self.bodies, 2, replace=False)
            SubElement(contact, "exclude", body1=str(one), body2=str(other))
        if self.maybe(0.3):
            SubElement(SubElement(self.root, "equality"), "weld", body1=self.bodies[0], active="false")
        name = next(e.get("name", "") for e in self.root.iter("joint") if "name" in e.attrib)
        if self.maybe(0.3):
            SubElement(SubElement(SubElement(self.root, "tendon"), "fixed", name="t"), "joint", joint=name, coef="1")
        if self.maybe(0.3):
            SubElement(SubElement(self.root, "actuator"), "motor", joint=name, ctrlrange="-1 1", ctrllimited="true")
        if self.maybe(0.3):
            SubElement(SubElement(self.root, "sensor"), "jointpos", joint=name)
        for extra in ("visual", "statistic", "size", "custom", "keyframe", "option"):
            if self.maybe(0.1):
                SubElement(self.root, extra)

    def write(self, directory: Path) -> Path:
        """Writes the files. Some parts are included, also by files that are included."""
        for name, text in self.files.items():
            (directory / name).parent.mkdir(exist_ok=True, parents=True)
            (directory / name).write_text(text)
        for parent in [e for e in self.root.iter() if e.tag in ("mujoco", "body", "default", "asset", "worldbody")][::-1]:
            for child in list(parent):
                if self.maybe(0.05) and child.tag != "include":
                    name = f"{self.pick('', 'more/')}part{self.geoms}_{len(list(directory.rglob('part*')))}.xml"
                    (directory / name).parent.mkdir(exist_ok=True)
                    holder = Element(self.pick("mujoco", "mujocoinclude"))
                    holder.append(child)
                    (directory / name).write_text(ElementTree.tostring(holder, encoding="unicode"))
                    parent[list(parent).index(child)] = Element("include", file=name)
        ElementTree.indent(self.root)
        (directory / "robot.xml").write_text(ElementTree.tostring(self.root, encoding="unicode"))
        return directory / "robot.xml"


def _merged(near: dict[str, str], far: dict[str, str]) -> dict[str, str]:
    turned = any(key in near for key in ORIENTATIONS)
    return {**{key: value for key, value in far.items() if not (turned and key in ORIENTATIONS)}, **near}
