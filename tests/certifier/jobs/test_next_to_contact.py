"""Growing from a seed next to contact gives a region or an answer in the user's terms: distance, pair, and where there is room.

Nothing that users have not given is named: no polytope, no faces, no multipliers.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable

import numpy as np
import pytest

from certifier.collisions.clearance import Clearance
from certifier.errors import CirisError
from certifier.growth.options import GrowthOptions
from certifier.jobs.local import grow
from certifier.model import Array, Scene
from certifier.seeding.hindrance import NEAR
from certifier.seeding.propose import check_seed
from tests.certifier.mixed import mixed_arm
from tests.certifier.scenes import planar_arm

FEW, MANY = 1, 60
FOREIGN = re.compile(r"polytope|multiplier|\bface|flat|proof|iris|sampl|program|numeric|matrix|singular|solver|hit and run", re.IGNORECASE)
"""What users have not given, and what only solvers and verifiers say."""
HAIRS = 10.0 ** np.arange(-10, -2)
"""So far from contact are seeds, in parts of the way from a free configuration."""


def answer(scene: Scene, q: Array, deadline: float | None = None) -> str:
    """The message of growing around a seed, "" for a region; an error that is not for users fails, and so does a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            region = grow(scene, GrowthOptions(seed={"q": q.tolist()}), deadline_s=deadline)
        except CirisError as error:
            said = str(error)
        else:
            C, d = np.array(region.manifest["halfspace_normals"]), np.array(region.manifest["halfspace_offsets"])
            assert (C @ scene.to_s(scene.in_windows(q)) < d).all()
            return ""
    assert not FOREIGN.search(said), f"{said!r} is about nothing that the user has given"
    return said


def next_to_contact(scene: Scene, rng: np.random.Generator, hair: float) -> Array:
    """A configuration that lies so near to one in contact, as a part of the way from a free one, (n,)."""
    clearance = Clearance(scene)

    def first(wanted: bool) -> Array:
        q = (rng.uniform(scene.q_lower, scene.q_upper) for _ in range(10_000))
        return next(x for x in q if clearance.free(x) is wanted)

    free, contact = first(True), first(False)
    for _ in range(60):
        middle = (free + contact) / 2
        free, contact = (middle, contact) if clearance.free(middle) else (free, middle)
    away = first(True) - free
    return next(free + sign * hair * away for sign in (1, -1) if clearance.free(free + sign * hair * away))


def check(scene: Scene, q: Array, grows: Callable[[Array], bool]) -> None:
    """Grows around a seed next to contact, and looks at what is answered."""
    distance, pair = Clearance(scene).least(q)
    said = answer(scene, q, 120.0)
    if not said or distance > NEAR:
        return
    assert {pair.a, pair.b} == set(re.search(r"from contact of (\S+) and (\S+), and no", said).groups())
    assert float(re.search(r"is (\S+) mm from", said)[1]) == pytest.approx(1e3 * distance, rel=0.01)
    named = re.search(r"at q = \(([^a-z]+)\) rad every pair is (\S+) mm", said)
    if named:
        roomy = np.array([float(x) for x in named[1].split(",")])
        assert Clearance(scene).least(roomy)[0] > 0.99e-3 * float(named[2])
        assert grows(roomy)


@pytest.mark.parametrize("seed", range(FEW))
def test_a_seed_a_hair_from_contact_is_answered_in_the_users_terms(seed):
    scene, rng = planar_arm(2), np.random.default_rng(seed)
    check(scene, next_to_contact(scene, rng, HAIRS[3 * seed % len(HAIRS)]), lambda q: not answer(scene, q))


def test_the_arm_of_the_example_a_hair_from_its_block():
    """The shoulder touches the block at 0.5 rad; at 1e-9 rad before it the growth ended in the verifier's words."""
    scene = planar_arm(2)
    clearance, free, contact = Clearance(scene), 0.0, 0.6
    assert clearance.free(np.array([free, 0.0]))
    assert not clearance.free(np.array([contact, 0.0]))
    for _ in range(50):
        middle = (free + contact) / 2
        free, contact = (middle, contact) if clearance.free(np.array([middle, 0.0])) else (free, middle)
    said = answer(scene, np.array([free - 1e-9, 0.0]))
    assert "from contact of arm/link2/bar and world/obstacle, and no region was found there; at q = " in said
    assert said.endswith("(move the seed away from the contact)")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(MANY))
def test_seeds_next_to_contact_of_random_arms(seed):
    rng = np.random.default_rng(seed)
    scene = mixed_arm(rng, int(rng.integers(2, 5)), longest=1.0)
    check(scene, next_to_contact(scene, rng, float(rng.choice(HAIRS))), lambda q: check_seed(scene, q) is not None)
