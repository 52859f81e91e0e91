"""Which configurations collide: against closed forms, Drake's distances, and what is certified."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from certifier.model import WORLD, Pair
from certifier.outcome import Outcome
from certifier.pair.certification import Certification
from certifier.pair.collisions import in_collision
from certifier.scene import load_scene
from certifier.scene.drake_model import build_diagram, geometry_name
from tests.certifier.scenes import ball, box, cube, planar_arm
from tests.scenes import slider

EXAMPLES = Path(__file__).parents[3] / "examples"


@pytest.mark.parametrize("padding", [0.0, 0.07])
def test_balls_touch_where_their_distance_says_so(padding):
    """The slider's ball at x passes balls beside its way at (0, 0.15) and (0, 1.15)."""
    scene = replace(slider(posts=2), padding=padding)
    posts = [replace(g, vertices=g.vertices - [0, 0.35, 0]) if g.body == WORLD else g for g in scene.geometries]
    x = np.linspace(-1, 1, 4001)
    reach = 0.2 + 2 * padding
    assert np.array_equal(in_collision(replace(scene, geometries=tuple(posts)), x[:, None]), np.hypot(x, 0.15) <= reach)


def drakes(scene, s):
    """The least signed distance over all pairs at the rows of s, by Drake, less what the padding takes."""
    diagram = build_diagram(scene)
    context = diagram.CreateDefaultContext()
    plant, graph = diagram.plant(), diagram.scene_graph()
    plant_context, graph_context = diagram.mutable_plant_context(context), diagram.mutable_scene_graph_context(context)
    inspector = graph.model_inspector()
    ids = {geometry_name(inspector, g): g for g in inspector.GetAllGeometryIds()}
    found = []
    for q in scene.to_q(s):
        plant.SetPositions(plant_context, q)
        query = graph.get_query_output_port().Eval(graph_context)
        found.append(min(query.ComputeSignedDistancePairClosestPoints(ids[p.a], ids[p.b]).distance for p in scene.pairs))
    return np.array(found) - 2 * scene.padding


@pytest.mark.parametrize(("name", "samples"), [("planar_2dof", 2000), ("ur3e_bin", 300), ("iiwa_shelf", 300), ("dual_ur3e", 200)])
def test_drake_finds_the_same_configurations_in_collision(name, samples):
    scene = load_scene(EXAMPLES / name / "scene.yaml")
    q = np.random.default_rng(0).uniform(scene.q_lower, scene.q_upper, (samples, scene.n))
    distance = drakes(scene, scene.to_s(q))
    clear = np.abs(distance) > 1e-6
    collides = in_collision(scene, scene.to_s(q))
    assert np.array_equal(collides[clear], distance[clear] <= 0)
    assert 0 < collides.sum() < clear.sum() == samples


def test_it_does_not_matter_which_body_has_more_vertices():
    """The arm's bars have eight vertices; a ball has one, and its centre lies where a box of no size would."""
    s = np.random.default_rng(1).uniform(-1, 1, (3000, 2))
    point = ball("world/obstacle", WORLD, 0.2, (1.5, 0.8, 0.0))
    several = replace(point, vertices=np.repeat(point.vertices, 12, axis=0))
    few, many = (in_collision(planar_arm(2, obstacle), s) for obstacle in (point, several))
    assert np.array_equal(few, many)
    assert 0 < few.sum() < len(s)


def test_what_is_certified_does_not_collide_and_what_is_refuted_does():
    scene = planar_arm(2, box("world/block", WORLD, (0.3, 0.3, 0.3), (1.2, 0.9, 0.0)))
    rng = np.random.default_rng(2)
    for half, certified in ((0.1, True), (0.9, False)):
        shared = Certification(scene, cube(scene, 0.0, half), np.zeros(2))
        outcomes = {shared.certify(index).outcome for index in range(len(scene.pairs))}
        assert (outcomes == {Outcome.CERTIFIED}) == certified
        assert in_collision(scene, rng.uniform(-half, half, (5000, 2))).any() != certified


def test_a_scene_without_pairs_and_no_configurations():
    scene = planar_arm(2)
    assert not in_collision(replace(scene, pairs=()), np.zeros((3, 2))).any()
    assert in_collision(scene, np.zeros((0, 2))).shape == (0,)
    assert in_collision(replace(scene, pairs=(Pair("arm/link1/bar", "arm/link2/bar"),)), np.zeros((1, 2))).all()
