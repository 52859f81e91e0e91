"""This module draws the picture of docs/introduction.md: a region of examples/planar_2dof, in the workspace and in s.

``python -m benchmarks.pictures`` grows the region anew and draws it.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull

from benchmarks import catalogue
from benchmarks.outline import outlines
from certifier.growth.options import GrowthOptions
from certifier.jobs import local
from certifier.kinematics import Kinematics
from certifier.model import WORLD, Array, Geometry, Polytope, Scene

EXAMPLE = "planar_2dof"
PICTURE, REGION = (catalogue.ROOT / f"docs/pictures/{EXAMPLE}.{ending}" for ending in ("svg", "json"))

WIDTH, HEIGHT = 1040, 520
TOP, SIDE = 84, 350
"""Both panels begin at TOP and are SIDE pixels high."""
GRID = (181, 131)
OBSTACLES = ("block", "post", "wall")
TURNS = (-120, -90, -45, 0, 45, 90, 120)
"""The axes name these angles, in degrees."""
LABEL = np.array([[0.2, 0.075, 0]])
"""The letter of a configuration is drawn here, in the frame of the last link, beside the link's middle; metres."""
INWARDS = 0.06
"""A configuration is drawn this far inwards from the region's corner, relative to the corner's distance from the middle."""

STYLE = """
svg { --paper: #ffffff; --ink: #24292f; --faint: #8c959f; --grid: #e4e8ec;
  --region: #1f6feb; --arm: #57606a; --block: #c4501b; --post: #8250df; --wall: #2c8a4b }
@media (prefers-color-scheme: dark) { svg { --paper: #0d1117; --ink: #e6edf3; --faint: #8b949e; --grid: #262c36;
  --region: #58a6ff; --arm: #b1bac4; --block: #f0883e; --post: #bc8cff; --wall: #56d364 } }
text { font: 13px sans-serif; fill: var(--ink) } .small { font-size: 11px; fill: var(--faint) } .title { font-weight: bold }
.letter { font-weight: bold; text-anchor: middle } .middle { text-anchor: middle } .end { text-anchor: end }
.halo { stroke: var(--paper); stroke-width: 3px; paint-order: stroke }
.paper { fill: var(--paper) } .grid { stroke: var(--grid) } .frame { fill: none; stroke: var(--faint) }
.block { fill: var(--block) } .post { fill: var(--post) } .wall { fill: var(--wall) } .colliding { fill-opacity: 0.35; fill-rule: evenodd }
.arm { fill: var(--arm); fill-opacity: 0.3; stroke: var(--arm) } .joint { fill: var(--paper); stroke: var(--arm); stroke-width: 1.5 }
.region { fill: var(--region); fill-opacity: 0.25; stroke: var(--region); stroke-width: 2; stroke-linejoin: round }
.dot { fill: var(--ink) } .seed { fill: var(--ink); stroke: var(--paper) }
""".strip()


@dataclass(frozen=True)
class Panel:
    """A panel is a rectangle of the picture, in pixels. It shows a rectangle of the plane, with the second axis upwards."""

    left: float
    top: float
    scale: float
    lower: tuple[float, float]
    upper: tuple[float, float]

    @property
    def right(self) -> float:
        return self.left + self.scale * (self.upper[0] - self.lower[0])

    @property
    def bottom(self) -> float:
        return self.top + self.scale * (self.upper[1] - self.lower[1])

    def __call__(self, points: Array) -> Array:
        """Returns the pixels (k, 2) of points (k, 2)."""
        return np.column_stack(
            [self.left + self.scale * (points[:, 0] - self.lower[0]), self.top + self.scale * (self.upper[1] - points[:, 1])]
        )

    def frame(self) -> str:
        size = f'width="{number(self.right - self.left)}" height="{number(self.bottom - self.top)}"'
        return f'<rect class="frame" x="{number(self.left)}" y="{number(self.top)}" {size}/>'


def grown() -> dict[str, Any]:
    """Grows the example's region. Returns its seed in s, and its half-spaces, joint limits among them."""
    scene, q = catalogue.scene(EXAMPLE), catalogue.seed(EXAMPLE)
    manifest = local.grow(scene, GrowthOptions(seed={"q": q.tolist()})).manifest
    return {"seed": scene.to_s(q).tolist()} | {key: manifest[key] for key in ("halfspace_normals", "halfspace_offsets")}


def polytope(region: dict[str, Any]) -> Polytope:
    """Returns the polytope of the region's half-spaces."""
    return Polytope(np.array(region["halfspace_normals"]), np.array(region["halfspace_offsets"]))


