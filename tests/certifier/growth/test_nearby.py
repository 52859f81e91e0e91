"""A box about a seed in a narrow place is the first region. Configurations in it, at its corners above all, are looked at by sampling."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from certifier.growth.actions import Certify, Finish, Outcomes
from certifier.growth.machine import advance, begin
from certifier.growth.nearby import NARROW, PART, nearby
from certifier.growth.options import GrowthOptions
from certifier.growth.state import Start
from certifier.growth.whole import FIRST
from certifier.jobs.local import grow
from certifier.model import WORLD, JointKind, Pair, Volume
from certifier.outcome import Outcome
from certifier.partition.together import gaps_between
from certifier.seeding.proposal import Proposal
from certifier.verify.region import verify_region
from tests.certifier.scenes import ball, box, planar_arm, random_tree, slides_together

NEAR = planar_arm(2, box("world/board", WORLD, (4.0, 0.2, 0.3), (0.0, 0.17, 0.0)))
"""The arm lies along a board that is 20 mm away."""


def start(scene, s, *keep):
    C = np.concatenate([np.eye(scene.n), -np.eye(scene.n)])
    rows = scene.polytope(C, np.concatenate([s + 0.4, 0.4 - s]))
    return Start(rows, s, np.array([s, *keep]))


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


def test_the_box_is_small_where_the_seed_is_near_and_missing_where_it_has_room():
    seed = np.zeros(2)
    polytope = nearby(NEAR, start(NEAR, seed))
    X = corners_and_samples(NEAR, polytope, 2000, 0)
    before, there = distances(NEAR, seed[None])[:, 0], distances(NEAR, X)
    assert before.min() == pytest.approx(0.02)
    assert (there >= (1 - PART) * before[:, None] - 1e-9).all()
    widths = np.ptp(NEAR.to_q(X), axis=0)
    assert 0 < widths.min() == pytest.approx(widths.max())
    assert widths.max() < 2 * NARROW
    assert nearby(planar_arm(2, box("world/board", WORLD, (4.0, 0.2, 0.3), (0.0, 1.22, 0.0))), start(NEAR, seed)) is None
    assert nearby(NEAR, start(NEAR, seed, np.array([0.1, 0.0]))) is None
    assert nearby(NEAR, start(NEAR, seed, np.array([0.001, 0.0]))) is not None


def test_the_box_ends_at_the_limits():
    seed = np.array([NEAR.s_upper[0] - 1e-4, 0.0])
    place = (2.12 * np.cos(2.0), 2.12 * np.sin(2.0), 0.0)  # before the tip
    turned = replace(NEAR, geometries=(*NEAR.geometries[:-1], ball("world/board", WORLD, 0.1, place)))
    X = corners_and_samples(turned, nearby(turned, start(turned, seed)), 100, 0)
    assert X.max(axis=0)[0] == turned.s_upper[0]


@pytest.mark.parametrize("seed", range(12))
def test_nothing_comes_nearer_than_its_part_in_boxes_of_random_trees(seed):
    """Trees with turns and slides, in half of which two slides move together. Padding takes up all but 20 mm of the distances."""
    tree = random_tree(seed, (JointKind.REVOLUTE, JointKind.PRISMATIC))
    if seed % 2:
        tree = slides_together(tree, seed)
    rng = np.random.default_rng(seed)
    s = rng.uniform(-0.2, 0.2, tree.n)
    balls = tuple(ball(f"{body}/ball", body, 0.1, tuple(rng.normal(size=3))) for body in tree.bodies)
    pairs = tuple(Pair(a.name, b.name) for a, b in combinations(balls, 2))
    bare = replace(tree, geometries=balls, pairs=pairs)
    gaps = distances(bare, s[None])[:, 0]
    padded = replace(bare, pairs=tuple(replace(p, padding=(gap - 0.02) / 2) for p, gap in zip(pairs, gaps, strict=True) if gap > 0.03))
    before = distances(padded, s[None])[:, 0]
    polytope = nearby(padded, start(padded, s))
    assert polytope is not None
    assert (distances(padded, corners_and_samples(padded, polytope, 400, seed)) >= (1 - PART) * before[:, None] - 1e-9).all()


def test_growth_certifies_the_box_first_and_then_as_from_any_seed():
    C = np.concatenate([np.eye(2), -np.eye(2)])
    proposal = Proposal(C=C, d=np.full(4, 0.3), center=np.zeros(2), contain=np.zeros((0, 2)), info={})
    transition = advance(NEAR, begin(NEAR, GrowthOptions(seed={}, stages=1)).state, proposal)
    widths, numbers = [], []
    for _ in range(10):
        action = transition.action
        if isinstance(action, Finish):
            break
        assert isinstance(action, Certify)
        widths.append(action.polytope.d[0])
        numbers.append(transition.state.whole.stage)
        reached = [(i, Outcome.CERTIFIED, None, None) for i, _ in action.work]
        transition = advance(NEAR, transition.state, Outcomes.of_parts(action, reached, 0.0))
        assert transition.candidate is not None, "each of these regions is better than the one before"
    assert numbers == [0, 1]
    assert widths[0] < NARROW
    assert widths[1] == pytest.approx(FIRST * 0.3)
    assert transition.action.outcome is Outcome.CERTIFIED


def test_the_first_region_is_small_and_larger_ones_follow():
    C = np.concatenate([np.eye(2), -np.eye(2)]).tolist()
    asked = GrowthOptions.from_document({"seed": {"method": "polytope", "C": C, "d": [0.2] * 4, "center": [0.0, 0.0]}})
    regions = []
    last = grow(NEAR, asked, deliver=regions.append)
    volumes = [region.manifest["q_volume"]["value"] for region in (*regions, last)]
    assert 0 < volumes[0] < 4 * NARROW**2
    assert volumes[-1] > 10 * volumes[0]
    assert {*verify_region(regions[0].proof).gaps} == {*NEAR.pairs}
