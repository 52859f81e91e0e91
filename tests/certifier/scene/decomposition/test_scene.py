"""Scenes with meshes that are decomposed: the names of the parts, their pairs, what is ignored, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from certifier.errors import SceneError
from certifier.model import Pair, Scene
from certifier.scene.bundle import load_bundle, pack_bundle
from certifier.scene.contacts import touching
from certifier.scene.decomposition import parts as asking
from certifier.seeding.free import check_free
from tests.certifier.scene.decomposition.solids import angle
from tests.certifier.scene.workshop import SCENE, parsed, write

ROOM = """<sdf version="1.9"><model name="room"><link name="walls">
  <collision name="corner"><pose>0.255 -0.045 0.25 0 0 0</pose><geometry><mesh><uri>corner.stl</uri><scale>{scale}</scale></mesh></geometry>
  </collision>
  <collision name="wall"><pose>0.6 0 0.3 0 0 0</pose><geometry><box><size>0.1 1 1</size></box></geometry></collision>
</link></model></sdf>"""
DECOMPOSED = "decompose: {room/walls/corner: {threshold: 0.01}}\n"
PARTS = ["room/walls/corner/part1", "room/walls/corner/part2"]
SMALL = '<box size="0.02 0.02 0.02"/>'


def corner(directory: Path, extra: str = DECOMPOSED, scale: str = "1 1 1", shape: str = SMALL, scene: str = SCENE, **more) -> Path:
    """The arm's palm is small, and stands at q = 0 between two plates that meet in an edge."""
    (directory / "corner.stl").write_bytes(angle().export(file_type="stl"))
    return write(directory, scene, extra=extra, shape=shape, files={"room.sdf": ROOM.format(scale=scale)}, **more)


def pairs_of(scene: Scene) -> set[tuple[str, str]]:
    return {(pair.a, pair.b) for pair in scene.pairs}


