"""The parts hold the mesh and its inside: trimesh and exact fractions are the oracles. What bounds no solid is refused."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from certifier.errors import SceneError
from certifier.scene.decomposition import child
from certifier.scene.decomposition.child import enlarged
from certifier.scene.decomposition.containment import Part, uncovered
from certifier.scene.decomposition.solid import closed, fault, inside, solids, wound
from certifier.scene.hull import contains
from tests.certifier.scene.decomposition.solids import angle, bin_mesh, cube, parts_of, torus


def held(parts: list[dict], points: np.ndarray) -> np.ndarray:
    """Which points are in a part, up to a nanometre, by trimesh's half-spaces."""
    hulls = [trimesh.Trimesh(part["vertices"]).convex_hull for part in parts]
    depth = [((points[:, None] - hull.triangles_center) * hull.face_normals).sum(axis=2).max(axis=1) for hull in hulls]
    return np.min(depth, axis=0) <= 1e-9


@pytest.fixture(scope="module", params=["bin", pytest.param("torus", marks=pytest.mark.slow)])
def decomposed(request: pytest.FixtureRequest) -> tuple[trimesh.Trimesh, list[dict]]:
    mesh, threshold = {"bin": (bin_mesh(), 0.02), "torus": (torus(), 0.02)}[request.param]
    return mesh, parts_of(mesh, threshold)


def test_the_parts_hold_every_triangle_exactly(decomposed) -> None:
    mesh, parts = decomposed
    assert uncovered([Part(part["vertices"]) for part in parts], mesh.vertices.view(np.ndarray), mesh.faces.view(np.ndarray)) == []
    surface, _ = trimesh.sample.sample_surface(mesh, 5000, seed=0)
    assert held(parts, surface).all()


def test_the_parts_hold_the_inside_and_leave_the_opening_free(decomposed) -> None:
    mesh, parts = decomposed
    spots = np.random.default_rng(0).uniform(*mesh.bounds, (20_000, 3))
    within = mesh.contains(spots)
    taken = held(parts, spots)
    assert within.any()
    assert taken[within].all()
    assert taken[~within].mean() < 0.1 < 0.5 < (~within).mean()
    assert sum(ConvexHull(part["vertices"]).volume for part in parts) < 1.3 * mesh.volume


def test_how_far_parts_reach_is_said(decomposed) -> None:
    mesh, parts = decomposed
    closest = trimesh.proximity.ProximityQuery(mesh)
    for part in parts:
        hull = ConvexHull(part["vertices"])
        spots, _ = trimesh.sample.sample_surface(trimesh.Trimesh(part["vertices"], hull.simplices), 300, seed=1)
        outside = spots[~mesh.contains(spots)]
        farthest = -closest.signed_distance(outside).min() if len(outside) else 0.0
        assert part["beyond"] <= 0.02
        assert farthest <= part["beyond"] + 0.004


def test_fewer_vertices_hold_the_mesh_as_well(decomposed) -> None:
    mesh, parts = decomposed
    points, triangles = np.array(mesh.vertices), np.array(mesh.faces)
    found = enlarged([part["vertices"] for part in parts], points, triangles, [], 9)
    assert max(len(vertices) for vertices, _ in found) <= 9
    assert max(inflation for _, inflation in found) > 0
    assert uncovered([Part(vertices) for vertices, _ in found], points, triangles) == []


@pytest.mark.parametrize("lost", [0, 6])
def test_what_parts_leave_out_goes_to_the_nearest_one(lost: int) -> None:
    """A cube is cut into slices, one of which is lost."""
    mesh = cube()
    edges = np.linspace(-0.1, 0.1, 14)
    slices = [np.array([[x, y, z] for x in edges[k : k + 2] for y in (-0.1, 0.1) for z in (-0.1, 0.1)]) for k in range(13)]
    del slices[lost]
    points, triangles = np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64)
    found = [vertices for vertices, _ in enlarged(slices, points, triangles, [inside(points, triangles, 0.3)[::50]], 64)]
    assert uncovered([Part(vertices) for vertices in found], points, triangles) == []
    spots = np.random.default_rng(1).uniform(-0.1, 0.1, (5000, 3))
    assert held([{"vertices": vertices} for vertices in found], spots).mean() > 0.999


def test_solids_that_overlap_are_decomposed_one_by_one() -> None:
    two = trimesh.util.concatenate([cube(), cube(0.1)])
    parts = parts_of(two, 0.01)
    assert [len(part["vertices"]) for part in parts] == [8, 8]


def test_a_hollow_stays_with_the_solid_around_it() -> None:
    hollow = cube(side=0.1)
    hollow.invert()
    shell = trimesh.util.concatenate([cube(), hollow])
    points, triangles = np.array(shell.vertices), np.array(shell.faces)
    assert [len(solid) for solid in solids(points, triangles)] == [24]
    lattice = inside(points, triangles, 0.3)
    assert len(lattice)
    assert (np.abs(lattice).max(axis=1) >= 0.05).all()


def test_a_mesh_that_faces_inwards_is_turned_round() -> None:
    inverted = cube()
    inverted.invert()
    (part,) = parts_of(inverted, 0.01)
    assert contains(part["vertices"], np.array(inverted.vertices))


