"""A box about the seed is the first region. Configurations in it, at its corners above all, are looked at by sampling."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from certifier.errors import RegionError
from certifier.growth.actions import Certify, Failed, Finish, Outcomes, Propose
from certifier.growth.machine import NEARBY, advance, begin
from certifier.growth.nearby import LEAST, PART, nearby
from certifier.growth.options import GrowthOptions
from certifier.jobs.local import grow
from certifier.model import WORLD, JointKind, Pair, Volume
from certifier.outcome import Outcome
from certifier.partition.together import gaps_between
from certifier.seeding.proposal import Proposal
from certifier.verify.region import verify_region
from tests.certifier.scenes import ball, box, planar_arm, random_tree, slides_together

NEAR = planar_arm(2, box("world/board", WORLD, (4.0, 0.2, 0.3), (0.0, 0.17, 0.0)))
"""The arm lies along a board that is 20 mm away."""


SEED = {"method": "box", "q": [0.0, 0.0], "half_width": 0.2}


def box_about(scene, s, *contain):
    found = nearby(scene, {"q": scene.to_q(s).tolist(), "contain": [scene.to_q(one).tolist() for one in contain]})
    if found is None:
        return None
    polytope, center = found
    assert center == pytest.approx(s)
    return polytope


def distances(scene, X):
    return np.array([gaps_between(scene, *(Volume.of(scene.geometry(name)) for name in (pair.a, pair.b)), X) for pair in scene.pairs])


def corners_and_samples(scene, polytope, count, seed):
    """Configurations in s at the ends of all joints of a box, and between them."""
    n, rng = scene.n, np.random.default_rng(seed)
    lower, upper = np.full(n, -np.inf), np.full(n, np.inf)
    for row, offset in zip(polytope.C, polytope.d, strict=True):
        (i,) = np.flatnonzero(row)
        end = offset / row[i]
        if row[i] > 0:
            upper[i] = min(upper[i], end)
        else:
            lower[i] = max(lower[i], end)
    places = rng.random((count, n))
    places[::2] = places[::2].round()
    return lower + (upper - lower) * places


def test_nothing_comes_nearer_than_its_part_and_all_joints_move_as_far():
    seed = np.zeros(2)
    X = corners_and_samples(NEAR, box_about(NEAR, seed), 2000, 0)
    before, there = distances(NEAR, seed[None])[:, 0], distances(NEAR, X)
    assert before.min() == pytest.approx(0.02)
    assert (there >= (1 - PART) * before[:, None] - 1e-9).all()
    widths = np.ptp(NEAR.to_q(X), axis=0)
    assert 0 < widths.min() == pytest.approx(widths.max())


def test_there_is_no_box_that_is_too_small_or_leaves_out_what_it_has_to_contain():
    seed = np.zeros(2)
    assert box_about(NEAR, seed, np.array([0.1, 0.0])) is None
    assert box_about(NEAR, seed, np.array([0.001, 0.0])) is not None
    nearly = planar_arm(2, box("world/board", WORLD, (4.0, 0.2, 0.3), (0.0, 0.151, 0.0)))
    assert 0 < distances(nearly, seed[None]).min() < 2 * LEAST
    assert box_about(nearly, seed) is None


@pytest.mark.parametrize("q", [(0.0,), (0.0, 0.0, 0.0), (9.0, 0.0), (1e17, 0.0), None])
def test_a_seed_that_is_refused_has_no_box(q):
    assert nearby(NEAR, {"q": q}) is None


def test_the_box_ends_at_the_limits():
    seed = np.array([NEAR.s_upper[0] - 1e-4, 0.0])
    place = (2.12 * np.cos(2.0), 2.12 * np.sin(2.0), 0.0)  # before the tip
    turned = replace(NEAR, geometries=(*NEAR.geometries[:-1], ball("world/board", WORLD, 0.1, place)))
    X = corners_and_samples(turned, box_about(turned, seed), 100, 0)
    assert X.max(axis=0)[0] == turned.s_upper[0]


@pytest.mark.parametrize("seed", range(12))
def test_nothing_comes_nearer_than_its_part_in_boxes_of_random_trees(seed):
    """Trees with turns and slides, in half of which two slides move together. Padding takes up all but 50 mm of the distances."""
    tree = random_tree(seed, (JointKind.REVOLUTE, JointKind.PRISMATIC))
    if seed % 2:
        tree = slides_together(tree, seed)
    rng = np.random.default_rng(seed)
    s = rng.uniform(-0.2, 0.2, tree.n)
    balls = tuple(ball(f"{body}/ball", body, 0.1, tuple(rng.normal(size=3))) for body in tree.bodies)
    pairs = tuple(Pair(a.name, b.name) for a, b in combinations(balls, 2))
    bare = replace(tree, geometries=balls, pairs=pairs)
    gaps = distances(bare, s[None])[:, 0]
    padded = replace(bare, pairs=tuple(replace(p, padding=(gap - 0.05) / 2) for p, gap in zip(pairs, gaps, strict=True) if gap > 0.06))
    before = distances(padded, s[None])[:, 0]
    polytope = box_about(padded, s)
    assert (distances(padded, corners_and_samples(padded, polytope, 400, seed)) >= (1 - PART) * before[:, None] - 1e-9).all()


def test_growth_certifies_the_box_and_then_the_proposal():
    begun = begin(NEAR, GrowthOptions(seed=SEED, stages=1))
    action = begun.action
    assert (action.label, action.pairs) == (NEARBY, [*range(len(NEAR.pairs))])
    first = advance(NEAR, begun.state, all_certified(action))
    assert (first.candidate.polytope, first.candidate.seed.tolist()) == (action.polytope, [0.0, 0.0])
    assert isinstance(first.action, Propose)
    C = np.concatenate([np.eye(2), -np.eye(2)])
    proposal = Proposal(C=C, d=np.full(4, 0.3), center=np.zeros(2), contain=np.zeros((0, 2)), info={})
    second = advance(NEAR, first.state, proposal)
    assert second.action.iteration == 1
    assert second.action.polytope.d[0] == pytest.approx(0.3)
    last = advance(NEAR, second.state, all_certified(second.action))
    assert last.candidate.polytope is second.action.polytope
    assert last.action == Finish(Outcome.CERTIFIED, "certified")
    # A growth without a proposal has the box.
    failed = advance(NEAR, first.state, Failed(RegionError("seeding_failed", "there is no proposal")))
    assert failed.action == Finish(Outcome.CERTIFIED, "certified; growth ended early: there is no proposal")


def test_growth_goes_on_where_the_box_is_not_certified():
    begun = begin(NEAR, GrowthOptions(seed=SEED, stages=1))
    outcome = [(i, Outcome.CERTIFIED if i else Outcome.INCONCLUSIVE, None, None) for i, _ in begun.action.work]
    after = advance(NEAR, begun.state, Outcomes.of_parts(begun.action, outcome, 0.0))
    assert after.candidate is None
    assert isinstance(after.action, Propose)
    failed = advance(NEAR, after.state, Failed(RegionError("seeding_failed", "there is no proposal")))
    assert failed.action.outcome is Outcome.ERROR


def all_certified(action):
    assert isinstance(action, Certify)
    return Outcomes.of_parts(action, [(i, Outcome.CERTIFIED, None, None) for i, _ in action.work], 0.0)


def test_the_first_region_is_small_and_larger_ones_follow():
    regions = []
    last = grow(NEAR, GrowthOptions(seed={**SEED, "half_width": 0.05}, stages=1), deliver=regions.append)
    volumes = [region.manifest["q_volume"]["value"] for region in (*regions, last)]
    assert volumes[-1] > 10 * volumes[0] > 0
    assert regions[0].manifest["share"] is None
    assert last.manifest["provenance"]["growth_curve"][0]["share"] < last.manifest["share"]["value"]
    assert {*verify_region(regions[0].proof).gaps} == {*NEAR.pairs}


def test_a_deadline_within_the_proposal_leaves_the_box():
    """Drake's IRIS takes longer than this for two joints. The time goes by the machine, and what is left does not."""
    region = grow(NEAR, GrowthOptions(seed={"method": "iris_np2", "q": [0.0, 0.0], "tries": 10}), deadline_s=5.0)
    assert region.reason == "the deadline was reached; the region is a small box about the seed"
    assert {*verify_region(region.proof).gaps} == {*NEAR.pairs}
