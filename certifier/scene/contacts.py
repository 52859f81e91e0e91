"""Which pairs of a scene touch at configurations is asked of Drake here."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from pydrake.geometry import QueryObject

from certifier.model import Array, Pair, Scene
from certifier.scene.drake_model import InDrake, build_diagram, geometry_name


def touching(scene: Scene, configurations: Iterable[Array]) -> Iterator[set[Pair]]:
    """Yields the pairs that overlap, or are not farther apart than their padding, at each of the configurations q, (n,) each."""
    padded = [pair for pair in scene.pairs if scene.padding_of(pair)]
    for query in _queries(scene, configurations):
        found = set(_depths(query))
        ids = {geometry_name(query.inspector(), g): g for g in query.inspector().GetAllGeometryIds()} if padded else {}
        for pair in padded:
            # Drake gives up on the distance of some bodies that are deep in each other.
            if pair not in found:
                distance = query.ComputeSignedDistancePairClosestPoints(ids[pair.a], ids[pair.b]).distance
                if distance <= 2 * scene.padding_of(pair):
                    found.add(pair)
        yield found


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


def _depths(query: QueryObject) -> dict[Pair, float]:
    inspector, found = query.inspector(), query.ComputePointPairPenetration()
    return {Pair(*sorted((geometry_name(inspector, p.id_A), geometry_name(inspector, p.id_B)))): p.depth for p in found}
