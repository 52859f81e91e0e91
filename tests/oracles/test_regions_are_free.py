"""Certified polytopes of the examples hold no configuration that Drake, reading the original files, finds in collision."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml

from certifier.outcome import Outcome
from certifier.pair import Certification
from certifier.scene import load_scene
from tests.certifier.scenes import cube
from tests.oracles.original import collision

EXAMPLES = Path(__file__).parents[2] / "examples"
SAMPLES = 30_000
load = cache(load_scene)


def certified(scene, polytope, center):
    certification = Certification(scene, polytope, center)
    return all(certification.certify(index).outcome is Outcome.CERTIFIED for index in range(len(scene.pairs)))


@pytest.mark.parametrize("name", ["planar_2dof", "arm_3dof"])
def test_no_sample_of_a_certified_polytope_collides(name):
    path = EXAMPLES / name / "scene.yaml"
    scene = load(path)
    center = scene.to_s(yaml.safe_load((path.parent / "seed.yaml").read_text())["q"])
    half = 0.8
    while not certified(scene, cube(scene, center, half), center):
        half /= 1.5
    assert collision(path, scene, cube(scene, center, half), SAMPLES) is None
    assert collision(path, scene, cube(scene, center, 8 * half), SAMPLES) is not None, "the twin is large enough to collide"


def test_the_oracle_finds_what_is_known_to_collide():
    path = EXAMPLES / "planar_2dof" / "scene.yaml"
    scene = load(path)
    assert collision(path, scene, scene.polytope(np.zeros((0, 2)), np.zeros(0)), SAMPLES) is not None
