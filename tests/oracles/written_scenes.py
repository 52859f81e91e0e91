"""Random arms among obstacles, written as files by hand: URDF, SDFormat or MJCF, with meshes, primitives and `hulls`."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from certifier.model import Array

FORMATS = ("urdf", "sdf", "xml")


@dataclass
class Shape:
    """A collision geometry; ``size`` is (x, y, z) of a box, (radius,) of a sphere, (radius, length) of others, or of a mesh its file."""

    name: str
    kind: str
    size: tuple[float, ...]
    xyz: Array
    rpy: Array
    file: str = ""


@dataclass
class Link:
    """A link and the joint above it, which has the link's frame; the axis is in that frame. The first link is fixed."""

    name: str
    kind: str = "fixed"
    xyz: Array = field(default_factory=lambda: np.zeros(3))
    rpy: Array = field(default_factory=lambda: np.zeros(3))
    axis: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    limits: tuple[float, float] = (0.0, 0.0)
    shapes: list[Shape] = field(default_factory=list)


def write_scene(directory: Path, rng: np.random.Generator, joints: int) -> Path:
    """Writes a random scene of an arm of this many joints in a room of obstacles, and returns the path of its scene file."""
    directory.mkdir(parents=True, exist_ok=True)
    arm, room = _arm(directory, rng, joints), _room(directory, rng)
    formats = [FORMATS[k] for k in rng.integers(len(FORMATS), size=2)]
    for name, links, kind in zip(("arm", "room"), (arm, room), formats, strict=True):
        text = {"urdf": _urdf, "sdf": _sdf, "xml": _mjcf}[kind](name, links)
        (directory / f"{name}.{kind}").write_text(text)
    many = [link.name for link in arm[1:] if sum(shape.kind in ("box", "cylinder", "mesh") for shape in link.shapes) > 1]
    padding = (0.0, 0.0, 0.002, 0.01)[rng.integers(4)]
    lines = ["name: random", "directives:"]
    for name, root, kind in zip(("arm", "room"), ("l0", "walls"), formats, strict=True):
        lines.append(f"  - add_model: {{name: {name}, file: {name}.{kind}}}")
        if kind != "xml":  # MJCF's bodies stand in its world
            lines.append(f"  - add_weld: {{parent: world, child: {name}::{root}}}")
    lines.append(f"padding: {_padding(padding, arm[-1].name, rng.spawn(1)[0])}")
    if many:
        lines.append(f"hulls: [{', '.join(f'arm/{name}' for name in many)}]")
    path = directory / "scene.yaml"
    path.write_text("\n".join(lines) + "\n")
    return path


def _padding(usual: float, hand: str, rng: np.random.Generator) -> str:
    """Returns what the scene file says of padding: one number, or others for the last link and for the room, smaller or larger."""
    own = {body: float(rng.choice([0.0, 0.001, 0.02])) for body in (f"arm/{hand}", "room/walls") if rng.random() < 0.5}
    return f"{{default: {usual}, bodies: {{{', '.join(f'{body}: {padding}' for body, padding in own.items())}}}}}" if own else str(usual)


def _arm(directory: Path, rng: np.random.Generator, joints: int) -> list[Link]:
    links = [Link("l0", shapes=[_shape(directory, rng, "base", (0.08, 0.15), np.zeros(3))])]
    for i in range(1, joints + 1):
        kind = ("revolute", "revolute", "revolute", "continuous", "prismatic")[rng.integers(5)]
        low, high = (
            (-rng.uniform(0.05, 0.4), rng.uniform(0.05, 0.4)) if kind == "prismatic" else (-rng.uniform(1, 2.9), rng.uniform(1, 2.9))
        )
        axis = np.eye(3)[rng.integers(3)] if rng.random() < 0.6 else rng.normal(size=3)
        length = rng.uniform(0.15, 0.35)
        xyz = np.array([0.0, 0.0, 0.15]) if i == 1 else np.array([0.0, 0.0, length])
        rpy = np.zeros(3) if rng.random() < 0.4 else rng.uniform(-0.8, 0.8, 3)
        count = (1, 1, 1, 1, 2, 3)[rng.integers(6)]
        shapes = [
            _shape(directory, rng, f"g{i}_{k}", (0.03, 0.1), np.array([*rng.uniform(-0.03, 0.03, 2), 0.08 + 0.07 * k]))
            for k in range(count)
        ]
        links.append(Link(f"l{i}", kind, xyz, rpy, axis / np.linalg.norm(axis), (low, high), shapes))
    return links


