"""Membership of points in regions, against one region and one inequality at a time."""

import numpy as np
import pytest
from flint import arb, ctx
from hypothesis import given
from hypothesis import strategies as st

from certifier.errors import RegionError
from certifier.model import Joint, JointKind, Scene, StoredRegion
from planner.library import Library
from planner.membership import locate, to_s
from planner.motion.path import follow
from planner.motion.space import Space
from planner.nearest import nearest
from tests.planner.regions import box, cut_box, cut_boxes, library
from tests.planner.test_motion import arm


@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 5), regions=st.integers(1, 5), faces=st.integers(0, 20))
def test_points_are_located_as_one_inequality_at_a_time_says(seed: int, n: int, regions: int, faces: int) -> None:
    rng = np.random.default_rng(seed)
    stored, s = cut_boxes(rng, n, regions, faces), rng.uniform(-1.5, 1.5, size=(6, n))
    found = locate(stored, s)
    margins = {(k, r): margin for k, r, margin in zip(found.point, found.region, found.margin, strict=True)}
    for k, point in enumerate(s):
        for r in range(regions):
            polytope = stored.polytope(r)
            distances = [(d - c @ point) / np.linalg.norm(c) for c, d in zip(polytope.C, polytope.d, strict=True)]
            if abs(min(distances)) > 1e-12:
                assert ((k, r) in margins) == (min(distances) > 0) == bool(polytope.contains(point))
            if (k, r) in margins:
                assert margins[k, r] == pytest.approx(min(distances), abs=1e-12)


def test_hits_are_in_the_order_of_points_and_the_deepest_region_comes_first() -> None:
    stored = library(box("wide", [-1, -1], [1, 1]), box("narrow", [-0.5, -0.5], [0.5, 0.5]), box("far", [2, 2], [3, 3]))
    found = locate(stored, np.array([[0.0, 0.0], [2.5, 2.5], [9.0, 9.0], [0.5, 0.5]]))
    assert found.point.tolist() == [0, 0, 1, 3, 3]
    assert [stored.ids[i] for i in found.region] == ["wide", "narrow", "far", "wide", "narrow"]
    assert found.margin.tolist() == [1.0, 0.5, 0.5, 0.5, 0.0]


