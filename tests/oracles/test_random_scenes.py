"""Regions of random scenes that are written as files hold no configuration that Drake alone finds in collision."""

from __future__ import annotations

import numpy as np
import pytest

from certifier.growth.options import GrowthOptions
from certifier.jobs.local import grow
from certifier.pair.collisions import in_collision
from certifier.scene import load_scene
from certifier.verify.region import verify_region
from client.cores import cores
from tests.oracles.distances import Distances
from tests.oracles.random_scenes import SAMPLES, ProvedRegion, Result, campaign, random_scene, search
from tests.oracles.written_scenes import FORMATS, write_scene
from tests.scenes import box_seed

SCENES, DEADLINE = 30, 60.0


@pytest.mark.slow
def test_drake_finds_no_collision_in_the_regions_of_random_scenes(tmp_path):
    results = campaign(0, SCENES, tmp_path, DEADLINE, SAMPLES, cores())
    assert [result.problem for result in results if result.problem] == []
    assert sum(result.region for result in results) >= SCENES / 2, "a campaign without regions shows nothing"


def test_the_scenes_have_every_format_and_are_read_as_drake_reads_them(tmp_path):
    written = set()
    for seed in range(4):
        path = write_scene(tmp_path / str(seed), np.random.default_rng(seed), 5)
        scene, distances = load_scene(path), Distances(path)
        assert scene.n == distances.n == 5
        assert sorted(distances.order([joint.name for joint in scene.moving])) == list(range(5))
        written |= {file.suffix[1:] for file in path.parent.iterdir()}
    assert written >= {*FORMATS, "obj"}


@pytest.mark.slow
def test_drake_agrees_with_a_small_region_and_not_with_all_that_is_within_the_limits(tmp_path):
    """A box about a free configuration is certified, and the search finds contacts in a region that is too large."""
    rng = np.random.default_rng(11)
    path, distances, seed = random_scene(tmp_path, rng)
    scene = load_scene(path)
    q = np.empty(scene.n)
    q[distances.order([joint.name for joint in scene.moving])] = seed
    proof = grow(scene, GrowthOptions(seed=box_seed(scene.to_s(q), 1e-3), cells=100)).proof
    region, result = ProvedRegion(proof, distances), Result(0, scene.n, 0, 0.0, True, "", margin=verify_region(proof).gap)
    search(result, region, distances, rng, 500)
    assert result.problem == ""
    assert result.margin <= result.least < np.inf
    limits = scene.polytope([], [])
    region.C, region.d = limits.C, limits.d
    search(result, region, distances, rng, 500)
    assert "the padded bodies are -" in result.problem


def test_the_distances_see_a_collision(tmp_path):
    """The oracle can fail: among free and other configurations, the least distance of random ones is negative."""
    distances = Distances(write_scene(tmp_path, np.random.default_rng(0), 5))
    found = [distances.least(q, 0.1) for q in np.random.default_rng(0).uniform(*distances.limits, (200, 5))]
    assert min(found) < 0 < max(found)


def test_what_is_free_keeps_the_padding_of_each_body_by_the_distances(tmp_path):
    """Bodies may be larger than Drake's own, so what touches by Drake does so for ciris; and much is free for both."""
    several = 0
    for seed in range(6):
        path, rng = write_scene(tmp_path / str(seed), np.random.default_rng(seed), 5), np.random.default_rng(seed)
        scene, distances = load_scene(path), Distances(path)
        several += bool(scene.other_paddings())
        theirs = rng.uniform(*distances.limits, (150, 5))
        q = np.empty_like(theirs)
        q[:, distances.order([joint.name for joint in scene.moving])] = theirs
        free = ~in_collision(scene, scene.to_s(q))
        least = np.array([distances.least(x, 0.1) for x in theirs])
        assert (least[free] > -1e-6).all()
        assert np.mean(free) > 0.5 * np.mean(least > 0)
    assert several >= 2