def picture(region: dict[str, Any]) -> str:
    """Returns the region as SVG: the arm at a few of its configurations, and the region among the configurations that collide."""
    scene = catalogue.scene(EXAMPLE)
    kinematics, corners, seed = Kinematics.of(scene), corners_of(polytope(region)), np.array(region["seed"])
    configurations = _shown(corners, seed)
    workspace = Panel(30, TOP, SIDE / 2, (-0.9, -1.0), (1.1, 1.0))
    tangent = Panel(470, TOP, SIDE / float(scene.s_upper[1] - scene.s_lower[1]), pair(scene.s_lower), pair(scene.s_upper))
    size = f'width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}"'
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img">',
        "<title>A certified region of a two-joint arm, in the workspace and in tangent coordinates</title>",
        f"<style>{STYLE}</style>",
        '<rect class="paper" width="100%" height="100%"/>',
        *_workspace(workspace, kinematics, configurations),
        *_tangent(tangent, kinematics, corners, configurations),
        *_legend(),
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def _workspace(panel: Panel, kinematics: Kinematics, configurations: Array) -> Iterator[str]:
    scene = kinematics.scene
    yield f'<text class="title" x="{number(panel.left)}" y="30">What the robot does</text>'
    yield f'<text class="small" x="{number(panel.left)}" y="48">the arm from above at four configurations; the square is 2 m wide</text>'
    yield panel.frame()
    for name in OBSTACLES:
        geometry = _geometry(scene, name)
        points = panel(_flat(kinematics, geometry, configurations[:1])[0])
        if geometry.radius:
            yield f'<circle class="{name}" {_at(points[0])} r="{number(panel.scale * geometry.radius)}"/>'
        else:
            yield f'<polygon class="{name}" points="{listed(points[ConvexHull(points).vertices])}"/>'
    links = _links(scene)
    for s in configurations[::-1, None]:
        for link in links:
            points = panel(_flat(kinematics, link, s)[0])
            yield f'<polygon class="arm" points="{listed(points[ConvexHull(points).vertices])}"/>'
        for link in links:
            (joint,) = panel(kinematics.points(WORLD, link.body, np.zeros((1, 3)), s)[0, :, :2])
            yield f'<circle class="joint" {_at(joint)} r="3.5"/>'
    labels = kinematics.points(WORLD, links[-1].body, LABEL, configurations)[:, 0, :2]
    yield from (_letter(i, x, y) for i, (x, y) in enumerate(panel(labels)))


def _tangent(panel: Panel, kinematics: Kinematics, corners: Array, configurations: Array) -> Iterator[str]:
    yield f'<text class="title" x="{number(panel.left)}" y="30">What is proved: all of the blue polytope is free</text>'
    yield from axes(panel, kinematics.scene)
    yield from colliding(panel, kinematics)
    yield f'<polygon class="region" points="{listed(panel(corners))}"/>'
    yield panel.frame()
    for i, (x, y) in enumerate(panel(configurations)):
        yield f'<circle class="{"dot" if i else "seed"}" {_at((x, y))} r="{3 if i else 5}"/>'
        yield _letter(i, x + 14, y)


def colliding(panel: Panel, kinematics: Kinematics) -> Iterator[str]:
    """Draws the configurations in which the arm touches an obstacle, obstacle by obstacle."""
    along = [np.linspace(low, high, count) for low, high, count in zip(panel.lower, panel.upper, GRID, strict=True)]
    s = np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 2)
    steps = (np.array(panel.upper) - panel.lower) / (np.array(GRID) - 1)
    for name in OBSTACLES:
        loops = outlines(clearance(kinematics, name, s).reshape(GRID))
        path = "".join(f"M{listed(panel(panel.lower + steps * loop))}Z" for loop in loops)
        yield f'<path class="{name} colliding" d="{path}"/>'


def axes(panel: Panel, scene: Scene) -> Iterator[str]:
    """Draws the ticks: s below and on the left, q above and on the right."""
    for value in range(-3, 4):
        x, y = panel(np.array([[value, value]]))[0]
        yield f'<line class="grid" x1="{number(x)}" y1="{number(panel.top)}" x2="{number(x)}" y2="{number(panel.bottom)}"/>'
        yield f'<text class="small middle" x="{number(x)}" y="{number(panel.bottom + 15)}">{_signed(value)}</text>'
        if panel.top < y < panel.bottom:
            yield f'<line class="grid" x1="{number(panel.left)}" y1="{number(y)}" x2="{number(panel.right)}" y2="{number(y)}"/>'
            yield f'<text class="small end" x="{number(panel.left - 6)}" y="{number(y + 4)}">{_signed(value)}</text>'
    for turn in TURNS:
        x, y = panel(scene.to_s(np.radians([turn, turn]))[None])[0]
        yield f'<text class="small middle" x="{number(x)}" y="{number(panel.top - 6)}">{_signed(turn)}°</text>'
        yield f'<text class="small" x="{number(panel.right + 6)}" y="{number(y + 4)}">{_signed(turn)}°</text>'
    middle, across = (panel.left + panel.right) / 2, (panel.top + panel.bottom) / 2
    yield f'<text class="small middle" x="{number(middle)}" y="{number(panel.top - 24)}">angle of the shoulder, q₁</text>'
    yield f'<text class="middle" x="{number(middle)}" y="{number(panel.bottom + 34)}">s₁ = tan(q₁/2)</text>'
    for x, text, kind in ((panel.left - 28, "s₂ = tan(q₂/2)", "middle"), (panel.right + 48, "angle of the elbow, q₂", "small middle")):
        place = f'transform="translate({number(x)} {number(across)}) rotate(-90)"'
        yield f'<text class="{kind}" {place}>{text}</text>'


