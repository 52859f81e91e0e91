"""A draft allows polytopes the vertices that they need, and offers to decompose meshes that are not convex."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import trimesh

from certifier.scene.draft import Draft, draft
from certifier.scene.load import load_scene
from tests.certifier.scene.decomposition.solids import angle
from tests.certifier.scene.test_draft import CARRIED, U
from tests.certifier.scene.workshop import ARM, LIMIT

OFFER = "# decompose:\n#   arm/base/tub: {threshold: 0.02}"


def corner() -> trimesh.Trimesh:
    """Two plates that meet in an edge. The ball of CARRIED is between them, and in their hull."""
    made = angle()
    made.apply_scale(3)
    made.apply_translation([-0.15, -0.15, -0.1])
    return made


def drafted(directory: Path, tub: trimesh.Trimesh | str, z: float = 0.03) -> Draft:
    """A draft of an arm whose base is a mesh; a ball on its second link turns above it."""
    text = tub if isinstance(tub, str) else tub.export(file_type="obj", include_normals=False)
    (directory / "tub.obj").write_text(text)
    (directory / "arm.urdf").write_text(CARRIED.format(z=z))
    return draft(directory / "arm.urdf", [], directory / "scene.yaml", {})


def test_what_overlaps_as_a_hull_only_is_offered_and_certified_once_it_is_taken(tmp_path: Path) -> None:
    made = drafted(tmp_path, corner())
    assert [(pair.a, pair.b) for pair in made.ignored] == [("arm/ball/ball", "arm/base/tub")]
    assert OFFER in made.text
    assert "have the mesh decomposed (above)" in made.text
    taken = re.sub(r"# (decompose:|  arm/base/tub)", r"\1", made.text)
    path = tmp_path / "taken.yaml"
    path.write_text(taken[: taken.index("# These overlap at all")])
    scene = load_scene(path)
    parts = [g.name for g in scene.geometries if g.body == "arm/base"]
    assert len(parts) > 1
    assert {(pair.a, pair.b) for pair in scene.pairs} == {("arm/ball/ball", part) for part in parts}
    assert not any("overlap in every configuration" in warning for warning in scene.warnings)


def test_a_mesh_that_bounds_no_solid_is_offered_when_it_is_mended(tmp_path: Path) -> None:
    text = drafted(tmp_path, U, z=0.15).text
    assert "# To decompose arm/base/tub, mend its mesh first: it is open: 4 of its " in text
    assert "# decompose:" not in text


def test_a_mesh_that_is_convex_is_not_offered(tmp_path: Path) -> None:
    text = drafted(tmp_path, trimesh.creation.box((0.2, 0.2, 0.2)), z=1.0).text
    assert "decompose" not in text
    assert "max_vertices" not in text


@pytest.mark.parametrize(("radius", "most"), [(0.02, None), (0.05, 128), (1.5, 128)])
def test_a_polytope_gets_the_vertices_that_it_needs(tmp_path: Path, radius: float, most: int | None) -> None:
    ball = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    (tmp_path / "ball.obj").write_text(ball.export(file_type="obj", include_normals=False))
    (tmp_path / "arm.urdf").write_text(ARM.format(kind="revolute", limit=LIMIT, shape='<mesh filename="ball.obj"/>', more=""))
    made = draft(tmp_path / "arm.urdf", [], tmp_path / "scene.yaml", {})
    palm = made.scene.geometry("arm/hand/palm")
    said = re.search(r"mesh: \{max_vertices: (\d+)\}", made.text)
    if most is None:
        assert said is None
        assert 0 < palm.inflation <= 0.005
    else:
        assert said is not None
        assert 32 < int(said[1]) <= most
        assert len(palm.vertices) <= int(said[1])
        assert palm.inflation < 0.006 or most == 128
        assert f"With 32 vertices, {palm.name} would reach" in made.text
