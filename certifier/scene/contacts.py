"""Which pairs of a scene touch at configurations, for advice about scenes: Drake says what overlaps, closest points what is near.

Drake's signed distances are not asked: :mod:`certifier.collisions.clearance` says why.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from pydrake.geometry import GeometryId, QueryObject

from certifier.model import Array, Pair, Scene
from certifier.polytopes.closest import closest
from certifier.scene.drake_model import InDrake, build_diagram, geometry_name


def touching(scene: Scene, configurations: Iterable[Array]) -> Iterator[set[Pair]]:
    """Yields the pairs that overlap, or are not farther apart than their padding, at each of the configurations q, (n,) each."""
    padded = [pair for pair in scene.pairs if scene.padding_of(pair)]
    for query in _queries(scene, configurations):
        found = set(_depths(query))
        ids = {geometry_name(query.inspector(), g): g for g in query.inspector().GetAllGeometryIds()} if padded else {}
        yield found | {pair for pair in padded if pair not in found and _near(scene, pair, query, ids)}


def overlaps(scene: Scene, configurations: Iterable[Array]) -> Iterator[dict[Pair, float]]:
    """Yields how deep the pairs are in each other that overlap at each of the configurations q, (n,) each, in metres, without padding."""
    return map(_depths, _queries(scene, configurations))


def _queries(scene: Scene, configurations: Iterable[Array]) -> Iterator[QueryObject]:
    diagram = build_diagram(scene)
    context = diagram.CreateDefaultContext()
    plant, scene_graph = diagram.plant(), diagram.scene_graph()
    plant_context = plant.GetMyContextFromRoot(context)
    own = InDrake(scene, plant)
    for q in configurations:
        plant.SetPositions(plant_context, own.at(q))
        yield scene_graph.get_query_output_port().Eval(scene_graph.GetMyContextFromRoot(context))


def _near(scene: Scene, pair: Pair, query: QueryObject, ids: dict[str, GeometryId]) -> bool:
    """Returns whether no direction shows that two bodies are farther apart than their padding."""
    bodies, reach = [], 2 * scene.padding_of(pair)
    for name in (pair.a, pair.b):
        geometry, frame = scene.geometry(name), query.inspector().GetFrameId(ids[name])
        bodies.append(query.GetPoseInWorld(frame).multiply(geometry.vertices.T).T)
        reach += geometry.radius
    A, B = bodies
    along_axes = max((A.min(axis=0) - B.max(axis=0)).max(), (B.min(axis=0) - A.max(axis=0)).max())
    return not along_axes > reach and not closest(A, B).gap > reach


def _depths(query: QueryObject) -> dict[Pair, float]:
    inspector, found = query.inspector(), query.ComputePointPairPenetration()
    return {Pair(*sorted((geometry_name(inspector, p.id_A), geometry_name(inspector, p.id_B)))): p.depth for p in found}
