"""Targeted contraction, against a made-up truth: configurations in a disc are bad, and a pair fails while the polytope meets it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from certifier import stored
from certifier.growth.actions import Certify, Finish, Outcomes, Propose
from certifier.growth.machine import advance, begin, stored_state
from certifier.growth.options import GrowthOptions
from certifier.growth.paper.faces import Failure, contract, measure
from certifier.growth.paper.options import PaperOptions
from certifier.model import WORLD, Polytope
from certifier.outcome import Outcome
from certifier.pair.result import Weakness
from certifier.polytopes.ellipsoid import inscribed_ellipsoid
from certifier.seeding.proposal import Proposal
from tests.certifier.scenes import box, cube, planar_arm

SCENE = planar_arm(2, box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (0.8, 1.2, 0.0)))
PROPOSAL = Proposal(
    C=np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]), d=np.ones(4), center=np.zeros(2), contain=np.zeros((0, 2)), info={}
)
OPTIONS = PaperOptions(contractions=1, pushes=0, max_rounds=0)


def grow(disc, radius, options, spread=0.0, limit=300):
    """The accepted polytopes and the end when the pair of both joints fails while the polytope meets the disc nearest to the seed."""
    options = GrowthOptions(paper=options)
    transition, accepted = begin(SCENE, options), []
    for _ in range(limit):
        state = stored_state(json.loads(json.dumps(stored.document(transition.state))))
        if transition.candidate:
            accepted.append(transition.candidate.polytope)
        if isinstance(transition.action, Finish):
            return accepted, transition.action
        if isinstance(transition.action, Propose):
            transition = advance(SCENE, state, PROPOSAL)
            continue
        action = transition.action
        assert isinstance(action, Certify)
        nearest = disc - radius * disc / np.linalg.norm(disc)
        meets = action.polytope.contains(nearest[None])[0]
        failing = [i for i in action.pairs if meets and "link2" in SCENE.pairs[i].a]
        outcomes = {i: Outcome.NOT_CERTIFIABLE if i in failing else Outcome.CERTIFIED for i in action.pairs}
        weak = {i: Weakness(nearest[None], np.full(2, spread)) for i in failing}
        transition = advance(SCENE, state, Outcomes(action, outcomes, weak))
    raise AssertionError("growth does not end")


@pytest.mark.parametrize("disc", [(0.8, 0.3), (-0.5, -0.7), (0.0, 0.9)])
def test_faces_are_put_where_pairs_fail_and_the_seed_stays(disc):
    accepted, end = grow(np.array(disc), 0.2, OPTIONS)
    assert end.outcome is Outcome.CERTIFIED
    region = accepted[-1]
    assert (region.C @ np.zeros(2) < region.d).all()
    assert inscribed_ellipsoid(region).volume > 0.4 * np.pi, "more than uniform contraction could keep"


@pytest.mark.parametrize("disc", [(0.8, 0.3), (-0.5, -0.7), (0.0, 0.9)])
def test_pairs_that_fail_all_over_get_shorter_ranges(disc):
    accepted, end = grow(np.array(disc), 0.2, OPTIONS, spread=0.1)
    assert end.outcome is Outcome.CERTIFIED
    assert (accepted[-1].C @ np.zeros(2) < accepted[-1].d).all()


def test_a_seed_that_cannot_be_freed_ends_with_the_pair_named():
    accepted, end = grow(np.array([1e-9, 0.0]), 0.9e-9, OPTIONS, spread=0.1)
    assert not accepted
    assert end.outcome is Outcome.NOT_CERTIFIABLE
    assert "link2" in end.reason


def test_pushes_never_lose_volume_and_stay_in_the_proposal():
    accepted, end = grow(np.array([0.8, 0.3]), 0.2, replace(OPTIONS, pushes=4))
    volumes = [inscribed_ellipsoid(polytope).volume for polytope in accepted]
    assert volumes == sorted(volumes)
    assert end.outcome is Outcome.CERTIFIED
    region = accepted[-1]
    corners = np.random.default_rng(0).uniform(-2, 2, (2000, 2))
    assert np.abs(corners[region.contains(corners)]).max() <= 1 + 1e-9


@given(st.lists(st.floats(0.05, 3.0), min_size=2, max_size=2), st.lists(st.floats(-0.9, 0.9), min_size=2, max_size=2))
def test_the_measure_of_a_box_is_its_inscribed_ellipsoid(half, offset):
    half = np.array(half)
    region = Polytope(np.concatenate([np.eye(2), -np.eye(2)]), np.concatenate([half, half]))
    found = measure(region, half * offset)
    assert np.allclose(found.center, 0, atol=1e-7 * half.max())
    assert np.allclose(found.covariance, np.diag(half**2), rtol=1e-6, atol=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_a_contraction_is_a_subset_that_keeps_what_is_to_be_kept(seed):
    rng = np.random.default_rng(seed)
    region = cube(SCENE, 0.0, 0.5)
    keep = rng.uniform(-0.2, 0.2, (2, 2))
    failures = [
        Failure(joints, Weakness(rng.uniform(-0.5, 0.5, (3, 2)), rng.uniform(0, 0.3, 2)), int(rng.integers(5))) for joints in ((0,), (0, 1))
    ]
    smaller = contract(SCENE, region, measure(region, np.zeros(2)), keep, failures, rng.uniform(0.1, 1.0))
    assert smaller is not None
    samples = rng.uniform(-0.6, 0.6, (500, 2))
    assert region.contains(samples[smaller.contains(samples)]).all()
    assert (smaller.d[:, None] > smaller.C @ keep.T).all()
    assert smaller.contains(samples).sum() < region.contains(samples).sum()


@pytest.mark.parametrize("disc", [(0.8, 0.3), (-0.5, -0.7), (0.1, 0.5)])
def test_several_contractions_keep_the_largest(disc):
    """The second one is given up as soon as it is smaller than the first one's region."""
    single = [grow(np.array(disc), 0.2, replace(OPTIONS, contractions=1), spread=0.1)[0][-1]]
    several, end = grow(np.array(disc), 0.2, replace(OPTIONS, contractions=3), spread=0.1)
    volumes = [inscribed_ellipsoid(polytope).volume for polytope in (*single, *several)]
    assert volumes[1:] == sorted(volumes[1:])
    assert volumes[0] == volumes[1]
    assert end.outcome is Outcome.CERTIFIED
