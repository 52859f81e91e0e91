"""This module answers with what people look at: the robot's bodies, contacts, and slices through configuration space."""

from __future__ import annotations

import hashlib
from contextlib import suppress
from threading import Lock

import numpy as np
from cachetools import LRUCache, cached
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from api import checks
from api.schemas.drawing import (
    MAX_REGIONS,
    Contacts,
    DrawnCone,
    DrawnGeometry,
    DrawnJoint,
    DrawnZone,
    SceneModel,
    SliceAxis,
    SlicedRegion,
    SliceRequest,
    SliceResponse,
)
from certifier.broken import trouble
from certifier.conditioned import faces_of, zone_reach
from certifier.conditions import Cone, InBall, Inside, of_condition
from certifier.errors import RegionError
from certifier.isolation.child import run_in_child
from certifier.model import Array, Geometry, Polytope, Scene
from certifier.pair.collisions import contacts as contacts_at
from certifier.polytopes.polytope import chebyshev_center
from db.settings import settings
from planner.library import Library
from planner.membership import locate, to_s
from planner.slices import outline_in_q, slice_points, slice_polygon

TIMEOUT_S = 60.0
KEPT = 64
"""Number of collision maps that an API process keeps, those that were asked for last."""


def model(scene_id: str, scene: Scene, has_meshes: bool) -> SceneModel:
    """Returns the scene as it is drawn."""
    index = {geometry.name: i for i, geometry in enumerate(scene.geometries)}
    return SceneModel(
        scene=scene_id,
        name=scene.name,
        joints=[
            DrawnJoint(
                name=joint.name,
                kind=joint.kind,
                parent=joint.parent,
                child=joint.child,
                axis=joint.axis.tolist(),
                X_PF=joint.X_PF.tolist(),
                X_BM=joint.X_BM.tolist(),
                index=joint.index,
                lower=joint.lower,
                upper=joint.upper,
                follows=joint.follows,
            )
            for joint in scene.joints
        ],
        bodies=list(scene.bodies),
        q_star=scene.q_star.tolist(),
        q_lower=scene.q_lower.tolist(),
        q_upper=scene.q_upper.tolist(),
        units=[joint.unit for joint in scene.moving],
        padding=scene.padding,
        geometries=[_drawn(geometry) for geometry in scene.geometries],
        pairs=[(index[pair.a], index[pair.b]) for pair in scene.pairs],
        zones=[_zone(scene, condition) for condition in scene.conditions if isinstance(condition, Inside | InBall)],
        cones=[_cone(condition) for condition in scene.conditions if isinstance(condition, Cone)],
        has_meshes=has_meshes,
    )


def _drawn(geometry: Geometry) -> DrawnGeometry:
    shown = not of_condition(geometry.name)  # What stands for a condition is no body of the robot.
    return DrawnGeometry(
        name=geometry.name,
        body=geometry.body,
        radius=geometry.radius if shown else 0.0,
        vertices=geometry.vertices.tolist() if shown else [],
        triangles=triangles(geometry.vertices).tolist() if shown else [],
        substitution=geometry.substitution,
    )


def _zone(scene: Scene, condition: Inside | InBall) -> DrawnZone:
    sides, reach = np.concatenate([np.eye(3), -np.eye(3)]), zone_reach(scene, condition)
    faces = np.concatenate([faces_of(condition), np.column_stack([sides, np.full(6, reach)])])
    vertices = np.zeros((0, 3))
    with suppress(RegionError):  # Nothing is in the zone, or it is flat.
        middle, _ = chebyshev_center(Polytope(faces[:, :3], faces[:, 3]))
        vertices = HalfspaceIntersection(faces * [1, 1, 1, -1], middle).intersections
    return DrawnZone(condition=condition.name, of=condition.of, vertices=vertices.tolist(), triangles=triangles(vertices).tolist())


def _cone(condition: Cone) -> DrawnCone:
    axis, along = list(condition.axis), list(condition.along)
    return DrawnCone(condition=condition.name, body=condition.body, axis=axis, of=condition.of, along=along, angle=condition.angle)


def triangles(vertices: Array) -> NDArray[np.intp]:
    """Returns the triangles (t, 3) of the hull of points (v, 3), anticlockwise seen from outside; both sides of one that is flat."""
    if len(vertices) < 3:
        return np.zeros((0, 3), dtype=np.intp)
    try:
        hull = ConvexHull(vertices)
    except QhullError:
        hull = ConvexHull(vertices, qhull_options="QJ")  # flat: its points are moved a little, which nobody sees
    corners = hull.simplices.copy()
    a, b, c = np.moveaxis(vertices[corners], 1, 0)
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    corners[inwards] = corners[inwards][:, ::-1]
    return np.asarray(corners, dtype=np.intp)


