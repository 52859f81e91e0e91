"""What faces have to part is looked at: where bodies touch, or the balls about them; pairs that few joints move do not count."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import catalogue
from certifier.kinematics import Kinematics
from certifier.pair.collisions import in_collision
from certifier.partition.levels import LONG
from certifier.partition.parted import touched
from certifier.polytopes.gibbs import uniform_in_q


def looked_at(name, half):
    """Returns a scene, a cube in s about its seed, samples of the cube, the pairs that many joints move, and the seed."""
    scene, kinematics = catalogue.scene(name), Kinematics.of(catalogue.scene(name))

    def moving(pair):
        return len(kinematics.chain(scene.geometry(pair.a).body, scene.geometry(pair.b).body))

    seed = scene.to_s(catalogue.seed(name))
    polytope = scene.polytope(*catalogue.cube(seed, half))
    samples = uniform_in_q(polytope, scene, 40, 25, 1).reshape(-1, scene.n)
    long = [pair for pair in scene.pairs if moving(pair) >= LONG]
    assert 0 < len(long) < len(scene.pairs)
    return scene, polytope, samples, long, seed[None]


@pytest.mark.parametrize(("name", "half"), [("ur3e_bin", 0.5), ("iiwa_shelf", 0.3)])
def test_what_collides_is_touched(name, half):
    """Collisions are the oracle: all that is touched of six joints, and less than that where balls stand for the hand of seven."""
    scene, polytope, samples, long, keep = looked_at(name, half)
    colliding = in_collision(replace(scene, pairs=tuple(long)), samples).mean()
    share = touched(scene, polytope, samples, keep)
    assert 0 < colliding < 1
    if name == "ur3e_bin":
        assert share == pytest.approx(colliding, abs=0.003)
    else:
        assert colliding < share < 1


def test_nothing_is_touched_near_the_seed():
    scene, polytope, samples, _, keep = looked_at("ur3e_bin", 0.01)
    assert touched(scene, polytope, samples, keep) == 0


def test_pairs_that_few_joints_move_do_not_count():
    """Most of the limits of arm_3dof's joints collide, and three joints are few."""
    scene = catalogue.scene("arm_3dof")
    limits = scene.polytope([], [])
    samples = uniform_in_q(limits, scene, 40, 25, 1).reshape(-1, scene.n)
    assert in_collision(scene, samples).any()
    assert touched(scene, limits, samples, np.zeros((0, scene.n))) == 0
