"""One hull for all parts of a link: it holds every part, its pairs are those of the parts, and what cannot be merged is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from certifier.errors import SceneError
from certifier.scene import load_scene
from certifier.scene.draft import draft
from certifier.scene.hull import contains
from tests.certifier.scene.workshop import write

PARTS = """<link name="claw">
  <collision name="a"><origin xyz="0.1 0 0"/><geometry><box size="0.02 0.02 0.2"/></geometry></collision>
  <collision name="b"><origin xyz="-0.1 0 0"/><geometry><cylinder radius="0.02" length="0.2"/></geometry></collision>
  <collision name="ball"><geometry><sphere radius="0.03"/></geometry></collision>{}
</link>
<joint name="on" type="revolute"><parent link="hand"/><child link="claw"/><origin xyz="0.5 0 0"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>"""
MANY = "".join(
    f'<collision name="p{i}"><origin xyz="0 {0.05 * i} 0.2"/><geometry><box size="0.02 0.02 0.02"/></geometry></collision>'
    for i in range(4)
)


def test_a_hull_holds_every_part_and_takes_its_pairs(tmp_path: Path) -> None:
    apart = load_scene(write(tmp_path, more=PARTS.format("")))
    merged = load_scene(write(tmp_path, more=PARTS.format(""), extra="hulls: [arm/claw]\n"))
    assert {g.name for g in merged.geometries if g.body == "arm/claw"} == {"arm/claw/hull", "arm/claw/ball"}
    hull = merged.geometry("arm/claw/hull")
    for name in ("arm/claw/a", "arm/claw/b"):
        assert contains(hull.vertices, apart.geometry(name).vertices)
    assert hull.substitution == f"2 parts -> hull with {len(hull.vertices)} vertices"
    assert hull.inflation >= apart.geometry("arm/claw/b").inflation > 0

    def partners(scene, *names):
        return {other for pair in scene.pairs for name, other in ((pair.a, pair.b), (pair.b, pair.a)) if name in names}

    assert partners(merged, "arm/claw/hull") == partners(apart, "arm/claw/a", "arm/claw/b") - {"arm/claw/a", "arm/claw/b"}
    assert partners(merged, "arm/claw/ball") == partners(apart, "arm/claw/ball")


def test_a_hull_takes_a_name_that_no_part_has(tmp_path: Path) -> None:
    named = PARTS.format("").replace('name="ball"', 'name="hull"')
    scene = load_scene(write(tmp_path, more=named, extra="hulls: [arm/claw]\n"))
    assert {g.name for g in scene.geometries if g.body == "arm/claw"} == {"arm/claw/hull", "arm/claw/hull2"}


@pytest.mark.parametrize(
    ("hulls", "code", "words"),
    [
        ("[arm/clow]", "unknown_name", "did you mean arm/claw"),
        ("[arm/hand]", "few_parts", "two or more"),
        ("arm/claw", "scene_field", "list"),
    ],
)
def test_what_cannot_be_merged_is_said(tmp_path: Path, hulls: str, code: str, words: str) -> None:
    with pytest.raises(SceneError, match=words) as refused:
        load_scene(write(tmp_path, more=PARTS.format(""), extra=f"hulls: {hulls}\n"))
    assert (refused.value.code, (refused.value.field or "").startswith("hulls")) == (code, True)


def test_the_draft_of_a_decomposed_link_asks_for_its_hull(tmp_path: Path) -> None:
    write(tmp_path, more=PARTS.format(MANY))
    made = draft(tmp_path / "arm.urdf", [tmp_path / "room.sdf"], tmp_path / "drafted.yaml", {}, {})
    assert "hulls:\n  - arm/claw  # 6 parts\n" in made.text
    assert made.scene.has_geometry("arm/claw/hull")
    assert np.isfinite(made.scene.geometry("arm/claw/hull").vertices).all()
