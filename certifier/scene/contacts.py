"""Which pairs of a scene touch at configurations is asked of Drake here. Padding does not count."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from certifier.model import Array, Pair, Scene
from certifier.scene.drake_model import build_diagram, geometry_name


def touching(scene: Scene, configurations: Iterable[Array]) -> Iterator[set[Pair]]:
    """Yields the pairs that overlap at each of the configurations q, (n,) each."""
    return (set(depths) for depths in overlaps(scene, configurations))


def overlaps(scene: Scene, configurations: Iterable[Array]) -> Iterator[dict[Pair, float]]:
    """Yields how deep the pairs are in each other that overlap at each of the configurations q, (n,) each, in metres."""
    diagram = build_diagram(scene)
    context = diagram.CreateDefaultContext()
    plant, scene_graph = diagram.plant(), diagram.scene_graph()
    plant_context = plant.GetMyContextFromRoot(context)
    query_port, inspector = scene_graph.get_query_output_port(), scene_graph.model_inspector()
    for q in configurations:
        plant.SetPositions(plant_context, q)
        found = query_port.Eval(scene_graph.GetMyContextFromRoot(context)).ComputePointPairPenetration()
        yield {Pair(*sorted((geometry_name(inspector, p.id_A), geometry_name(inspector, p.id_B)))): p.depth for p in found}