def test_the_inside_is_that_of_trimesh() -> None:
    mesh = torus()
    points, triangles = np.array(mesh.vertices), np.array(mesh.faces)
    lattice = inside(points, triangles, 0.37)
    assert mesh.contains(lattice).all()
    spacing = np.ptp(points, axis=0).max() / 48
    assert len(lattice) * spacing**3 == pytest.approx(mesh.volume, rel=0.05)
    spots = np.random.default_rng(2).uniform(*mesh.bounds, (500, 3))
    assert (wound(points[triangles], spots) == mesh.contains(spots)).all()


def without_a_triangle() -> trimesh.Trimesh:
    return trimesh.Trimesh(cube().vertices, cube().faces[1:], process=False)


def turned_at_a_triangle() -> trimesh.Trimesh:
    faces = cube().faces.copy()
    faces[3] = faces[3][::-1]
    return trimesh.Trimesh(cube().vertices, faces, process=False)


def sheet() -> trimesh.Trimesh:
    return trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 1]], process=False)


def point() -> trimesh.Trimesh:
    return trimesh.Trimesh([[0, 0, 0]] * 3, [[0, 1, 2]], process=False)


@pytest.mark.parametrize(
    ("mesh", "words"),
    [
        (without_a_triangle(), "it is open: 3 of its 18 edges"),
        (turned_at_a_triangle(), "do not face the same way at 3 of its 18 edges"),
        (sheet(), "it is flat"),
        (point(), "it is flat"),
    ],
)
def test_what_bounds_no_solid_is_refused(mesh: trimesh.Trimesh, words: str) -> None:
    with pytest.raises(SceneError, match=words) as refused:
        parts_of(mesh, 0.01)
    assert "mend the mesh" in refused.value.hint


def test_parts_that_are_flat_or_do_not_come_to_hold_the_mesh_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = cube()
    points, triangles = np.array(mesh.vertices), np.array(mesh.faces)
    with pytest.raises(SceneError, match="a part of the mesh is too thin"):
        enlarged([points, points[:4] * [1, 1, 0]], points, triangles, [], 64)
    monkeypatch.setattr(child, "_grown", lambda cloud, by: points / 2)
    with pytest.raises(SceneError, match="no 1 convex parts were found that hold all of the mesh") as refused:
        enlarged([points], points, triangles, [], 64)
    assert "a larger threshold" in refused.value.hint


def test_too_many_parts_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    many = trimesh.util.concatenate([cube(3 * k) for k in range(65)])
    monkeypatch.setattr(child, "_cut", lambda points, triangles, threshold: [points])
    with pytest.raises(SceneError, match="falls into 65 parts; at most 64"):
        parts_of(many, 0.1)


@pytest.mark.parametrize(
    ("lost", "turned"),
    [([5], []), ([5, 6, 7], []), ([], [9]), ([0, 40], [80])],
    ids=["a hole", "a larger hole", "a triangle that faces inwards", "several holes"],
)
def test_small_holes_are_closed(lost: list[int], turned: list[int]) -> None:
    points, faces = fine_cube()
    faces[turned] = faces[turned][:, ::-1]
    faces = np.delete(faces, lost, axis=0)
    assert fault(points, faces) is not None
    assert fault(*closed(points, faces)) is None
    mended, triangles = closed(points, faces)
    assert len(triangles) > len(faces)
    assert _inner(mended, triangles) == pytest.approx(0.2**3, rel=1e-9)
    assert (triangles[: len(faces)] == faces).all()


def fine_cube() -> tuple[np.ndarray, np.ndarray]:
    """The points and the triangles, of 6 mm, of a cube of 0.2 m."""
    points, faces = cube().vertices, cube().faces
    for _ in range(5):
        points, faces = trimesh.remesh.subdivide(points, faces)
    return np.array(points), np.array(faces)


def _inner(points: np.ndarray, triangles: np.ndarray) -> float:
    """The volume that a closed surface bounds, as trimesh finds it."""
    return trimesh.Trimesh(points, triangles, process=False).volume


def test_holes_that_share_a_corner_are_closed_one_by_one() -> None:
    points, faces = fine_cube()
    around = np.flatnonzero((faces == faces[0, 0]).any(axis=1))
    first = around[0]
    (apart, *_) = [k for k in around if len({*faces[k]} & {*faces[first]}) == 1]
    faces = np.delete(faces, [first, apart], axis=0)
    mended, triangles = closed(points, faces)
    assert len(mended) == len(points) + 2
    assert fault(mended, triangles) is None


@pytest.mark.parametrize("scale", [1e-5, 1e4])
def test_size_makes_no_difference(scale: float) -> None:
    mesh = angle()
    mesh.apply_scale(scale)
    mesh.apply_translation(np.full(3, 3 * scale))
    parts = parts_of(mesh, 0.01 * scale)
    assert 1 < len(parts) < 20
    assert uncovered([Part(part["vertices"]) for part in parts], np.array(mesh.vertices), np.array(mesh.faces)) == []


def test_triangles_that_are_there_twice_or_have_no_area_and_equal_points_do_no_harm() -> None:
    mesh = cube()
    soup = trimesh.Trimesh(mesh.triangles.reshape(-1, 3), np.arange(36).reshape(-1, 3), process=False)
    faces = np.concatenate([soup.faces, [[0, 0, 1], [0, 1, 0]], np.roll(soup.faces, 1, axis=1)])
    (part,) = parts_of(trimesh.Trimesh(soup.vertices, faces, process=False), 0.01)
    assert contains(part["vertices"], np.array(mesh.vertices))