def _legend() -> Iterator[str]:
    y = HEIGHT - 18
    entries = [
        (30, "region", "certified region"),
        *((180 + 220 * i, f"{name} colliding", f"the arm touches the {name}") for i, name in enumerate(OBSTACLES)),
    ]
    for x, kind, text in entries:
        yield f'<rect class="{kind}" x="{x}" y="{y - 12}" width="22" height="14"/>'
        yield f'<text x="{x + 30}" y="{y}">{text}</text>'
    yield f'<circle class="seed" cx="851" cy="{y - 5}" r="5"/><text x="866" y="{y}">A: the seed, q = q*</text>'


def _letter(index: int, x: float, y: float) -> str:
    """Draws the name of a configuration, with its middle at (x, y)."""
    return f'<text class="letter halo" x="{number(x)}" y="{number(y + 5)}">{"ABCD"[index]}</text>'


def corners_of(region: Polytope) -> Array:
    """Returns the corners (k, 2) of a polytope in the plane, in order around it."""
    rows = [
        np.linalg.solve(region.C[[i, j]], region.d[[i, j]])
        for i, j in itertools.combinations(range(len(region.d)), 2)
        if _meet(region, i, j)
    ]
    inside = np.array([row for row in rows if region.contains(row, tolerance=1e-9)])
    return inside[ConvexHull(inside).vertices]


def _meet(region: Polytope, i: int, j: int) -> bool:
    return abs(float(np.linalg.det(region.C[[i, j]]))) > 1e-9


def _shown(corners: Array, seed: Array) -> Array:
    """Returns the configurations to draw: the seed, one halfway to the leftmost corner, one near it, and one near the lowest corner."""
    ends = corners[[np.argmin(corners[:, 0]), np.argmin(corners[:, 1])]]
    left, low = ends * (1 - INWARDS) + INWARDS * corners.mean(axis=0)
    return np.array([seed, (seed + left) / 2, left, low])


def clearance(kinematics: Kinematics, obstacle: str, s: Array) -> Array:
    """Returns the distance between the arm and an obstacle at the rows of s, (S,) in metres; negative where they overlap.

    Every body is as high above the plane as below it, so the distance is that of the outlines seen from above. It is the largest gap
    along any normal of an edge, or along any line between two vertices.
    """
    fixed = _geometry(kinematics.scene, obstacle)
    B = _flat(kinematics, fixed, s)
    least = np.full(len(s), np.inf)
    for link in _links(kinematics.scene):
        A = _flat(kinematics, link, s)
        gap = np.full(len(s), -np.inf)
        for direction in (*map(_turned, _differences(A, A)), *map(_turned, _differences(B, B)), *_differences(A, B)):
            length = np.linalg.norm(direction, axis=1)
            unit = np.divide(direction, length[:, None], out=np.zeros_like(direction), where=length[:, None] > 1e-9)
            along_a, along_b = (np.einsum("svi,si->sv", points, unit) for points in (A, B))
            apart = np.maximum(along_a.min(axis=1) - along_b.max(axis=1), along_b.min(axis=1) - along_a.max(axis=1))
            gap = np.maximum(gap, np.where(length > 1e-9, apart, -np.inf))
        least = np.minimum(least, gap - link.radius - fixed.radius)
    return least


def _differences(A: Array, B: Array) -> Iterable[Array]:
    return (A[:, i] - B[:, j] for i in range(A.shape[1]) for j in range(B.shape[1]) if A is not B or i < j)


def _turned(direction: Array) -> Array:
    return np.column_stack([-direction[:, 1], direction[:, 0]])


def _flat(kinematics: Kinematics, geometry: Geometry, s: Array) -> Array:
    """Returns the vertices above the plane, seen from above, at the rows of s: (S, v, 2)."""
    upper = geometry.vertices[geometry.vertices[:, 2] >= 0]
    return kinematics.points(WORLD, geometry.body, upper, s)[:, :, :2]


def _links(scene: Scene) -> list[Geometry]:
    return [geometry for geometry in scene.geometries if geometry.name.startswith("arm/")]


def _geometry(scene: Scene, obstacle: str) -> Geometry:
    return scene.geometry(f"obstacles/body/{obstacle}")


def pair(values: Array) -> tuple[float, float]:
    """Returns an array (2,) as a pair."""
    return float(values[0]), float(values[1])


def listed(points: Array) -> str:
    """Writes pixels (k, 2) as SVG lists them."""
    return " ".join(f"{number(x)},{number(y)}" for x, y in points)


def _at(point: Sequence[float]) -> str:
    return f'cx="{number(point[0])}" cy="{number(point[1])}"'


def _signed(value: int) -> str:
    return str(value).replace("-", "&#8722;")


def number(value: float) -> str:
    """Writes a number with two decimals, which hides what differs from machine to machine."""
    return f"{value:.2f}".rstrip("0").rstrip(".")


if __name__ == "__main__":
    REGION.write_text(json.dumps(grown(), indent=1) + "\n", encoding="utf-8")
    PICTURE.write_text(picture(json.loads(REGION.read_text(encoding="utf-8"))), encoding="utf-8")
