"""Rational kinematics against Drake's numeric ones, on plants that Drake's own classes built."""

import numpy as np
import pytest
from pydrake.geometry import SceneGraph
from pydrake.multibody.rational import RationalForwardKinematics

from certifier.kinematics import Kinematics
from certifier.model import WORLD, JointKind, Scene
from certifier.scene.names import Names
from certifier.scene.parse import joint_of
from certifier.scene.tree import Tree
from tests.oracles.trees import random_plant

SEEDS = range(12)


def tree_of(plant):
    """Of a plant without a scene graph, whose inspector has nothing to name."""
    names = Names(plant, SceneGraph().model_inspector())
    return Tree([joint_of(plant.get_joint(index), names) for index in plant.GetJointIndices()], list(names.bodies))


def scene_of(plant, q_star):
    tree = tree_of(plant)
    return Scene("tree", tree.joints, tree.bodies, (), (), (), q_star)


def drake_body(plant, name):
    return plant.world_body() if name == WORLD else plant.GetBodyByName(name.split("/")[1])


def path_length(scene, bodies):
    """Metres along the path's frames, at least 1: what a relative error of a position is relative to."""
    inner = set(bodies)
    joints = [joint for joint in scene.joints if {joint.parent, joint.child} <= inner]
    return 1 + sum(np.linalg.norm(X[:3, 3]) for joint in joints for X in (joint.X_PF, joint.X_BM))


@pytest.mark.parametrize("seed", SEEDS)
def test_numerators_are_drakes_poses_times_the_denominator(seed):
    """Every body seen from every other: up the tree, down, across, through welds."""
    rng = np.random.default_rng(seed)
    plant = random_plant(rng, bodies=7)
    n = plant.num_positions()
    scene = scene_of(plant, rng.uniform(-0.5, 0.5, n))
    context = plant.CreateDefaultContext()
    kinematics = Kinematics(scene)
    s = np.vstack([rng.normal(size=(3, n)), np.zeros((1, n)), scene.s_lower, scene.s_upper])
    for q, point in zip(scene.to_q(s), s, strict=True):
        plant.SetPositions(context, q)
        for frame in scene.bodies:
            for body in scene.bodies:
                X = kinematics.numerators(frame, body, point[None])[0]
                expected = plant.CalcRelativeTransform(
                    context, drake_body(plant, frame).body_frame(), drake_body(plant, body).body_frame()
                ).GetAsMatrix4()
                denominator = np.prod([1 + point[i] ** 2 for i in kinematics.chain(frame, body) if scene.revolute[i]])
                reach = path_length(scene, kinematics.bodies_between(frame, body))
                np.testing.assert_allclose(X, denominator * expected, rtol=0, atol=1e-12 * denominator * reach)


def test_the_trees_have_every_kind_of_joint():
    plants = [random_plant(np.random.default_rng(seed), 7) for seed in SEEDS]
    kinds = {joint.kind for plant in plants for joint in tree_of(plant).joints}
    assert kinds == set(JointKind)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_tangent_map_is_drakes(seed):
    """Value by value: on a branched tree Drake numbers the entries of s otherwise than those of q."""
    rng = np.random.default_rng(seed)
    plant = random_plant(rng, bodies=7)
    scene = scene_of(plant, rng.uniform(-0.5, 0.5, plant.num_positions()))
    q = rng.uniform(scene.q_lower, scene.q_upper)
    theirs = RationalForwardKinematics(plant).ComputeSValue(q, scene.q_star)
    np.testing.assert_allclose(np.sort(scene.to_s(q)), np.sort(theirs), rtol=1e-14)
    np.testing.assert_allclose(scene.to_q(scene.to_s(q)), q, rtol=0, atol=1e-14)
