"""Concave meshes that tests decompose."""

from __future__ import annotations

import numpy as np
import trimesh

from certifier.scene.decomposition.child import decompose


def bin_mesh() -> trimesh.Trimesh:
    """A bin without a lid, 0.4 x 0.3 x 0.2 m, whose walls and floor are 0.01 m thick; it stands on z = 0."""
    outline = np.array([[-0.2, -0.15], [0.2, -0.15], [0.2, 0.15], [-0.2, 0.15]])
    inner = outline - 0.01 * np.sign(outline)
    rings = [(outline, 0.0), (outline, 0.2), (inner, 0.2), (inner, 0.01)]
    points = np.concatenate([np.column_stack([ring, np.full(4, z)]) for ring, z in rings])
    sides = [(4 * ring + k, 4 * ring + (k + 1) % 4, 4 * ring + 4 + k) for ring in range(3) for k in range(4)]
    sides += [(4 * ring + (k + 1) % 4, 4 * ring + 4 + (k + 1) % 4, 4 * ring + 4 + k) for ring in range(3) for k in range(4)]
    return trimesh.Trimesh(points, [*sides, (0, 2, 1), (0, 3, 2), (12, 13, 14), (12, 14, 15)], process=False)


def angle() -> trimesh.Trimesh:
    """Two plates of 0.1 x 0.1 x 0.02 m that meet in an edge, as one surface."""
    outline = np.array([[0, 0], [0.1, 0], [0.1, 0.02], [0.02, 0.02], [0.02, 0.1], [0, 0.1]])
    points = np.concatenate([np.column_stack([outline, np.full(6, z)]) for z in (0.0, 0.1)])
    caps = [(0, 2, 1), (0, 3, 2), (0, 4, 3), (0, 5, 4)]
    sides = [face for k in range(6) for face in ((k, (k + 1) % 6, k + 6), ((k + 1) % 6, (k + 1) % 6 + 6, k + 6))]
    return trimesh.Trimesh(points, [*caps, *((c + 6, b + 6, a + 6) for a, b, c in caps), *sides], process=False)


def torus() -> trimesh.Trimesh:
    return trimesh.creation.torus(0.1, 0.03, major_sections=16, minor_sections=8)


def cube(middle: float = 0.0, side: float = 0.2) -> trimesh.Trimesh:
    made = trimesh.creation.box((side, side, side))
    made.apply_translation((middle, middle, middle))
    return made


def parts_of(mesh: trimesh.Trimesh, threshold: float, max_vertices: int = 64) -> list[dict]:
    """The parts, without a child process."""
    points, triangles = np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64)
    return decompose({"points": points, "triangles": triangles, "threshold": threshold, "max_vertices": max_vertices})["parts"]
