"""A look at a scene whose free part is known: rooms in the square of two joints, with walls between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from certifier.errors import RegionError
from certifier.model import Array, Scene
from planner.cover.ground import Collides, clique, free_samples, sees
from planner.cover.known import Known
from planner.cover.look import Look
from planner.cover.machine import TRIES, begin
from planner.cover.options import CoverOptions
from planner.cover.routes import along, routes
from planner.cover.state import Purpose, Scouted, Task
from planner.overlap import compare
from tests.certifier.scenes import planar_arm
from tests.planner.regions import box, library

LIMIT = 2.0
Wall = tuple[float, float, float, float]
DOOR: Sequence[Wall] = [(-0.1, 0.1, -LIMIT, 1.0)]
"""A wall in the middle that leaves a door at the top: q1 from, to, q2 from, to."""
SHUT: Sequence[Wall] = [(-0.1, 0.1, -LIMIT, LIMIT)]


@pytest.fixture(scope="module")
def scene() -> Scene:
    return planar_arm(limit=LIMIT)


def walls(scene: Scene, those: Sequence[Wall]) -> Collides:
    def collides(s: Array) -> NDArray[np.bool_]:
        q = scene.to_q(s)
        inside = [(q[:, 0] >= a) & (q[:, 0] <= b) & (q[:, 1] >= c) & (q[:, 1] <= d) for a, b, c, d in those]
        return np.any(inside, axis=0) if inside else np.zeros(len(s), dtype=bool)

    return collides


def known(scene: Scene, *boxes: tuple[Sequence[float], Sequence[float]]) -> Known:
    """Regions that are boxes in q."""
    found = library(*(box(str(i), scene.to_s(lower), scene.to_s(upper)) for i, (lower, upper) in enumerate(boxes)))
    edges = [
        (other, compared.row, common.witness.tolist())
        for compared in compare(found, [(i, i + 1, 0) for i in range(len(found))], np.inf)
        for other, common in compared.found
    ]
    return Known.of(found, edges)


def looked(
    scene: Scene,
    those: Sequence[Wall],
    options: CoverOptions,
    there: Known,
    failed: dict[str, int] | None = None,
    tried: Sequence[Task] = (),
) -> Scouted:
    state = replace(begin(options).state, failed=failed or {}, tried=tuple(task.request for task in tried))
    return Look(scene, walls(scene, those), options)(there, state)


@pytest.mark.parametrize("random_seed", range(5))
def test_the_coverage_is_that_of_the_area_in_q(scene: Scene, random_seed: int) -> None:
    there = known(scene, ((-1.5, -1.0), (-0.1, 1.0)), ((-1.0, 0.0), (-0.1, 1.5)))
    area = 1.4 * 2.0 + 0.9 * 0.5
    free = (2 * LIMIT) ** 2 - 0.2 * 3.0
    seen = looked(scene, DOOR, CoverOptions(random_seed=random_seed), there)
    assert abs(seen.coverage - area / free) < 4 * seen.stderr
    assert seen.stderr == pytest.approx(np.sqrt(area / free * (1 - area / free) / seen.samples), rel=0.1)
    assert (seen.regions, seen.components, seen.largest) == (2, (2,), seen.covered)


def test_all_and_nothing_have_an_error_too(scene: Scene) -> None:
    all_of_it = looked(scene, [], CoverOptions(), known(scene, ((-LIMIT, -LIMIT), (LIMIT, LIMIT))))
    nothing = looked(scene, [], CoverOptions(), known(scene, ((1.9, 1.9), (1.90001, 1.90001))))
    assert (all_of_it.coverage, nothing.coverage) == (1.0, 0.0)
    assert all_of_it.stderr == nothing.stderr == 1 / all_of_it.samples


def test_components_and_what_they_hold_are_told_the_one_that_covers_most_first(scene: Scene) -> None:
    there = known(scene, ((0.5, 0.5), (0.6, 0.6)), ((-1.9, -1.9), (-0.2, 0.0)), ((-1.9, -0.1), (-0.2, 1.9)))
    options = CoverOptions(connect=((0.55, 0.55), (-1.0, 1.0), (1.8, 1.8)), seeds=((-1.0, -1.0), (1.0, -1.0)))
    seen = looked(scene, DOOR, options, there)
    assert (seen.components, seen.connect, seen.seeds) == ((2, 1), (1, 0, None), (True, False))
    assert 0 < seen.largest < seen.covered
    assert not seen.joined()


def test_a_seed_sees_what_is_not_covered(scene: Scene) -> None:
    """One room is covered, so the first proposal is in the other one."""
    seen = looked(scene, DOOR, CoverOptions(), known(scene, ((-LIMIT, -LIMIT), (-0.1, LIMIT))))
    assert seen.proposals
    assert all(task.purpose is Purpose.COVER for task in seen.proposals)
    assert seen.proposals[0].q[0] > 0


def test_seeds_at_the_same_time_are_far_apart(scene: Scene) -> None:
    """Both rooms are empty: a region that grows in one of them sends the next seed into the other."""
    nowhere = known(scene, ((1.99, 1.99), (1.991, 1.991)))
    options = CoverOptions()
    state = begin(options).state
    look = Look(scene, walls(scene, SHUT), options)
    first = look(nowhere, state).proposals[0]
    second = look(nowhere, replace(state, growing={0: first})).proposals[0]
    assert first.q[0] * second.q[0] < 0


def test_a_join_goes_through_the_door_and_holds_both_ends(scene: Scene) -> None:
    there = known(scene, ((-1.9, -1.9), (-0.2, -0.5)), ((0.2, -1.9), (1.9, -0.5)))
    options = CoverOptions(connect=((-1.0, -1.0), (1.0, -1.0)))
    seen = looked(scene, DOOR, options, there)
    (join,) = seen.proposals
    home = seen.connect[0]
    assert home is not None
    assert (join.key, len(join.contain)) == ("join[1]", 2)
    begins = np.array(join.contain[0])
    mine = -1 if there.library.lower[0][0] == scene.to_s([-1.9, -1.9])[0] else 1
    assert begins[0] * mine > 0, "it begins in the component of the first configuration"
    assert begins[1] <= -0.5 + 1e-9
    assert sees(walls(scene, DOOR), scene.to_s([join.contain[0]]), scene.to_s([join.contain[1]]))[0]


def test_what_no_motion_joins_is_told(scene: Scene) -> None:
    there = known(scene, ((-1.9, -1.9), (-0.2, -0.5)), ((0.2, -1.9), (1.9, -0.5)))
    seen = looked(scene, SHUT, CoverOptions(connect=((-1.0, -1.0), (1.0, -1.0))), there)
    assert seen.proposals == ()
    assert seen.obstacles == ("no collision-free motion to the component of connect[1] was found",)
    linked = looked(scene, SHUT, CoverOptions(connected=True), there)
    assert len(linked.obstacles) == 1


def test_what_was_tried_too_often_is_not_tried_again(scene: Scene) -> None:
    there = known(scene, ((-1.9, -1.9), (-0.2, -0.5)), ((0.2, -1.9), (1.9, -0.5)))
    options = CoverOptions(connect=((-1.0, -1.0), (1.0, -1.0)))
    lengths = []
    for failures in range(TRIES):
        (join,) = looked(scene, DOOR, options, there, {"join[1]": failures}).proposals
        lengths.append(np.linalg.norm(np.subtract(*join.contain)) if join.contain else 0.0)
    assert lengths[1] < 0.8 * lengths[0]
    assert lengths[-1] == 0, "at last without anything to contain"
    assert looked(scene, DOOR, options, there, {"join[1]": TRIES}).proposals == ()


def test_a_free_straight_line_is_tried_first_and_shorter_parts_of_it_after_it(scene: Scene) -> None:
    """The nearest points are on both sides of the wall; the line between the configurations goes over it, and ends in no region."""
    low = (-0.1, 0.1, -LIMIT, 0.0)
    there = known(scene, ((-1.9, -1.9), (-0.15, 0.9)), ((0.15, -1.9), (1.9, 0.9)))
    options = CoverOptions(connect=((-1.0, 0.5), (1.0, 0.5)))
    tried: list[Task] = []
    for _ in range(4):
        seen = looked(scene, [low], options, there, tried=tried)
        (join,) = seen.proposals
        assert join.request not in {task.request for task in tried}
        tried.append(join)
    begin_q, end_q = np.array(tried[0].contain)
    assert sees(walls(scene, [low]), scene.to_s(begin_q[None]), scene.to_s(end_q[None]))[0]
    assert np.sign(begin_q[0]) != np.sign(end_q[0]), "it holds all of what is between the components"
    whole, shorter = (np.linalg.norm(np.subtract(*task.contain)) for task in tried[:2])
    assert shorter < whole


def test_nothing_is_asked_for_that_a_region_holds_already(scene: Scene) -> None:
    """The route leaves through a sliver: what is close to the component is in it, and would become the same region again."""
    there = known(scene, ((-1.9, -1.9), (-0.15, 0.9)), ((0.15, -1.9), (1.9, 0.9)))
    options = CoverOptions(connect=((-1.0, 0.5), (1.0, 0.5)))
    tried: list[Task] = []
    for _ in range(30):
        seen = looked(scene, [(-0.1, 0.1, -LIMIT, 1.8)], options, there, tried=tried)
        if not seen.proposals:
            break
        points = scene.to_s(np.array([seen.proposals[0].q, *seen.proposals[0].contain]))
        library = there.library
        assert not any(((points >= library.lower[i]) & (points <= library.upper[i])).all() for i in range(len(library)))
        tried += seen.proposals
    assert len({task.request for task in tried}) == len(tried) > 0


def test_a_path_goes_on_where_it_stops_being_covered(scene: Scene) -> None:
    options = CoverOptions(paths=(((-1.5, 1.5), (1.5, 1.5)),))
    seen = looked(scene, DOOR, options, known(scene, ((-1.9, 1.2), (-0.5, 1.9))))
    assert seen.paths == (pytest.approx(1 / 3),)
    (task,) = seen.proposals
    assert task.key == "path[0]"
    begin_q, end_q = task.contain
    assert -0.7 < begin_q[0] < -0.5, "it overlaps what is covered"
    assert end_q == pytest.approx((1.5, 1.5), abs=0.05), "nothing is in between"
    done = looked(scene, DOOR, options, known(scene, ((-1.9, 1.2), (1.9, 1.9))))
    assert (done.paths, done.proposals) == ((1.0,), ())


@pytest.mark.parametrize(
    ("options", "field"),
    [
        (CoverOptions(seeds=((0.0, 0.0),)), "options.seeds[0]"),
        (CoverOptions(connect=((1.0, 1.0), (0.0, -1.0))), "options.connect[1]"),
        (CoverOptions(paths=(((-1.0, 0.0), (1.0, 0.0)),)), "options.paths[0]"),
    ],
)
def test_what_is_given_in_collision_is_refused(scene: Scene, options: CoverOptions, field: str) -> None:
    with pytest.raises(RegionError) as refused:
        Look(scene, walls(scene, DOOR), options)
    assert refused.value.field == field


def test_a_scene_without_anything_free_is_refused(scene: Scene) -> None:
    with pytest.raises(RegionError, match="free of collisions"):
        free_samples(scene, lambda s: np.ones(len(s), dtype=bool), 1, np.random.default_rng(0))


def test_a_route_is_free_and_there_is_none_through_a_wall(scene: Scene) -> None:
    starts, ends = scene.to_s([[-1.0, -1.0]]), scene.to_s([[1.0, -1.0]])
    found = next(routes(scene, walls(scene, DOOR), starts, ends, np.random.default_rng(0)), None)
    assert found is not None
    assert (found[0].tolist(), found[-1].tolist()) == (starts[0].tolist(), ends[0].tolist())
    assert not walls(scene, DOOR)(along(found, 0.02)).any()
    assert not list(routes(scene, walls(scene, SHUT), starts, ends, np.random.default_rng(0)))


def test_a_clique_sees_itself() -> None:
    rng = np.random.default_rng(0)
    visible = rng.random((30, 30)) < 0.4
    visible = visible | visible.T | np.eye(30, dtype=bool)
    members = clique(visible, np.ones(30))
    assert visible[np.ix_(members, members)].all()
    assert len(members) >= 3
    light = np.where(np.arange(30) < 10, 1.0, 0.0)
    assert set(clique(visible, light)) <= set(range(10)), "what weighs nothing is no member"


def test_tasks_say_what_they_are_about() -> None:
    assert Task((0.0,), Purpose.LINK, 3).key == "link[3]"
