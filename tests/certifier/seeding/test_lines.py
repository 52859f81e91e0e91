"""The lines between the seed and what the region has to contain: where bodies touch on one, no region is asked for.

The hook of the crane swings past a post on the way from one angle to another, which trigonometry tells.
"""

from __future__ import annotations

import re
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from certifier.errors import RegionError
from certifier.growth.options import GrowthOptions
from certifier.jobs.local import grow
from certifier.scene import load_scene
from certifier.seeding.hindrance import hindrance
from certifier.seeding.options import Method, SeedOptions
from certifier.seeding.propose import check_seed, propose
from tests.certifier.seeding.test_propose import clearance, crane
from tests.oracles.clearance import DrakesClearance

EXAMPLES = Path(__file__).parents[3] / "examples"
BEFORE, BESIDE, BEHIND = (1.5, 0.8), (1.8, 0.8), (1.5, 2.3)
"""Configurations before the post and behind it."""
OPTIONS = {"limits": {}, "box": {"half_width": 0.1}, "iris_np2": {}, "iris_zo": {}}


def refused(**seed: object) -> RegionError:
    with pytest.raises(RegionError) as error:
        propose(crane(), SeedOptions.from_document(seed))
    assert error.value.code == "contain_blocked"
    return error.value


@pytest.mark.parametrize("method", [*OPTIONS, "polytope"])
def test_points_between_which_bodies_touch_are_refused_for_every_method(method: str) -> None:
    if method == "polytope":
        error = refused(method=method, C=[[1.0, 0.0]], d=[1.9], contain=[BEFORE, BESIDE, BEHIND])
    else:
        error = refused(method=method, q=BEFORE, contain=[BESIDE, BEHIND], **OPTIONS[method])
    start = "contain[0]" if method == "polytope" else "the seed"
    assert error.field == ("seed.contain[2]" if method == "polytope" else "seed.contain[1]")
    assert error.message.startswith("crane/arm/hook and world/ahead touch at q = ")
    assert error.message.endswith(f"on the straight line in s from {start} to this configuration")


def test_two_points_to_contain_are_named_where_the_seed_sees_both() -> None:
    error = refused(q=(0.0, 0.5), contain=[BEFORE, BEHIND])
    assert error.field == "seed.contain[1]"
    assert "from contain[0] to this configuration" in error.message


def test_growing_refuses_them_and_advises_nothing_that_cannot_help() -> None:
    with pytest.raises(RegionError) as error:
        grow(crane(), GrowthOptions(seed={"q": BEFORE, "contain": [BEHIND]}), deadline_s=60.0)
    assert error.value.code == "contain_blocked"
    assert not re.search(r"more time|rows of C|--from", str(error.value))


ANGLES = st.tuples(st.floats(-2.0, 2.0), st.floats(-2.5, 2.5))


@given(a=ANGLES, b=ANGLES, padding=st.sampled_from([0.0, 0.05]))
def test_a_line_is_refused_exactly_where_trigonometry_says_that_it_touches(a, b, padding) -> None:
    scene = crane(padding=padding)
    ends = scene.to_s(np.array([a, b]))
    assume((clearance(scene, ends) > 1e-3).all())
    line = ends[0] + np.linspace(0, 1, 2001)[:, None] * (ends[1] - ends[0])
    least = clearance(scene, line).min()
    assume(abs(least) > 1e-4)
    options = SeedOptions(Method.LIMITS, q=a, contain=(b,))
    if least > 0:
        propose(scene, options)
        return
    with pytest.raises(RegionError) as error:
        propose(scene, options)
    named = re.search(r"touch at q = \((\S+) m, (\S+) rad\), on", error.value.message)
    s = scene.to_s(np.array([[float(x) for x in named.groups()]]))
    assert abs(clearance(scene, s)[0]) < 1e-6, "the first contact is named"
    direction = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    off = (s[0] - ends[0]) - ((s[0] - ends[0]) @ direction) * direction
    assert np.linalg.norm(off) < 1e-3


def test_a_line_next_to_contact_is_named_if_no_region_comes_of_it() -> None:
    scene = crane()
    slide = 1.5 - np.sqrt(1.2001**2 - 1)  # the hook passes the post at 0.1 mm
    past = np.arctan2(1.0, 1.5 - slide)
    line = scene.to_s(np.array([[slide, past - 0.3], [slide, past + 0.3]]))
    assert clearance(scene, line).min() > 5e-3, "its ends have room"
    proposal = propose(scene, SeedOptions(Method.LIMITS, q=tuple(scene.to_q(line[0])), contain=(tuple(scene.to_q(line[1])),)))
    said = proposal.info["hindrance"]
    assert re.match(r"the line from the seed to contain\[0\] is 0\.1\S* mm from contact of crane/arm/hook and world/ahead, and no", said)


def test_an_end_next_to_contact_is_named_rather_than_the_line() -> None:
    scene = crane()
    tight = check_seed(scene, (1.5 - 0.2001, np.pi / 2))
    line = replace(tight, field="the line from the seed to contain[0]", distance=tight.distance - 1e-9)
    assert hindrance(scene, [tight, line]).startswith("the seed is 0.1 mm from contact")


def test_a_seed_on_contact_is_left_to_what_is_said_of_seeds() -> None:
    scene = crane()
    touching = 1.5 - 0.2 - 1e-8
    proposal = propose(scene, SeedOptions(Method.LIMITS, q=(touching, np.pi / 2), contain=((touching - 0.1, np.pi / 2),)))
    assert proposal.info["hindrance"].startswith("the seed is 1e-05 mm from contact")


@pytest.mark.parametrize("method", OPTIONS)
def test_a_contact_in_the_middle_of_points_that_see_one_another_is_refused(method: str) -> None:
    """Each side of this triangle is free, and Drake finds the post within it."""
    scene = load_scene(EXAMPLES / "planar_2dof/scene.yaml")
    corners = np.array([(-1.7072, -1.5029), (1.4046, -2.0546), (-1.3543, 2.3956)])
    drake, s = DrakesClearance(scene), scene.to_s(corners)
    for a, b in combinations(s, 2):
        assert all(drake.free(scene.to_q(x)) for x in a + np.linspace(0, 1, 200)[:, None] * (b - a))
    seed = {"method": method, "q": corners[0].tolist(), "contain": corners[1:].tolist(), **OPTIONS[method]}
    with pytest.raises(RegionError) as error:
        propose(scene, SeedOptions.from_document(seed))
    assert (error.value.code, error.value.field) == ("contain_blocked", "seed.contain")
    said = r"(\S+) and (\S+) touch at q = \((.+)\) rad, between the configurations that the region has to hold"
    named = re.fullmatch(said, error.value.message)
    q = np.array([float(x) for x in named[3].split(",")])
    distance, pair = drake.least(q)
    assert distance <= 1e-9
    assert {pair.a, pair.b} == {named[1], named[2]}
    weights = np.linalg.solve(np.concatenate([s.T, np.ones((1, 3))]), np.append(scene.to_s(q), 1.0))
    assert (weights >= -1e-6).all(), "it is between the three"
