"""A scene file by other hands: Drake reads the models as they are; none of the scene's numbers is used."""

from __future__ import annotations

from pathlib import Path

from pydrake.geometry import CollisionFilterDeclaration, GeometryId, GeometrySet, SceneGraphInspector
from pydrake.multibody.plant import MultibodyPlant
from pydrake.planning import RobotDiagram, RobotDiagramBuilder

from certifier.model import Array, Pair, Polytope, Scene
from certifier.polytopes.polytope import chebyshev_center
from certifier.polytopes.sampling import hit_and_run
from certifier.scene.file import read_scene_file


def original_diagram(path: Path) -> RobotDiagram:
    """The diagram that Drake itself makes of a scene file's directives."""
    scene_file = read_scene_file(path)
    builder = RobotDiagramBuilder(time_step=0.0)
    for name, root in scene_file.packages.items():
        builder.parser().package_map().Add(name, str(root))
    builder.parser().AddModelsFromString(scene_file.resolved_directives, "dmd.yaml")
    return builder.Build()


def collision(path: Path, scene: Scene, polytope: Polytope, count: int = 100_000, seed: int = 0) -> Array | None:
    """Joint positions at which Drake finds a pair of the scene in collision, among uniform samples of the polytope; None if there are none.

    The shapes are the file's own: meshes and cylinders as they are, no padding.
    """
    return collision_at(path, scene, scene.to_q(hit_and_run(polytope, chebyshev_center(polytope)[0], count, seed)))


def collision_at(path: Path, scene: Scene, configurations: Array) -> Array | None:
    """The first of the configurations, (k, n), at which Drake finds a pair of the scene in collision; None if there is none."""
    diagram = original_diagram(path)
    plant, scene_graph = diagram.plant(), diagram.scene_graph()
    inspector = scene_graph.model_inspector()
    ignored = CollisionFilterDeclaration()
    for a, b in inspector.GetCollisionCandidates():
        if _pair(plant, inspector, a, b) not in scene.pairs:
            ignored.ExcludeBetween(GeometrySet(a), GeometrySet(b))
    scene_graph.collision_filter_manager().Apply(ignored)
    left = {_pair(plant, inspector, a, b) for a, b in inspector.GetCollisionCandidates()}
    assert left == set(scene.pairs), "Drake's pairs, less the ignored ones, are the scene's"

    context = diagram.CreateDefaultContext()
    plant_context, scene_context = diagram.mutable_plant_context(context), diagram.mutable_scene_graph_context(context)
    for q in configurations:
        plant.SetPositions(plant_context, q)
        if scene_graph.get_query_output_port().Eval(scene_context).HasCollisions():
            return q
    return None


def _pair(plant: MultibodyPlant, inspector: SceneGraphInspector, a: GeometryId, b: GeometryId) -> Pair:
    return Pair(*sorted(_name(plant, inspector, i) for i in (a, b)))


def _name(plant: MultibodyPlant, inspector: SceneGraphInspector, geometry: GeometryId) -> str:
    """model/body/geometry, for geometries whose file gives them a name of their own."""
    body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
    model = plant.GetModelInstanceName(body.model_instance())
    short = inspector.GetName(geometry).removeprefix(f"{model}::")
    return f"world/{short}" if body.index() == plant.world_body().index() else f"{model}/{body.name()}/{short}"
