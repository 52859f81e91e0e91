"""Random robots in a neutral form, written as SDFormat in many ways and as MJCF in one."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

WORLD = -1
VERSIONS = ("1.4", "1.5", "1.6", "1.7", "1.8", "1.9", "1.10", "1.11", "1.12")


@dataclass
class Link:
    """A link, the joint above it, and its shapes, all poses at position 0.

    Attributes:
        parent: number of the link that the joint moves this one against.
        X_WL: (4, 4) the link in the world.
        X_LJ: (4, 4) the joint in the link.
        kind: revolute, prismatic, continuous or fixed.
        axis: (3,) a unit vector in the joint's frame.
        shapes: kind, sizes as SDFormat has them, and pose in the link, (4, 4).
    """

    parent: int
    X_WL: np.ndarray
    X_LJ: np.ndarray
    kind: str
    axis: np.ndarray
    lower: float
    upper: float
    shapes: list[tuple[str, list[float], np.ndarray]]


def pose(rng, reach=0.5) -> np.ndarray:
    """A random pose, now and then without a rotation or a translation."""
    X = np.eye(4)
    if rng.random() < 0.8:
        X[:3, :3] = Rotation.random(random_state=rng).as_matrix()
    if rng.random() < 0.8:
        X[:3, 3] = rng.uniform(-reach, reach, 3)
    return X


SIZES = {"box": 3, "sphere": 1, "cylinder": 2, "capsule": 2, "ellipsoid": 3}


def random_robot(rng) -> list[Link]:
    links: list[Link] = []
    for number in range(int(rng.integers(3, 6))):
        parent = int(rng.integers(0, number)) if number else WORLD
        kind = "fixed" if not number else "revolute" if number == 1 else str(rng.choice(["revolute", "prismatic", "continuous", "fixed"]))
        axis = rng.normal(size=3)
        lower, upper = np.sort(rng.uniform(-1.5, 1.5, 2))
        kinds = [str(kind) for kind in rng.choice([*SIZES], size=int(rng.integers(1, 3)))]
        shapes = [(kind, rng.uniform(0.02, 0.2, SIZES[kind]).tolist(), pose(rng, 0.2)) for kind in kinds]
        X_WL = (links[parent].X_WL if number else np.eye(4)) @ pose(rng)
        links.append(Link(parent, X_WL, pose(rng, 0.2), kind, axis / np.linalg.norm(axis), float(lower), float(upper + 0.1), shapes))
    return links


def numbers(values) -> str:
    return " ".join(repr(float(value)) for value in values)


def mjcf(links: list[Link]) -> str:
    """The robot with one joint for each body, link0, link1, ..., and geoms link0/0, link0/1, ..."""

    def body(number: int) -> str:
        link = links[number]
        X = np.linalg.inv(links[link.parent].X_WL) @ link.X_WL if number else link.X_WL
        joint = ""
        if link.kind != "fixed":
            kind = "slide" if link.kind == "prismatic" else "hinge"
            limits = "" if link.kind == "continuous" else f'range="{numbers([link.lower, link.upper])}"'
            axis = numbers(link.X_LJ[:3, :3] @ link.axis)
            joint = f'<joint name="joint{number}" type="{kind}" pos="{numbers(link.X_LJ[:3, 3])}" axis="{axis}" {limits}/>'
        geoms = "".join(geom(f"link{number}/{k}", *shape) for k, shape in enumerate(link.shapes))
        children = "".join(body(k) for k, other in enumerate(links) if other.parent == number)
        return f'<body name="link{number}" {placed(X)}>{joint}{geoms}{children}</body>'

    def geom(name: str, kind: str, sizes: list[float], X: np.ndarray) -> str:
        size = {
            "box": lambda x, y, z: [x / 2, y / 2, z / 2],
            "sphere": lambda r: [r],
            "ellipsoid": lambda a, b, c: [a, b, c],
            "cylinder": lambda r, length: [r, length / 2],
            "capsule": lambda r, length: [r, length / 2],
        }[kind](*sizes)
        return f'<geom name="{name}" type="{kind}" size="{numbers(size)}" {placed(X)}/>'

    def placed(X: np.ndarray) -> str:
        x, y, z, w = Rotation.from_matrix(X[:3, :3]).as_quat()
        return f'pos="{numbers(X[:3, 3])}" quat="{numbers([w, x, y, z])}"'

    return f'<mujoco><compiler angle="radian"/><worldbody>{body(0)}</worldbody></mujoco>'


@dataclass
class Written:
    """A robot as SDFormat.

    Attributes:
        files: by name; the robot is arm.sdf.
        bodies: what ciris calls link0, link1, ...
        joints: what ciris calls joint0, joint1, ...
    """

    files: dict[str, str] = field(default_factory=dict)
    bodies: dict[int, str] = field(default_factory=dict)
    joints: dict[int, str] = field(default_factory=dict)


class SdfWriter:
    """Writes a robot as SDFormat, and chooses at random among the ways that the version has to say the same."""

    def __init__(self, links: list[Link], rng) -> None:
        self._links, self._rng = links, rng
        self._version = str(rng.choice(VERSIONS))
        self._minor = int(self._version.partition(".")[2])
        self._written = Written()
        self._by_joint: set[int] = set()
        """Links whose pose is relative to their joint."""

    def write(self) -> Written:
        rng, links = self._rng, self._links
        inner: list[int] = []
        how = "plain"
        if self._minor >= 8 and rng.random() < 0.7:
            root = int(rng.integers(1, len(links)))
            inner = [k for k in range(len(links)) if self._below(k, root)]
            how = str(rng.choice(["nested", "included", "merged"]))
        outer = [k for k in range(len(links)) if k not in inner]
        X_WM = pose(rng)
        attach = [inner[0]] if inner else []
        frames: dict[str, np.ndarray] = {}
        own = self._links_of(outer, X_WM, frames, "arm")
        parts = self._inner(inner, X_WM, how) if inner else ""
        scope = "" if how == "merged" else "sub::"
        joints = self._joints_of(outer, X_WM, frames, "arm", {}) + self._joints_of(
            attach, X_WM, frames, "arm", dict.fromkeys(attach, scope)
        )
        text = f'<model name="arm">{self._pose(X_WM)}{own}{parts}{joints}</model>'
        if rng.random() < 0.2:
            text = f'<world name="w"><gravity>0 0 -9</gravity>{text}</world>'
        self._written.files["arm.sdf"] = self._file(text)
        return self._written

    def _below(self, number: int, root: int) -> bool:
        while number > root:
            number = self._links[number].parent
        return number == root

    def _file(self, text: str) -> str:
        return f'<?xml version="1.0"?>\n<sdf version="{self._version}">\n{text.replace("><", ">" + chr(10) + "<")}\n</sdf>\n'

    def _inner(self, inner: list[int], X_WM: np.ndarray, how: str) -> str:
        """A part of the tree as a model in the model; its root's joint is the outer model's."""
        X_WN, frames = pose(self._rng), {}
        model = "arm" if how == "merged" else "arm::sub"
        content = self._links_of(inner, X_WN, frames, model) + self._joints_of(inner[1:], X_WN, frames, model, {})
        X_MN, root = np.linalg.inv(X_WM) @ X_WN, f"link{inner[0]}"
        placement = self._rng.random() < 0.4
        place = self._pose(np.linalg.inv(X_WM) @ self._links[inner[0]].X_WL if placement else X_MN, needed=True)
        if how == "nested":
            attribute = f' placement_frame="{root}"' if placement else ""
            return f'<model name="sub"{attribute}>{place}{content}</model>'
        self._written.files["part.sdf"] = self._file(f'<model name="other">{self._pose(pose(self._rng))}{content}</model>')
        merge = ' merge="true"' if how == "merged" else ""
        frame = f"<placement_frame>{root}</placement_frame>" if placement else ""
        return f"<include{merge}><uri>part.sdf</uri><name>sub</name>{place}{frame}</include>"

    def _links_of(self, numbers_: list[int], X_WM: np.ndarray, frames: dict[str, np.ndarray], model: str) -> str:
        """Links of one model; ``frames`` gets what later poses may be relative to, in the model's frame."""
        text = ""
        for number in numbers_:
            link = self._links[number]
            X_ML = np.linalg.inv(X_WM) @ link.X_WL
            by_joint = self._minor >= 7 and number != numbers_[0] and self._rng.random() < 0.3
            if by_joint:
                self._by_joint.add(number)
                place = self._pose(np.linalg.inv(link.X_LJ), relative_to=f"joint{number}")
            else:
                place = self._relative(X_ML, "", np.eye(4), frames)
            around = {**frames, f"link{number}": X_ML}
            shapes = "".join(self._collision(k, shape, X_ML, around) for k, shape in enumerate(link.shapes))
            visual = (
                '<visual name="v"><geometry><sphere><radius>9</radius></sphere></geometry></visual>' if self._rng.random() < 0.5 else ""
            )
            mass = "<inertial><mass>1</mass></inertial>" if self._rng.random() < 0.5 else ""
            text += f'<link name="link{number}">{place}{mass}{shapes}{visual}</link>'
            frames[f"link{number}"] = X_ML
            if self._minor >= 7 and self._rng.random() < 0.4:
                X_LF = pose(self._rng)
                frame = f"frame{number}"
                attached = f' attached_to="link{number}"' if self._rng.random() < 0.7 else ""
                place = self._pose(X_LF) if attached else self._relative(X_ML @ X_LF, "", np.eye(4), frames)
                text += f'<frame name="{frame}"{attached}>{place}</frame>'
                frames[frame] = X_ML @ X_LF
            self._written.bodies[number] = f"{model}/link{number}"
        return text

    def _joints_of(self, numbers_: list[int], X_WM: np.ndarray, frames: dict[str, np.ndarray], model: str, scope: dict[int, str]) -> str:
        text = ""
        for number in numbers_:
            link = self._links[number]
            X_ML = np.linalg.inv(X_WM) @ link.X_WL
            X_MJ = X_ML @ link.X_LJ
            parent = f"link{link.parent}" if number else "world"
            others = {name: X for name, X in frames.items() if name == parent}
            if number in self._by_joint:
                place = self._pose(np.linalg.inv(others[parent]) @ X_MJ, relative_to=parent)
            elif number in scope or not number:
                place = self._pose(link.X_LJ)
            else:
                place = self._relative(X_MJ, f"link{number}", X_ML, others)
            text += f'<joint name="joint{number}" type="{link.kind if self._minor >= 6 or link.kind != "continuous" else "revolute"}">'
            text += f"<parent>{parent}</parent><child>{scope.get(number, '')}link{number}</child>{place}"
            text += ("" if link.kind == "fixed" else self._axis(link, X_MJ, others)) + "</joint>"
            # Drake counts a joint to the model of its child.
            self._written.joints[number] = f"{model}{'::sub' if scope.get(number) else ''}/joint{number}"
        return text

    def _axis(self, link: Link, X_MJ: np.ndarray, others: dict[str, np.ndarray]) -> str:
        limit = "" if link.kind == "continuous" else f"<limit><lower>{link.lower!r}</lower><upper>{link.upper!r}</upper></limit>"
        in_model = X_MJ[:3, :3] @ link.axis
        how, attribute, xyz = "", "", link.axis
        if self._minor == 4:
            xyz = in_model
        elif self._minor in (5, 6) and self._rng.random() < 0.5:
            how, xyz = "<use_parent_model_frame>true</use_parent_model_frame>", in_model
        elif self._minor >= 7 and self._rng.random() < 0.6:
            bases = {"__model__": np.eye(4), **others}
            base = str(self._rng.choice([*bases]))
            attribute, xyz = f' expressed_in="{base}"', bases[base][:3, :3].T @ in_model
        return f"<axis><xyz{attribute}>{numbers(xyz)}</xyz>{how}{limit}</axis>"

    def _collision(self, number: int, shape: tuple[str, list[float], np.ndarray], X_ML: np.ndarray, around: dict[str, np.ndarray]) -> str:
        kind, sizes, X_LG = shape
        names = {"box": ["size"], "sphere": ["radius"], "ellipsoid": ["radii"]}.get(kind, ["radius", "length"])
        values = [numbers(sizes)] if len(names) == 1 else list(map(repr, sizes))
        drakes = self._minor < 9 and kind in ("capsule", "ellipsoid")
        if drakes and kind == "ellipsoid":
            names, values = ["a", "b", "c"], list(map(repr, sizes))
        name = f"drake:{kind}" if drakes else kind
        inside = "".join(f"<{key}>{value}</{key}>" for key, value in zip(names, values, strict=True))
        own = next(name for name, X in around.items() if X is X_ML)
        place = self._relative(X_ML @ X_LG, own, X_ML, around)
        surface = "<surface><contact><collide_bitmask>0</collide_bitmask></contact></surface>" if self._rng.random() < 0.1 else ""
        return f'<collision name="{number}">{place}<geometry><{name}>{inside}</{name}></geometry>{surface}</collision>'

    def _relative(self, X_MT: np.ndarray, default: str, X_MD: np.ndarray, frames: dict[str, np.ndarray]) -> str:
        """A pose relative to any of the frames, or to the one that is meant where none is named."""
        names = [name for name in frames if name != default]
        if self._minor >= 7 and names and self._rng.random() < 0.5:
            base = str(self._rng.choice(names))
            return self._pose(np.linalg.inv(frames[base]) @ X_MT, relative_to=base)
        return self._pose(np.linalg.inv(X_MD) @ X_MT)

    def _pose(self, X: np.ndarray, relative_to: str = "", *, needed: bool = False) -> str:
        attributes = f' relative_to="{relative_to}"' if relative_to else ""
        rotation = Rotation.from_matrix(X[:3, :3])
        if np.array_equal(X, np.eye(4)) and not relative_to and not needed and self._rng.random() < 0.5:
            return str(self._rng.choice(["", "<pose/>"]))
        how = str(self._rng.choice(["rpy", "degrees", "quaternion"])) if self._minor >= 9 else "rpy"
        if how == "quaternion":
            return f'<pose rotation_format="quat_xyzw"{attributes}>{numbers([*X[:3, 3], *rotation.as_quat()])}</pose>'
        if how == "degrees":
            return f'<pose degrees="true"{attributes}>{numbers([*X[:3, 3], *rotation.as_euler("xyz", degrees=True)])}</pose>'
        return f"<pose{attributes}>{numbers([*X[:3, 3], *rotation.as_euler('xyz')])}</pose>"
