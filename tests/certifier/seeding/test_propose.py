"""Proposals: what is refused, what each method gives, and what IRIS may claim."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from certifier.errors import RegionError
from certifier.model import Geometry, Joint, JointKind, Pair, Scene
from certifier.outcome import Guarantee
from certifier.polytopes.polytope import bounds
from certifier.seeding.options import Method, SeedOptions
from certifier.seeding.propose import check_seed, propose


def ball(name, body, center, radius):
    return Geometry(name, body, np.array([center], dtype=float), radius, {"kind": "sphere", "radius": radius})


def crane(padding=0.0, pairs=("ahead",), q_star=(0.1, -0.2)):
    """A cart on rails along x, |x| <= 2, with an arm of length 1 turning about z, |angle| <= 2.5, and a ball of radius 0.1 at its end.

    Balls of radius 0.1 stand at (1.5, 1), ``ahead``, and at (-1, 1), ``behind``.
    """
    eye, tip = np.eye(4), np.eye(4)
    slide = Joint("crane/slide", JointKind.PRISMATIC, "world", "crane/cart", np.array([1.0, 0, 0]), eye, eye, 0, -2.0, 2.0)
    turn = Joint("crane/turn", JointKind.REVOLUTE, "crane/cart", "crane/arm", np.array([0, 0, 1.0]), eye, tip, 1, -2.5, 2.5)
    hook = ball("crane/arm/hook", "crane/arm", (1, 0, 0), 0.1)
    posts = {"ahead": ball("world/ahead", "world", (1.5, 1, 0), 0.1), "behind": ball("world/behind", "world", (-1, 1, 0), 0.1)}
    return Scene(
        "crane", (slide, turn), ("world", "crane/cart", "crane/arm"), (hook, *posts.values()),
        tuple(Pair("crane/arm/hook", posts[name].name) for name in pairs), (), np.array(q_star), padding,
    )  # fmt: skip


def clearance(scene, s):
    """(k,) distance between the hook and the nearest post of the pairs, less twice the padding, for points s (k, 2); by trigonometry."""
    q = scene.to_q(s)
    hook = np.stack([q[:, 0] + np.cos(q[:, 1]), np.sin(q[:, 1]), 0 * q[:, 0]], axis=1)
    posts = [scene.geometry(pair.b).vertices[0] for pair in scene.pairs]
    return np.min([np.linalg.norm(hook - post, axis=1) for post in posts], axis=0) - 0.2 - 2 * scene.padding


def uniform(polytope, count=20_000):
    lo, hi = bounds(polytope)
    s = np.random.default_rng(0).uniform(lo, hi, (count, len(lo)))
    return s[polytope.contains(s)]


@pytest.mark.parametrize(
    ("q", "code", "words"),
    [
        ([0.0], "seed_wrong_length", "2 joints"),
        ([0.0, 0.0, 0.0], "seed_wrong_length", "3 numbers"),
        ([0.0, math.nan], "number_too_large", "nan"),
        ([math.inf, 0.0], "number_too_large", "inf"),
        ([0.0, 2.6], "seed_outside_limits", "crane/turn is at 2.6 rad"),
        ([-2.0 - 1e-6, 0.0], "seed_outside_limits", "crane/slide is at -2.000001 m, not between its limits -2 and 2 m"),
        ([1.5, math.pi / 2], "seed_in_collision", "crane/arm/hook and world/ahead overlap by 0.2 m"),
    ],
)
def test_seeds_that_are_refused(q, code, words):
    with pytest.raises(RegionError) as error:
        check_seed(crane(), q)
    assert error.value.code == code
    assert words in error.value.message
    assert error.value.field.startswith("seed.q")


@pytest.mark.parametrize("method", [Method.IRIS, Method.BOX, Method.LIMITS])
@pytest.mark.parametrize("q", [(2.0, 0.2), pytest.param((-2.0, 2.5), marks=pytest.mark.slow), (2.0 + 5e-10, -2.5 - 5e-10)])
def test_a_seed_on_a_limit_is_moved_inside_by_a_hair(method, q):
    scene = crane()
    proposal = propose(scene, SeedOptions(method, q=q, contain=((1.9, -2.5),), max_iterations=1, half_width=0.001))
    points = scene.polytope(proposal.C, proposal.d)
    for point, asked in zip((proposal.center, proposal.contain[0]), (q, (1.9, -2.5)), strict=True):
        assert (points.C @ point < points.d).all()
        np.testing.assert_allclose(scene.to_q(point), asked, atol=2e-4)
    untouched = propose(scene, SeedOptions(method, q=(1.9999, 0.2), max_iterations=1, half_width=0.001))
    assert np.array_equal(untouched.center, scene.to_s((1.9999, 0.2)))


@pytest.mark.parametrize("padding", [0.0, 0.03])
@pytest.mark.parametrize("q", [[1.5, math.pi / 2], [1.4, 1.4], [1.5 - 0.22, math.pi / 2]])
def test_a_seed_in_collision_gets_a_free_one_near_by(q, padding):
    scene = crane(padding=padding)
    if clearance(scene, scene.to_s(np.array([q])))[0] > 0:
        check_seed(scene, q)
        return
    with pytest.raises(RegionError) as error:
        check_seed(scene, q)
    said = re.search(r"q = \(([-\d.]+) m, ([-\d.]+) rad\); it moves crane/(slide|turn) most, by", error.value.hint)
    found = np.array([float(said[1]), float(said[2])])
    gap = clearance(scene, scene.to_s(found[None]))[0]
    assert 0 < gap < 0.05
    check_seed(scene, found)


def test_where_nothing_is_free_the_hint_says_so_much():
    scene = crane(padding=9.0)
    with pytest.raises(RegionError) as error:
        check_seed(scene, [0.0, 0.0])
    assert error.value.hint == "move the seed, or ignore the pair in the scene"


def test_padding_counts_against_the_seed():
    q = [1.5 - 0.25, math.pi / 2]
    check_seed(crane(padding=0.02), q)
    with pytest.raises(RegionError) as error:
        check_seed(crane(padding=0.03), q)
    assert error.value.code == "seed_in_collision"
    assert "0.05 m apart" in error.value.message


def test_only_the_scenes_pairs_count():
    check_seed(crane(pairs=("behind",)), [1.5, math.pi / 2])
    check_seed(crane(pairs=()), [1.5, math.pi / 2])


@pytest.mark.parametrize("method", [Method.IRIS, Method.IRIS_NP2, Method.IRIS_ZO])
@pytest.mark.parametrize("padding", [0.0, 0.05])
def test_iris_keeps_its_statistical_promise(method, padding):
    """A uniform sample of the region, and trigonometry: at most epsilon of it is in collision. Mixed joints, q* off zero."""
    scene = crane(padding=padding, pairs=("ahead", "behind"))
    q = np.array([0.3, 0.2])
    proposal = propose(scene, SeedOptions(method, q=tuple(q), max_iterations=2, random_seed=3))
    polytope = scene.polytope(proposal.C, proposal.d)
    assert proposal.info["guarantee"] == Guarantee.SAMPLED
    assert proposal.info["termination"] in ("tolerance", "iteration_limit")
    assert proposal.info["faces"] == len(proposal.d) >= 1
    assert 1 <= proposal.info["iterations"] <= 2
    assert np.array_equal(proposal.center, scene.to_s(q))
    assert np.all(proposal.C @ proposal.center < proposal.d)
    s = uniform(polytope)
    assert (clearance(scene, s) < 0).mean() <= SeedOptions().epsilon
    assert len(s) > 1000
    # Not only free but large.
    far = uniform(scene.polytope(np.zeros((0, 2)), np.zeros(0)))
    assert polytope.contains(far).mean() > 0.15


def test_pairs_that_are_ignored_do_not_bound_the_region():
    scene = crane(pairs=())
    proposal = propose(scene, SeedOptions(Method.IRIS, q=(0.3, 0.2)))
    assert len(proposal.d) == 0
    one = crane(pairs=("behind",))
    region = one.polytope(*_faces(propose(one, SeedOptions(Method.IRIS, q=(0.5, 0.5)))))
    assert (clearance(crane(pairs=("ahead",)), uniform(region)) < 0).any()


def _faces(proposal):
    return proposal.C, proposal.d


def test_iris_is_deterministic_for_a_seed():
    scene = crane()
    a, b, c = (propose(scene, SeedOptions(q=(0.3, 0.2), max_iterations=1, random_seed=k)) for k in (1, 1, 2))
    assert np.array_equal(a.C, b.C)
    assert np.array_equal(a.d, b.d)
    assert not np.array_equal(a.d, c.d)


def test_iris_that_gave_up_claims_nothing():
    """One round of faces cannot pass the test where there is a collision to cut off."""
    options = SeedOptions(Method.IRIS_NP2, q=(0.3, 0.2), max_iterations=1, max_iterations_separating_planes=1, epsilon=0.01)
    proposal = propose(crane(), options)
    assert proposal.info["guarantee"] == Guarantee.NONE
    assert proposal.info["guarantee"] == "none"
    assert any("voids the probabilistic guarantees" in warning for warning in proposal.info["warnings"])


def test_iris_stops_at_the_tolerance():
    info = propose(crane(), SeedOptions(q=(0.3, 0.2), max_iterations=50, tolerance=0.5)).info
    assert info["termination"] == "tolerance"
    assert info["iterations"] < 50


@pytest.mark.parametrize("method", [Method.IRIS, Method.IRIS_NP2, Method.IRIS_ZO, Method.BOX])
def test_what_has_to_be_contained_is(method):
    """Far from the seed, and near to the ball, where IRIS by itself would not go."""
    scene, contain = crane(), ((-1.5, -0.3), (0.2, 0.5))
    proposal = propose(scene, SeedOptions(method, q=(0.3, 0.2), contain=contain, max_iterations=1, half_width=0.01))
    points = scene.to_s(np.array([(0.3, 0.2), *contain]))
    assert np.allclose(proposal.contain, points[1:])
    assert (proposal.d[:, None] > proposal.C @ points.T).all()


def test_box_is_clipped_to_the_limits():
    scene = crane()
    q = np.array([1.9, 0.0])
    proposal = propose(scene, SeedOptions(Method.BOX, q=tuple(q), half_width=0.5))
    lo, hi = bounds(scene.polytope(proposal.C, proposal.d))
    s = scene.to_s(q)
    assert np.allclose(lo, s - 0.5)
    assert np.allclose(hi, [scene.s_upper[0], s[1] + 0.5])
    assert len(proposal.d) == 3
    assert proposal.info["guarantee"] == Guarantee.NONE


def test_polytope_is_taken_as_it_is():
    scene = crane()
    C, d = ((1.0, 1.0), (-1.0, 0.0)), (0.5, 0.3)
    proposal = propose(scene, SeedOptions(Method.POLYTOPE, C=C, d=d))
    assert np.array_equal(proposal.C, C)
    assert np.array_equal(proposal.d, d)
    assert np.all(scene.polytope(C, d).C @ proposal.center < scene.polytope(C, d).d)
    assert np.array_equal(propose(scene, SeedOptions(Method.POLYTOPE, C=C, d=d, center=(0.1, 0.2))).center, [0.1, 0.2])


@pytest.mark.parametrize(
    ("document", "code", "field"),
    [
        ({"C": [[1.0, 0.0], [-1.0, 0.0]], "d": [-1.0, 0.0]}, "polytope_empty", "polytope"),
        ({"C": [[1.0, 0.0], [-1.0, 0.0]], "d": [-5.0, 9.0]}, "polytope_empty", "polytope"),  # outside the joint limits
        ({"C": [[1.0, 0.0], [-1.0]], "d": [1.0, 1.0]}, "polytope_shape", "seed.C"),
        ({"C": [[1.0, 0.0, 0.0]], "d": [1.0]}, "polytope_shape", "seed.C"),
        ({"C": [], "d": [1.0]}, "polytope_shape", "seed.C"),
        ({"C": [[1.0, math.nan]], "d": [1.0]}, "polytope_not_finite", "seed.C"),
        ({"C": [[1.0, 0.0]], "d": [0.5], "center": [0.6, 0.0]}, "center_outside", "seed.center"),
        ({"C": [[1.0, 0.0]], "d": [0.5], "center": [0.0]}, "center_outside", "seed.center"),
    ],
)
def test_polytopes_that_are_refused(document, code, field):
    with pytest.raises(RegionError) as error:
        propose(crane(), SeedOptions.from_document({"method": "polytope", **document}))
    assert (error.value.code, error.value.field) == (code, field)


@pytest.mark.parametrize(
    ("document", "field"),
    [
        ({"q": [0, 0], "speed": 3}, "seed.speed"),
        ({"q": [0, 0], "method": "magic"}, "seed.method"),
        ({"method": "box"}, "seed.q"),
        ({"method": "box", "q": [0]}, "seed.half_width"),
        ({"q": [0], "half_width": 0.1}, "seed.half_width"),
        ({"method": "polytope", "C": [[1]]}, "seed.d"),
        ({"method": "polytope", "C": [[1]], "d": [1], "q": [0]}, "seed.q"),
        ({"q": [0], "center": [0]}, "seed.center"),
        ({"q": "0,0"}, "seed.q"),
        ({"q": [0, "x"]}, "seed.q"),
        ({"q": [0, True]}, "seed.q"),
        ({"method": "polytope", "C": [[1], "x"], "d": [1, 1]}, "seed.C[1]"),
        ({"method": "polytope", "C": 3, "d": [1, 1]}, "seed.C"),
        ({"q": [0], "epsilon": 0}, "seed.epsilon"),
        ({"q": [0], "delta": 1}, "seed.delta"),
        ({"q": [0], "tolerance": math.nan}, "seed.tolerance"),
        ({"q": [0], "half_width": "wide"}, "seed.half_width"),
        ({"q": [0], "max_iterations": 0}, "seed.max_iterations"),
        ({"q": [0], "max_iterations": 2.5}, "seed.max_iterations"),
        ({"q": [0], "tries": 0}, "seed.tries"),
        ({"q": [0], "random_seed": True}, "seed.random_seed"),
    ],
)
def test_options_that_are_refused_name_the_field(document, field):
    with pytest.raises(RegionError) as error:
        SeedOptions.from_document(document)
    assert error.value.field == field


@given(
    st.builds(
        SeedOptions,
        method=st.sampled_from([Method.IRIS, Method.IRIS_NP2, Method.IRIS_ZO, Method.BOX]),
        q=st.lists(st.floats(-3, 3), min_size=1).map(tuple),
        half_width=st.floats(1e-6, 10),
        epsilon=st.floats(1e-6, 0.5),
        delta=st.floats(1e-6, 0.5),
        max_iterations=st.integers(1, 100),
        tolerance=st.floats(1e-6, 1),
        margin=st.floats(1e-6, 1),
        random_seed=st.integers(0, 2**31 - 1),
        tries=st.integers(1, 1000),
    ).map(
        lambda one: SeedOptions(Method.BOX, one.q, half_width=one.half_width) if one.method is Method.BOX else replace(one, half_width=None)
    )
)
def test_options_survive_a_round_trip(options):
    assert SeedOptions.from_document(options.to_document()) == options


def test_defaults_are_valid():
    assert SeedOptions.from_document({"q": [0, 1]}) == replace(SeedOptions(), q=(0.0, 1.0))


def test_the_limits_are_a_proposal_without_faces():
    proposal = propose(crane(), SeedOptions(Method.LIMITS, q=(0.3, 0.2)))
    assert proposal.C.shape == (0, 2)
    assert proposal.info["method"] == "limits"