def contacts(scene: Scene, q: Array) -> list[Contacts]:
    """Returns what touches at each of the configurations q, (k, n)."""
    lower, upper = scene.own_limits
    beyond = (q < lower) | (q > upper)
    shifted = scene.in_windows(q)
    covered = np.all(scene.has_s(shifted), axis=1)
    touching = iter(contacts_at(scene, scene.to_s(shifted[covered])))
    found = []
    for at, known, out in zip(q, covered.tolist(), beyond, strict=True):
        outside, pairs = [scene.moving[i].name for i in np.flatnonzero(out).tolist()], next(touching) if known else None
        words = [f"the joint {joint} is beyond its limits" for joint in outside] + [trouble(scene, scene.pairs[i], at) for i in pairs or []]
        found.append(Contacts(pairs=pairs, outside=outside, trouble=list(dict.fromkeys(words))))
    return found


def _pixels(scene: Scene, q: Array) -> tuple[str, bytes]:
    return scene.hash, hashlib.sha256(q.tobytes()).digest()


@cached(LRUCache(KEPT), key=_pixels, lock=Lock())
def _collision_map(scene: Scene, q: Array) -> NDArray[np.uint8]:
    """Returns at which of the configurations q, (k, n), some pair is not shown to be apart, as packed bits. A child process computes it."""
    payload = {"scene": scene.to_document(), "s": scene.to_s(q)}
    function, memory = "certifier.pair.collisions:answer_in_collision", settings().child_memory_bytes
    return np.packbits(run_in_child(function, payload, timeout_s=TIMEOUT_S, memory_bytes=memory))


def sliced(scene_id: str, scene: Scene, library: Library, body: SliceRequest) -> SliceResponse:
    """Returns the slice that a request asks for.

    Raises:
        RegionError: unknown_joint, same_joint, slice_outside_limits, region_elsewhere, waypoint_outside_limits, wrong_length.
    """
    q = checks.point(scene, body.q, "q")
    s = checks.in_s(scene, q[None], "q")[0]
    q = scene.in_windows(q)
    axes = _joint(scene, body.x, "x"), _joint(scene, body.y, "y")
    if axes[0] == axes[1]:
        raise RegionError("same_joint", "a slice goes through two different joints", field="y", hint="name another joint")
    ranges = [_range(scene, axis, given, field) for axis, given, field in zip(axes, (body.x_range, body.y_range), ("x", "y"), strict=True)]
    lower, upper = np.array(ranges).T
    points = slice_points(q, axes, lower, upper, body.size)
    ends = np.tile(q, (2, 1))
    ends[:, axes] = lower, upper
    s_lower, s_upper = scene.to_s(ends)[:, axes]
    chosen = _chosen(library, body.regions)
    outlines = {}
    for region in chosen:
        corners = slice_polygon(library.polytope(region), s, axes, s_lower, s_upper)
        if len(corners) >= 3:
            outlines[region] = outline_in_q(scene, corners, axes)
    found = locate(library, to_s(scene, points))
    certified = np.zeros(len(points), dtype=bool)
    certified[found.point[np.isin(found.region, list(chosen))]] = True
    # What collides is drawn as such, whatever else holds there.
    in_collision = np.unpackbits(_collision_map(scene, points), count=len(points)).astype(bool)
    signs = np.where(in_collision, "#", np.where(certified, "o", "."))
    described = [
        SliceAxis(joint=scene.moving[axis].name, unit=scene.moving[axis].unit, lower=low, upper=high)
        for axis, low, high in zip(axes, lower.tolist(), upper.tolist(), strict=True)
    ]
    return SliceResponse(
        scene=scene_id,
        version=library.version,
        x=described[0],
        y=described[1],
        size=body.size,
        rows=["".join(row) for row in signs.reshape(body.size, body.size)],
        regions=[SlicedRegion(region=library.ids[i], polygon=[(x, y) for x, y in outline.tolist()]) for i, outline in outlines.items()],
    )


def _joint(scene: Scene, name: str, field: str) -> int:
    names = [joint.name for joint in scene.moving]
    if name not in names:
        raise RegionError("unknown_joint", f"no joint of the scene is called {name!r}", field=field, hint=f"there are {', '.join(names)}")
    return names.index(name)


def _range(scene: Scene, axis: int, given: list[float] | None, field: str) -> tuple[float, float]:
    """Returns where an axis begins and ends: what was asked for, within the joint's limits."""
    low, high = float(scene.q_lower[axis]), float(scene.q_upper[axis])
    if given is None:
        return low, high
    if given[0] >= high or given[1] <= low:
        message = f"the range is outside of the limits of {scene.moving[axis].name}, {low:.4g} to {high:.4g}"
        raise RegionError("slice_outside_limits", message, field=f"{field}_range", hint="choose one within them")
    return max(low, given[0]), min(high, given[1])


def _chosen(library: Library, asked: list[str] | None) -> range | list[int]:
    """Returns the numbers of the regions to draw."""
    if asked is None:
        return range(max(0, len(library) - MAX_REGIONS), len(library))
    for i, name in enumerate(asked):
        if name not in library.ids:
            hint = "`ciris region ls --scene SCENE` lists them"
            raise RegionError("region_elsewhere", f"region {name} is not of this scene", field=f"regions[{i}]", hint=hint)
    return [library.ids.index(name) for name in asked]