def _room(directory: Path, rng: np.random.Generator) -> list[Link]:
    shapes = []
    for k in range(rng.integers(2, 7)):
        way = rng.normal(size=3)
        way[2] = abs(way[2]) - 0.2
        shapes.append(_shape(directory, rng, f"o{k}", (0.1, 0.5), rng.uniform(0.55, 1.2) * way / np.linalg.norm(way)))
    return [Link("walls", shapes=shapes)]


def _shape(directory: Path, rng: np.random.Generator, name: str, sizes: tuple[float, float], xyz: Array) -> Shape:
    kind = ("box", "sphere", "cylinder", "capsule", "mesh", "mesh")[rng.integers(6)]
    size = tuple(rng.uniform(*sizes, {"box": 3, "sphere": 1, "mesh": 3}.get(kind, 2)).tolist())
    if kind != "box" and kind != "mesh":
        size = (size[0] / 2, *size[1:])
    rpy = rng.uniform(-1.5, 1.5, 3)
    if kind != "mesh":
        return Shape(name, kind, size, xyz, rpy)
    file = f"{name}.obj"
    vertices, triangles = _concave(rng) if rng.random() < 0.5 else _convex(rng)
    rows = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices * np.array(size)]
    (directory / file).write_text("\n".join([*rows, *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles)]) + "\n")
    return Shape(name, kind, size, xyz, rpy, file)


def _convex(rng: np.random.Generator) -> tuple[Array, Array]:
    """The hull of random points: vertices (v, 3) and triangles that see outwards."""
    points = rng.normal(size=(rng.integers(6, 40), 3))
    points *= 0.5 / np.linalg.norm(points, axis=1, keepdims=True)
    hull = ConvexHull(points)
    points, triangles = points[hull.vertices], np.searchsorted(np.sort(hull.vertices), hull.simplices)
    return points, _outwards(points, triangles, hull.equations[:, :3])


def _outwards(points: Array, triangles: Array, normals: Array) -> Array:
    a, b, c = (points[triangles[:, k]] for k in range(3))
    inwards = np.einsum("ti,ti->t", np.cross(b - a, c - a), normals) < 0
    return np.where(inwards[:, None], triangles[:, ::-1], triangles)


def _concave(rng: np.random.Generator) -> tuple[Array, Array]:
    """A prism over a star of random radii: vertices (v, 3) and triangles that see outwards."""
    k = int(rng.integers(4, 8)) * 2
    angles = 2 * np.pi * np.arange(k) / k
    radii = np.where(np.arange(k) % 2, rng.uniform(0.1, 0.3, k), rng.uniform(0.35, 0.5, k))
    ring = np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])
    ends = [np.column_stack([np.vstack([ring, [[0, 0]]]), np.full(k + 1, z)]) for z in (-0.5, 0.5)]
    triangles = []
    for i in range(k):
        j, up = (i + 1) % k, k + 1
        triangles += [(k, j, i), (up + k, up + i, up + j), (i, j, up + j), (i, up + j, up + i)]
    return np.vstack(ends), np.array(triangles)


def _numbers(values: Array | tuple[float, ...]) -> str:
    return " ".join(f"{x:.9g}" for x in values)


def _urdf(model: str, links: list[Link]) -> str:
    sizes = {
        "box": lambda s: f'<box size="{_numbers(s.size)}"/>',
        "sphere": lambda s: f'<sphere radius="{s.size[0]:.9g}"/>',
        "cylinder": lambda s: f'<cylinder radius="{s.size[0]:.9g}" length="{s.size[1]:.9g}"/>',
        "capsule": lambda s: f'<capsule radius="{s.size[0]:.9g}" length="{s.size[1]:.9g}"/>',
        "mesh": lambda s: f'<mesh filename="{s.file}"/>',
    }
    lines = [f'<robot name="{model}">']
    for link in links:
        lines.append(f'<link name="{link.name}">')
        for s in link.shapes:
            origin = f'<origin xyz="{_numbers(s.xyz)}" rpy="{_numbers(s.rpy)}"/>'
            lines.append(f'  <collision name="{s.name}">{origin}<geometry>{sizes[s.kind](s)}</geometry></collision>')
        lines.append("</link>")
    for above, link in itertools.pairwise(links):
        limits = "" if link.kind == "continuous" else f'lower="{link.limits[0]:.9g}" upper="{link.limits[1]:.9g}" '
        lines += [
            f'<joint name="j{link.name}" type="{link.kind}"><parent link="{above.name}"/><child link="{link.name}"/>',
            f'  <origin xyz="{_numbers(link.xyz)}" rpy="{_numbers(link.rpy)}"/><axis xyz="{_numbers(link.axis)}"/>',
            f'  <limit {limits}effort="1" velocity="1"/></joint>',
        ]
    return "\n".join([*lines, "</robot>"]) + "\n"


