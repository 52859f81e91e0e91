"""This module writes models of robots as people ship them. The dimensions are those of real ones, the bodies about the links our own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull

from benchmarks.catalogue import ROOT
from certifier.model import Array

_QUARTER = 1.5708
_ROOM = {"table": ((1.8, 1.8, 0.05), (0.0, 0.0, -0.05)), "crate": ((0.3, 0.3, 0.4), (0.65, 0.4, 0.2))}
"""The size of each box around a robot, and its centre, metres. The robot stands on the table, with a gap."""
_SECTORS, _RINGS = 5, 3
"""A link of the shell arm is a tube, divided into _SECTORS parts around its axis and _RINGS parts along it."""


@dataclass(frozen=True)
class Model:
    """Names the files of a robot and of what stands around it."""

    robot: Path
    world: Path


def write(name: str, directory: Path) -> Model:
    """Writes the files of one of ROBOTS into a directory."""
    robot, world = directory / "robot.urdf", directory / "world.sdf"
    world.write_text(_room(), encoding="utf-8")
    robot.write_text(f'<robot name="{name}">\n{ROBOTS[name](directory)}\n</robot>\n', encoding="utf-8")
    return Model(robot, world)


def _room() -> str:
    """Returns a room in SDFormat whose boxes stand where their poses say."""
    links = [
        f'<link name="{name}"><pose>{_triple(center)} 0 0 0</pose><collision name="box"><geometry><box><size>{_triple(size)}</size></box>'
        "</geometry></collision></link>"
        for name, (size, center) in _ROOM.items()
    ]
    return "\n".join(['<sdf version="1.9"><model name="room">', *links, "</model></sdf>\n"])


def _ur10(_: Path) -> str:
    """Returns an arm with the dimensions of a UR10, whose six joints turn by 2 pi either way."""
    turns = 2 * np.pi
    joints = [
        _joint("shoulder_pan", "base", "shoulder", (0, 0, 0.1273), axis=(0, 0, 1), lower=-turns, upper=turns),
        _joint("shoulder_lift", "shoulder", "upper_arm", (0, 0.2209, 0), (0, _QUARTER, 0), (0, 1, 0), -turns, turns),
        _joint("elbow", "upper_arm", "forearm", (0, -0.1719, 0.612), axis=(0, 1, 0), lower=-turns, upper=turns),
        _joint("wrist_1", "forearm", "wrist_1", (0, 0, 0.5723), (0, _QUARTER, 0), (0, 1, 0), -turns, turns),
        _joint("wrist_2", "wrist_1", "wrist_2", (0, 0.1149, 0), axis=(0, 0, 1), lower=-turns, upper=turns),
        _joint("wrist_3", "wrist_2", "wrist_3", (0, 0, 0.1157), axis=(0, 1, 0), lower=-turns, upper=turns),
    ]
    along_y = (_QUARTER, 0, 0)
    links = [
        _link("base", _cylinder(0.095, 0.07, (0, 0, 0.035))),
        _link("shoulder", _cylinder(0.075, 0.28, (0, 0.09, 0), along_y)),
        _link("upper_arm", _cylinder(0.07, 0.74, (0, 0, 0.306))),
        _link("forearm", _cylinder(0.055, 0.66, (0, 0, 0.286))),
        _link("wrist_1", _cylinder(0.048, 0.16, (0, 0.07, 0), along_y)),
        _link("wrist_2", _cylinder(0.048, 0.16, (0, 0, 0.07))),
        _link("wrist_3", _cylinder(0.045, 0.05, (0, 0.07, 0), along_y)),
    ]
    return "\n".join([*links, *joints])


def _grasp(directory: Path) -> str:
    """Returns the UR10 with a box in its hand."""
    part = _link("part", _box((0.12, 0.1, 0.2), (0, 0.05, 0)))
    return "\n".join([_ur10(directory), part, _joint("held", "wrist_3", "part", (0, 0.1, 0), kind="fixed")])


def _continuous(_: Path) -> str:
    """Returns an arm with the dimensions of a Gen3, of whose seven joints four are continuous."""
    frames = [
        ((0, 0, 0.1564), (2 * _QUARTER, 0, 0), None),
        ((0, 0.0054, -0.1284), (_QUARTER, 0, 0), 2.41),
        ((0, -0.2104, -0.0064), (-_QUARTER, 0, 0), None),
        ((0, 0.0064, -0.2104), (_QUARTER, 0, 0), 2.66),
        ((0, -0.2084, -0.0064), (-_QUARTER, 0, 0), None),
        ((0, 0, -0.1059), (_QUARTER, 0, 0), 2.23),
        ((0, -0.1059, 0), (-_QUARTER, 0, 0), None),
    ]
    joints = [
        _joint(f"joint_{i + 1}", f"link_{i}", f"link_{i + 1}", xyz, rpy, (0, 0, 1), limit and -limit, limit)
        for i, (xyz, rpy, limit) in enumerate(frames)
    ]
    lengths = (0.128, 0.21, 0.21, 0.208, 0.106, 0.106, 0.12)
    links = [_link("link_0", _cylinder(0.05, 0.1, (0, 0, 0.05)))]
    for i, length in enumerate(lengths):
        center, rpy = ((0, 0, -length / 2), (0, 0, 0)) if i % 2 == 0 else ((0, -length / 2, 0), (_QUARTER, 0, 0))
        links.append(_link(f"link_{i + 1}", _cylinder(0.045, length, center, rpy)))
    return "\n".join([*links, *joints])


def _gripper(_: Path) -> str:
    """Returns an arm with the dimensions of a Panda, with a gripper of which one finger mimics the other."""
    frames = [
        ((0, 0, 0.333), (0, 0, 0), -2.8973, 2.8973),
        ((0, 0, 0), (-_QUARTER, 0, 0), -1.7628, 1.7628),
        ((0, -0.316, 0), (_QUARTER, 0, 0), -2.8973, 2.8973),
        ((0.0825, 0, 0), (_QUARTER, 0, 0), -3.0718, -0.0698),
        ((-0.0825, 0.384, 0), (-_QUARTER, 0, 0), -2.8973, 2.8973),
        ((0, 0, 0), (_QUARTER, 0, 0), -0.0175, 3.7525),
        ((0.088, 0, 0), (_QUARTER, 0, 0), -2.8973, 2.8973),
    ]
    joints = [
        _joint(f"joint{i + 1}", f"link{i}", f"link{i + 1}", xyz, rpy, (0, 0, 1), lower, upper)
        for i, (xyz, rpy, lower, upper) in enumerate(frames)
    ]
    along_y = (_QUARTER, 0, 0)
    links = [
        _link("link0", _box((0.24, 0.19, 0.14), (-0.04, 0, 0.07))),
        _link("link1", _cylinder(0.06, 0.28, (0, 0, -0.14))),
        _link("link2", _cylinder(0.06, 0.28, (0, -0.14, 0), along_y)),
        _link("link3", _cylinder(0.06, 0.22, (0.02, 0, -0.08))),
        _link("link4", _cylinder(0.06, 0.28, (-0.06, 0.12, 0), along_y)),
        _link("link5", _cylinder(0.05, 0.3, (0, 0.03, -0.15))),
        _link("link6", _box((0.17, 0.1, 0.1), (0.04, 0, 0))),
        _link("link7", _cylinder(0.045, 0.07, (0, 0, 0.07))),
        _link("hand", _box((0.05, 0.2, 0.06), (0, 0, 0.03))),
        *(_link(f"finger_{side}", _box((0.02, 0.015, 0.05), (0, y, 0.025))) for side, y in (("left", 0.0075), ("right", -0.0075))),
    ]
    joints.append(_joint("mount", "link7", "hand", (0, 0, 0.107), (0, 0, -_QUARTER / 2), kind="fixed"))
    joints.append(_joint("grip", "hand", "finger_left", (0, 0, 0.06), axis=(0, 1, 0), lower=0, upper=0.04, kind="prismatic"))
    mimic = '<mimic joint="grip" multiplier="1" offset="0"/>'
    joints.append(
        _joint("grip_too", "hand", "finger_right", (0, 0, 0.06), axis=(0, -1, 0), lower=0, upper=0.04, kind="prismatic", more=mimic)
    )
    return "\n".join([*links, *joints])


def _spheres(_: Path) -> str:
    """Returns the arm of balls of the examples."""
    text = (ROOT / "examples" / "sphere_arm" / "arm.urdf").read_text(encoding="utf-8")
    return text.partition("<robot")[2].partition(">")[2].rpartition("</robot>")[0]


def _shells(directory: Path) -> str:
    """Returns an arm of seven joints whose links are tubes of convex meshes, 105 in all."""
    links, joints = [_link("link_0", _cylinder(0.09, 0.12, (0, 0, 0.06)))], []
    for i in range(7):
        radius, length = 0.085 - 0.006 * i, 0.2 - 0.01 * i
        geometries = []
        for k, vertices in enumerate(_tube_part(radius, length, part) for part in range(_SECTORS * _RINGS)):
            (directory / f"link_{i + 1}_{k}.obj").write_text(_obj(vertices), encoding="utf-8")
            geometries.append(f'<geometry><mesh filename="link_{i + 1}_{k}.obj"/></geometry>')
        links.append(_link(f"link_{i + 1}", *geometries))
        origin, axis = (0, 0, length + 0.05 if i else 0.16), (0, 1, 0) if i % 2 else (0, 0, 1)
        joints.append(_joint(f"joint_{i + 1}", f"link_{i}", f"link_{i + 1}", origin, axis=axis, lower=-2.5, upper=2.5))
    return "\n".join([*links, *joints])


def _tube_part(radius: float, length: float, part: int) -> Array:
    """Returns the vertices of one convex part of a tube along z that bulges in the middle, (k, 3), metres."""
    sector, ring = divmod(part, _RINGS)
    angles = 2 * np.pi * (sector + np.linspace(0, 1, 6)) / _SECTORS
    points = []
    for z in (length * ring / _RINGS, length * (ring + 1) / _RINGS):
        outer = radius * (1 + 0.15 * np.sin(np.pi * z / length))
        points += [(outer * np.cos(angle), outer * np.sin(angle), z) for angle in angles]
        points += [((outer - 0.02) * np.cos(angle), (outer - 0.02) * np.sin(angle), z) for angle in angles[[0, -1]]]
    return np.array(points)


def _obj(vertices: Array) -> str:
    hull = ConvexHull(vertices)
    lines = [f"v {_triple(vertex)}" for vertex in vertices] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in hull.simplices]
    return "\n".join(lines) + "\n"


def _triple(numbers: ArrayLike) -> str:
    return " ".join(f"{x:.6g}" for x in np.asarray(numbers, dtype=float))


def _link(name: str, *geometries: str) -> str:
    return f'<link name="{name}">{"".join(f"<collision>{geometry}</collision>" for geometry in geometries)}</link>'


def _box(size: tuple[float, ...], center: tuple[float, ...]) -> str:
    return f'<origin xyz="{_triple(center)}"/><geometry><box size="{_triple(size)}"/></geometry>'


def _cylinder(radius: float, length: float, center: tuple[float, ...], rpy: tuple[float, ...] = (0, 0, 0)) -> str:
    origin = f'<origin xyz="{_triple(center)}" rpy="{_triple(rpy)}"/>'
    return f'{origin}<geometry><cylinder radius="{radius:.6g}" length="{length:.6g}"/></geometry>'


def _joint(
    name: str,
    parent: str,
    child: str,
    xyz: tuple[float, ...],
    rpy: tuple[float, ...] = (0, 0, 0),
    axis: tuple[float, ...] = (0, 0, 1),
    lower: float | None = None,
    upper: float | None = None,
    kind: str = "",
    more: str = "",
) -> str:
    """Returns a joint. Without a kind, it is revolute, or continuous without limits."""
    limit = "" if upper is None else f'<limit lower="{lower:.6g}" upper="{upper:.6g}" effort="1" velocity="1"/>'
    kind = kind or ("revolute" if limit else "continuous")
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_triple(xyz)}" rpy="{_triple(rpy)}"/><axis xyz="{_triple(axis)}"/>{limit}{more}</joint>'
    )


ROBOTS: dict[str, Callable[[Path], str]] = {
    "ur10": _ur10,
    "continuous": _continuous,
    "gripper": _gripper,
    "grasp": _grasp,
    "spheres": _spheres,
    "shells": _shells,
}
"""Writes the links and joints of a robot, and the files that they name into a directory."""
