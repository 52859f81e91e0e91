"""Regions grown from the examples hold no configuration that Drake, reading the original files, finds in collision."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml

from certifier.growth.options import GrowthOptions
from certifier.growth.paper.options import PaperOptions
from certifier.jobs.local import grow
from certifier.model import Polytope
from certifier.scene import load_scene
from client.cores import cores
from tests.certifier.scenes import cube
from tests.oracles.original import collision

EXAMPLES = Path(__file__).parents[2] / "examples"
SAMPLES = 100_000
load = cache(load_scene)


def free_region(name, options, deadline_s=None, processes=1):
    """Grows a region of an example, samples it, and samples its twin, which is large enough to collide."""
    path = EXAMPLES / name / "scene.yaml"
    scene = load(path)
    q = yaml.safe_load((path.parent / "seed.yaml").read_text())["q"]
    manifest = grow(scene, GrowthOptions(seed={"q": q}, **options), deadline_s=deadline_s, processes=processes).manifest
    region = Polytope(np.array(manifest["halfspace_normals"]), np.array(manifest["halfspace_offsets"]))
    assert region.contains(scene.to_s(q))
    assert collision(path, scene, region, SAMPLES) is None
    assert collision(path, scene, cube(scene, scene.to_s(q), 8.0), SAMPLES) is not None


@pytest.mark.parametrize("paper", [None, PaperOptions(max_rounds=1)], ids=["by cells", "paper"])
@pytest.mark.parametrize("name", ["planar_2dof", pytest.param("arm_3dof", marks=pytest.mark.slow)])
def test_no_sample_of_a_grown_region_collides(name, paper):
    free_region(name, {"paper": paper})


@pytest.mark.slow
@pytest.mark.parametrize(("name", "deadline_s"), [("iiwa_shelf", 120.0), ("ur3e_bin", 60.0), ("sphere_arm", 240.0), ("dual_ur3e", 600.0)])
def test_no_sample_of_a_grown_region_collides_real_arms(name, deadline_s):
    free_region(name, {}, deadline_s, cores())


def test_the_oracle_finds_what_is_known_to_collide():
    path = EXAMPLES / "planar_2dof" / "scene.yaml"
    scene = load(path)
    assert collision(path, scene, scene.polytope(np.zeros((0, 2)), np.zeros(0)), SAMPLES) is not None