def _sdf(model: str, links: list[Link]) -> str:
    sizes = {
        "box": lambda s: f"<box><size>{_numbers(s.size)}</size></box>",
        "sphere": lambda s: f"<sphere><radius>{s.size[0]:.9g}</radius></sphere>",
        "cylinder": lambda s: f"<cylinder><radius>{s.size[0]:.9g}</radius><length>{s.size[1]:.9g}</length></cylinder>",
        "capsule": lambda s: f"<capsule><radius>{s.size[0]:.9g}</radius><length>{s.size[1]:.9g}</length></capsule>",
        "mesh": lambda s: f"<mesh><uri>{s.file}</uri></mesh>",
    }
    lines = ['<sdf version="1.9">', f'<model name="{model}">']
    for i, link in enumerate(links):
        pose = f' relative_to="{links[i - 1].name}"' if i else ""
        lines.append(f'<link name="{link.name}"><pose{pose}>{_numbers([*link.xyz, *link.rpy])}</pose>')
        for s in link.shapes:
            origin = f"<pose>{_numbers([*s.xyz, *s.rpy])}</pose>"
            lines.append(f'  <collision name="{s.name}">{origin}<geometry>{sizes[s.kind](s)}</geometry></collision>')
        lines.append("</link>")
    for above, link in itertools.pairwise(links):
        limits = (
            "" if link.kind == "continuous" else f"<limit><lower>{link.limits[0]:.9g}</lower><upper>{link.limits[1]:.9g}</upper></limit>"
        )
        lines += [
            f'<joint name="j{link.name}" type="{link.kind}"><parent>{above.name}</parent><child>{link.name}</child>',
            f"  <axis><xyz>{_numbers(link.axis)}</xyz>{limits}</axis></joint>",
        ]
    return "\n".join([*lines, "</model>", "</sdf>"]) + "\n"


def _mjcf(model: str, links: list[Link]) -> str:
    meshes = [s.file for link in links for s in link.shapes if s.kind == "mesh"]
    lines = [f'<mujoco model="{model}">', '<compiler angle="radian" autolimits="false"/>', "<asset>"]
    lines += [f'  <mesh name="{file.removesuffix(".obj")}" file="{file}"/>' for file in meshes]
    lines += ["</asset>", "<worldbody>"]
    for link in links:
        lines.append(f'<body name="{link.name}" pos="{_numbers(link.xyz)}" quat="{_quaternion(link.rpy)}">')
        if link.kind != "fixed":
            kind = "slide" if link.kind == "prismatic" else "hinge"
            limits = 'limited="false"' if link.kind == "continuous" else f'limited="true" range="{_numbers(link.limits)}"'
            lines.append(f'  <joint name="j{link.name}" type="{kind}" axis="{_numbers(link.axis)}" {limits}/>')
        for s in link.shapes:
            half = s.size[:1] if s.kind == "sphere" else [x / 2 for x in s.size] if s.kind == "box" else [s.size[0], s.size[-1] / 2]
            what = f'mesh="{s.file.removesuffix(".obj")}"' if s.kind == "mesh" else f'size="{_numbers(half)}"'
            lines.append(f'  <geom name="{s.name}" type="{s.kind}" {what} pos="{_numbers(s.xyz)}" quat="{_quaternion(s.rpy)}" mass="1"/>')
    return "\n".join([*lines, *["</body>"] * len(links), "</worldbody>", "</mujoco>"]) + "\n"


def _quaternion(rpy: Array) -> str:
    x, y, z, w = Rotation.from_euler("xyz", rpy).as_quat()
    return _numbers((w, x, y, z))