def test_many_points_and_regions_are_answered_like_few(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    stored, s = cut_boxes(rng, 3, 300), rng.uniform(-1, 1, size=(40, 3))
    at_once = locate(stored, s)
    monkeypatch.setattr("planner.membership._POINTS", 7)
    monkeypatch.setattr("planner.membership._PAIRS", 11)
    bit_by_bit = locate(stored, s)
    assert len(at_once.point) > 100
    for name in ("point", "region", "margin"):
        np.testing.assert_array_equal(getattr(at_once, name), getattr(bit_by_bit, name))


def test_no_regions_hold_nothing() -> None:
    assert locate(Library(3), np.zeros((4, 3))).point.shape == (0,)


def test_a_point_without_coordinates_is_outside_of_everything() -> None:
    limits = np.array([1e9, 1e9])
    everywhere = StoredRegion("all", "exact", np.zeros((1, 2)), np.ones(1), -limits, limits)
    found = locate(library(box("a", [0, 0], [1, 1]), everywhere), np.array([[0.0, 0.0], [np.nan, 0.0]]))
    assert set(found.point.tolist()) == {0}


@pytest.mark.slow
@given(seed=st.integers(0, 2**32 - 1), steps=st.lists(st.tuples(st.sampled_from([0, 1, 40]), st.integers(0, 3)), max_size=4))
def test_a_library_that_changed_again_and_again_is_like_a_new_one(seed: int, steps: list[tuple[int, int]]) -> None:
    """And the versions before stay as they were."""
    rng = np.random.default_rng(seed)
    s = rng.uniform(-1.5, 1.5, size=(10, 2))
    regions: dict[str, StoredRegion] = {}
    changing, history = Library(2), []
    for version, (more, fewer) in enumerate(steps, start=1):
        for name in list(regions)[:fewer]:
            del regions[name]
        added = [cut_box(rng, f"{version}.{i}", 2, 3) for i in range(more)]
        changing = changing.changed(version, list(regions), added)
        regions |= {region.id: region for region in added}
        history.append((changing, list(regions.values())))
    for version, (changed, expected) in enumerate(history, start=1):
        anew = Library(2).changed(version, [], expected)
        assert (changed.version, changed.ids, changed.first.tolist()) == (version, anew.ids, anew.first.tolist())
        np.testing.assert_array_equal(changed.faces, anew.faces)
        for name in ("point", "region", "margin"):
            np.testing.assert_array_equal(getattr(locate(changed, s), name), getattr(locate(anew, s), name))


def test_an_added_region_copies_no_faces_of_the_others() -> None:
    rng = np.random.default_rng(0)
    stored = cut_boxes(rng, 2, 50)
    once = stored.changed(2, stored.ids, [cut_box(rng, "first", 2, 3)])
    again = once.changed(3, once.ids, [cut_box(rng, "second", 2, 3)])
    assert np.shares_memory(once.faces, again.faces)


def elbow() -> Scene:
    """One revolute joint, -1 to 2 rad, parametrised around 0.5."""
    eye = np.eye(4)
    turn = Joint("m/turn", JointKind.REVOLUTE, "world", "m/link", np.array([0.0, 0.0, 1.0]), eye, eye, 0, -1.0, 2.0)
    return Scene("elbow", (turn,), ("world", "m/link"), (), (), (), np.array([0.5]))


def test_a_full_turn_away_is_outside_although_s_is_the_same() -> None:
    scene = elbow()
    s = to_s(scene, np.array([[0.7], [0.7 + 2 * np.pi], [2.0], [2.1]]))
    assert s[0] == pytest.approx(np.tan(0.1))
    assert np.isfinite(s).ravel().tolist() == [True, False, True, False]


HUGE = 9185166224891948.0
"""An angle of 0.6247 rad and whole turns, which plain doubles take for one of 0.02 rad: the next double is 2 rad away."""


@pytest.mark.parametrize("angle", [HUGE, -HUGE, 1e300, 1e7])
def test_an_angle_whose_turns_a_double_cannot_hold_is_in_no_region_and_outside_of_none(angle: float) -> None:
    scene = arm(1, -2.9, 2.9, own=(None, None))
    stored = library(box("a", [-0.3], [0.3]))
    q = np.array([[angle]])
    for ask in (
        lambda: to_s(scene, q),
        lambda: nearest(stored, q[0]),
        lambda: follow(stored, scene, Space.Q, np.concatenate([q, q]), [0.0, 1.0]),
        lambda: follow(stored, scene, Space.S, np.concatenate([q, q]), [0.0, 1.0]),
    ):
        with pytest.raises(RegionError) as refusal:
            ask()
        assert refusal.value.code == "number_too_large"


@given(turns=st.integers(-159_000, 159_000), place=st.floats(-2.89, 2.89))
def test_a_turn_away_a_point_is_in_the_regions_that_exact_numbers_say(turns: int, place: float) -> None:
    """The edge of the region is where the double beside it is: what doubles take off must not lead over it."""
    scene, q = arm(1, -2.9, 2.9, own=(None, None)), 2 * np.pi * turns + place
    with ctx.workprec(200):
        exactly = ((arb(q) - 2 * arb.pi() * turns) / 2).tan()
        edge = float(exactly.mid())
    hair = 4e-15 * (1 + edge**2)
    s = to_s(scene, np.array([[q]]))
    assert locate(library(box("a", [-20.0], [edge + hair])), s).point.size == 1
    assert locate(library(box("a", [-20.0], [edge - hair])), s).point.size == 0
