"""This module draws the picture of docs/covering.md: the free configurations of examples/planar_2dof, covered by certified regions.

``python -m benchmarks.cover_picture`` covers the example anew and draws it.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

from benchmarks import catalogue, cover
from benchmarks.pictures import OBSTACLES, SIDE, STYLE, TOP, Panel, axes, colliding, corners_of, listed, number, pair, polytope
from benchmarks.service import running
from certifier.kinematics import Kinematics
from ciris.synchronous.client import Client

EXAMPLE, PROCESSES = "planar_2dof", 2
PATIENCE_S = 1800.0
"""The goals end the cover long before this."""
PICTURE, REGIONS = (catalogue.ROOT / f"docs/pictures/cover.{ending}" for ending in ("svg", "json"))
WIDTH, HEIGHT = 620, 520
THIN = ".region { fill-opacity: 0.16; stroke-width: 1.2 }"


def grown() -> dict[str, Any]:
    """Covers the example. Returns the half-spaces of the regions, joint limits among them, and how much they cover."""
    case = cover.CASES[EXAMPLE]
    with tempfile.TemporaryDirectory() as directory, running(Path(directory) / "data", PROCESSES) as service, Client(service.url) as client:
        found, _ = cover.covered(client, case, case.options, PATIENCE_S, lambda line: None)
        manifests = [client.region(region)["manifest"] for region in found["regions"]]
    kept = ("halfspace_normals", "halfspace_offsets")
    return {"coverage": found["coverage"], "regions": [{name: manifest[name] for name in kept} for manifest in manifests]}


def picture(covered: dict[str, Any]) -> str:
    """Returns the regions as SVG, among the configurations that collide."""
    kinematics = Kinematics.of(catalogue.scene(EXAMPLE))
    scene = kinematics.scene
    panel = Panel(70, TOP, SIDE / float(scene.s_upper[1] - scene.s_lower[1]), pair(scene.s_lower), pair(scene.s_upper))
    corners = [corners_of(polytope(region)) for region in covered["regions"]]
    share = f"{100 * covered['coverage']['value']:.1f} ± {100 * covered['coverage']['stderr']:.1f} % of the free configurations"
    size = f'width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}"'
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img">',
        "<title>The free configurations of a two-joint arm, covered by certified regions</title>",
        f"<style>{STYLE}\n{THIN}</style>",
        '<rect class="paper" width="100%" height="100%"/>',
        f'<text class="title" x="{number(panel.left)}" y="30">{len(corners)} certified regions hold {share}</text>',
        *axes(panel, scene),
        *colliding(panel, kinematics),
        *(f'<polygon class="region" points="{listed(panel(points))}"/>' for points in corners),
        panel.frame(),
        *_legend(),
        "</svg>",
    ]
    return "\n".join(lines) + "\n"


def _legend() -> list[str]:
    y = HEIGHT - 18
    entries = [
        (30, "region", "certified"),
        *((150 + 155 * i, f"{name} colliding", f"touches the {name}") for i, name in enumerate(OBSTACLES)),
    ]
    return [
        f'<rect class="{kind}" x="{x}" y="{y - 12}" width="22" height="14"/><text x="{x + 30}" y="{y}">{text}</text>'
        for x, kind, text in entries
    ]


if __name__ == "__main__":
    REGIONS.write_text(json.dumps(grown(), indent=1) + "\n", encoding="utf-8")
    PICTURE.write_text(picture(json.loads(REGIONS.read_text(encoding="utf-8"))), encoding="utf-8")