@pytest.fixture(scope="module")
def decomposed(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return parsed(corner(tmp_path_factory.mktemp("decomposed")))


def test_parts_have_the_pairs_of_their_mesh_and_none_among_them(decomposed: Scene, tmp_path: Path) -> None:
    whole = parsed(corner(tmp_path, ""))
    assert [g.name for g in decomposed.geometries if g.body == "room/walls"] == [*PARTS, "room/walls/wall"]
    rest = {pair for pair in pairs_of(whole) if "room/walls/corner" not in pair}
    assert pairs_of(decomposed) == rest | {("arm/hand/palm", part) for part in PARTS}
    assert {g.shape["of"] for g in decomposed.geometries if g.name in PARTS} == {"room/walls/corner"}
    assert {g.substitution for g in decomposed.geometries if g.name in PARTS} == {"mesh -> 2 convex parts"}
    assert any("room/walls/corner: the hull reaches" in warning for warning in whole.warnings)
    assert not any("corner" in warning for warning in decomposed.warnings)
    assert Scene.from_document(decomposed.to_document()).hash == decomposed.hash


def test_what_is_between_the_plates_is_free(decomposed: Scene, tmp_path: Path) -> None:
    whole = parsed(corner(tmp_path, ""))
    q = np.zeros(1)
    assert [{pair.b for pair in found} for found in touching(whole, [q])] == [{"room/walls/corner"}]
    assert list(touching(decomposed, [q])) == [set()]
    check_free(decomposed, q, "seed")


@pytest.mark.parametrize("pair", ["[arm/hand, room/walls/corner]", "[room/walls/corner, arm/hand/palm]"])
def test_what_ignores_the_mesh_ignores_its_parts(tmp_path: Path, pair: str) -> None:
    scene = parsed(corner(tmp_path, DECOMPOSED + f"ignore: [{{pair: {pair}, reason: known}}]\n"))
    assert not any(name in PARTS for pair in pairs_of(scene) for name in pair)
    assert {ignored.b for ignored in scene.ignored} >= {*PARTS}
    assert {ignored.reason for ignored in scene.ignored} == {"known"}


@pytest.mark.parametrize(
    ("padding", "found"),
    [
        ("{bodies: {room/walls/corner: 0.002}}", (0.002, 0.002)),
        ("{bodies: {room/walls: 0.004, room/walls/corner: 0.002, room/walls/corner/part1: 0.003}}", (0.003, 0.002)),
        ("{pairs: [{pair: [room/walls/corner, arm/hand], padding: 0.001}]}", (0.001, 0.001)),
    ],
)
def test_what_pads_the_mesh_pads_its_parts(tmp_path: Path, padding: str, found: tuple[float, float]) -> None:
    scene = parsed(corner(tmp_path, DECOMPOSED + f"padding: {padding}\n"))
    assert tuple(scene.padding_of(Pair("arm/hand/palm", part)) for part in PARTS) == found


def test_one_part_can_be_ignored(tmp_path: Path) -> None:
    scene = parsed(corner(tmp_path, DECOMPOSED + f"ignore: [[arm/hand/palm, {PARTS[0]}]]\n"))
    assert ("arm/hand/palm", PARTS[1]) in pairs_of(scene)
    assert [ignored.b for ignored in scene.ignored] == [PARTS[0]]


def test_a_mesh_that_is_scaled_and_mirrored_is_decomposed_as_it_stands(tmp_path: Path) -> None:
    scene = parsed(corner(tmp_path, "decompose: {room/walls/corner: {threshold: 0.02}}\n", "-2 1.5 2"))
    vertices = np.concatenate([g.vertices for g in scene.geometries if g.shape["kind"] == "part"])
    assert vertices.min(axis=0) == pytest.approx([0.055, -0.045, 0.25], abs=1e-4)
    assert vertices.max(axis=0) == pytest.approx([0.255, 0.105, 0.45], abs=1e-4)


def test_a_half_space_reaches_as_far_as_the_parts(tmp_path: Path) -> None:
    (tmp_path / "floor.sdf").write_text(
        '<sdf version="1.9"><model name="f"><link name="l"><collision name="p"><geometry><plane><normal>0 0 1</normal></plane></geometry>'
        "</collision></link></model></sdf>"
    )
    floor = "  - add_model: {name: f, file: floor.sdf}\n  - add_weld: {parent: world, child: f::l, X_PC: {translation: [0, 0, -3]}}\n"
    moved = '<mesh filename="corner.stl" scale="20 20 20"/>'
    scene = parsed(corner(tmp_path, "decompose: {arm/hand/palm: {threshold: 0.2}}\n", shape=moved, scene=SCENE + floor))
    reach = max(float(np.linalg.norm(g.vertices, axis=1).max()) for g in scene.geometries if g.body == "arm/hand")
    assert np.abs(scene.geometry("f/l/p").vertices[:, :2]).min() >= reach


def test_a_name_that_another_geometry_has_is_not_given_twice(tmp_path: Path) -> None:
    path = corner(tmp_path)
    room = (tmp_path / "room.sdf").read_text().replace('name="wall"', 'name="corner/part1"')
    (tmp_path / "room.sdf").write_text(room)
    names = [g.name for g in parsed(path).geometries if g.body == "room/walls"]
    assert names == ["room/walls/corner/part12", "room/walls/corner/part2", "room/walls/corner/part1"]


def test_a_bundle_gives_the_scene_that_the_file_gives(decomposed: Scene, tmp_path: Path) -> None:
    """Two processes find the same parts, to the last bit."""
    assert load_bundle(pack_bundle(corner(tmp_path))).scene.hash == decomposed.hash


@pytest.mark.parametrize(
    ("extra", "code", "field", "words"),
    [
        ("decompose: {room/walls/corner: {}}", "scene_field", "decompose.room/walls/corner.threshold", "must be a number"),
        ("decompose: {room/walls/corner: {threshold: 0}}", "scene_field", "decompose.room/walls/corner.threshold", "at least 1e-05"),
        ("decompose: {room/walls/corner: {treshold: 1}}", "scene_field", "decompose.room/walls/corner.treshold", "did you mean threshold"),
        ("decompose: {room/walls/corner: 0.01}", "scene_field", "decompose.room/walls/corner", "must be a mapping"),
        ("decompose: [room/walls/corner]", "scene_field", "decompose", "must map"),
        ("decompose: {room/walls/korner: {threshold: 1}}", "unknown_name", "decompose.room/walls/korner", "did you mean room/walls/corner"),
        ("decompose: {room/walls/wall: {threshold: 1}}", "decompose", "decompose.room/walls/wall", "only meshes"),
        (DECOMPOSED + "hulls: [room/walls]", "scene_field", "hulls[0]", "room/walls/corner, which is decomposed"),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path: Path, extra: str, code: str, field: str, words: str) -> None:
    with pytest.raises(SceneError) as refused:
        parsed(corner(tmp_path, f"{extra}\n"))
    assert (refused.value.code, refused.value.field) == (code, field)
    assert words in str(refused.value)


def test_an_open_mesh_is_refused_by_its_name(tmp_path: Path) -> None:
    path = corner(tmp_path)
    open_mesh = angle()
    open_mesh.update_faces(np.arange(len(open_mesh.faces) - 1))
    (tmp_path / "corner.stl").write_bytes(open_mesh.export(file_type="stl"))
    with pytest.raises(SceneError, match=r"room/walls/corner: the mesh bounds no solid: it is open: 3 of its 30 edges") as refused:
        parsed(path)
    assert (refused.value.code, refused.value.field) == ("decompose", "decompose.room/walls/corner")


def test_what_takes_too_long_is_refused_with_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = corner(tmp_path)
    monkeypatch.setattr(asking, "DECOMPOSE_S", 0.01)
    with pytest.raises(SceneError, match=r"room/walls/corner: it took more than 0.01 s") as refused:
        parsed(path)
    assert (refused.value.code, refused.value.field) == ("decompose", "decompose.room/walls/corner")
    assert "a larger threshold, or use a mesh of fewer triangles" in refused.value.hint
