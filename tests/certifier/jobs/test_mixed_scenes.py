"""Growing in random scenes with all kinds of joints gives a region or an answer in the user's terms, and prints no warning."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from certifier.errors import CirisError
from certifier.model import Array, JointKind, Scene
from certifier.positions import MAGNITUDE
from certifier.seeding.propose import check_seed
from tests.certifier.jobs.test_next_to_contact import answer
from tests.certifier.mixed import mixed_arm
from tests.certifier.scenes import planar_arm

FEW, MANY, DEADLINE = 2, 150, 30.0


def with_seed(rng: np.random.Generator, joints: int) -> tuple[Scene, Array]:
    """Returns a random scene with a free configuration, and that configuration."""
    while True:
        scene = mixed_arm(rng, joints)
        for q in rng.uniform(scene.q_lower, scene.q_upper, (1000, scene.n)):
            try:
                check_seed(scene, q)
            except CirisError:
                continue
            return scene, q


@pytest.mark.parametrize("seed", range(FEW))
def test_small_scenes_with_joints_of_every_kind(seed):
    rng = np.random.default_rng(seed)
    answer(*with_seed(rng, 2), DEADLINE)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(MANY))
def test_scenes_with_joints_of_every_kind(seed):
    rng = np.random.default_rng(seed)
    answer(*with_seed(rng, int(rng.integers(2, 8))), DEADLINE)


@pytest.mark.parametrize("length", [pytest.param(1e3, marks=pytest.mark.slow), MAGNITUDE])
def test_a_slide_far_longer_than_the_robot_is_named(length):
    """Bodies metres apart count as touching beside a slide of a kilometre, and samples of the polytope ran out, with warnings.

    Scenes have no longer slides than these.
    """
    scene = planar_arm(2)
    slide = replace(scene.joints[0], kind=JointKind.PRISMATIC, lower=-length, upper=length)
    said = answer(replace(scene, joints=(slide, *scene.joints[1:])), np.zeros(2), DEADLINE)
    if said:
        assert f"joint arm/joint1 slides {2 * length:.3g} m, and the largest body is 1 m wide" in said
        assert "set narrower limits for the joint" in said
