"""Whole covers of small scenes, with a grower that is as stubborn as IRIS: from a place that a region holds, it makes that region again.

No region of a cover has the same request as another one, and none is one that the scene had when it was asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from certifier.model import Array, Scene
from planner.cover.ground import Collides
from planner.cover.look import Look
from planner.cover.machine import advance, begin
from planner.cover.options import CoverOptions
from planner.cover.state import Ended, Finish, Move, Moved, Purpose, Report, Scout, Task, Watch
from tests.planner.cover.test_look import LIMIT, Wall, known, scene, walls

__all__ = ["scene"]
SIDE, MOST = 5, 40
STEPS = np.linspace(-LIMIT, LIMIT, SIDE + 1)
Box = tuple[tuple[float, float], tuple[float, float]]
"""A region, a box in q: its lower and its upper corner."""


class Grower:
    """Knows a few free boxes, and makes the first of them that holds all points of a task; fails where there is none."""

    def __init__(self, scene: Scene, collides: Collides, rng: np.random.Generator) -> None:
        self._boxes = [box for box in self._lattice() if not collides(scene.to_s(self._points(box))).any()]
        rng.shuffle(self._boxes)  # type: ignore[arg-type]

    @staticmethod
    def _lattice() -> list[Box]:
        spans = [(a, b) for i, a in enumerate(STEPS) for b in STEPS[i + 1 :]]
        return [((x[0], y[0]), (x[1], y[1])) for x in spans for y in spans]

    @staticmethod
    def _points(box: Box) -> Array:
        grid = np.stack(np.meshgrid(*np.linspace(*box, 21).T), axis=-1)
        return grid.reshape(-1, 2)

    def __call__(self, task: Task) -> Box | None:
        points = np.array([task.q, *task.contain])
        return next((box for box in self._boxes if ((points > box[0]) & (points < box[1])).all()), None)


def covered(
    scene: Scene, those: Sequence[Wall], options: CoverOptions, there: list[Box], rng: np.random.Generator
) -> tuple[Finish, list[tuple[Task, bool]]]:
    """Carries out a cover. Returns its end, and its tasks, each with whether it made a region that was there when it was begun."""
    collides = walls(scene, those)
    grow, look = Grower(scene, collides, rng), Look(scene, collides, options)
    transition, made = begin(options), list[tuple[Task, bool]]()
    growing: dict[int, Box | None] = {}
    while not isinstance(transition.action, Finish):
        state, action = transition.state, transition.action
        if isinstance(action, Move):
            transition = advance(state, Moved(()))
            continue
        if isinstance(action, Scout):
            report: Report = look(known(scene, *there), state)
        else:
            made += _begun(action, grow, growing, there)
            some = [*growing] if action.stop else [int(rng.choice([*growing]))]
            ended = {number: growing.pop(number) for number in some}
            there += [box for box in ended.values() if box is not None]
            report = Ended({number: "no room" if box is None else None for number, box in ended.items()})
        transition = advance(state, report)
    return transition.action, made


def _begun(action: Watch, grow: Grower, growing: dict[int, Box | None], there: list[Box]) -> list[tuple[Task, bool]]:
    growing |= {number: grow(task) for number, task in action.begin.items()}
    return [(task, growing[number] in there) for number, task in action.begin.items()]


@st.composite
def scenes(draw: st.DrawFn) -> list[Wall]:
    """A wall from below with a way over it, and a few posts."""
    top = draw(st.sampled_from([-1.0, 0.0, 1.0, 1.5]))
    posts = draw(
        st.lists(st.sampled_from([(-1.2, -0.8, -0.2, 0.2), (0.8, 1.2, -1.5, -1.1), (0.8, 1.2, 0.9, 1.3)]), max_size=3, unique=True)
    )
    return [(-0.1, 0.1, -LIMIT, top), *posts]


def check_a_cover(
    scene: Scene, those: list[Wall], ends: tuple[float, ...], coverage: float | None, connected: bool, at_once: int, number: int
) -> None:
    rng = np.random.default_rng(number)
    connect = (ends[:2], ends[2:])
    if walls(scene, those)(scene.to_s(np.array(connect))).any():
        return
    options = CoverOptions(connect=connect, coverage=coverage, connected=connected, at_once=at_once, regions=MOST, random_seed=number)
    end, made = covered(scene, those, options, [((-1.9, -1.9), (-1.0, -1.3))], rng)
    requests = [(task.q, task.contain, task.turn) for task, _ in made]
    assert len(set(requests)) == len(requests), end.reason
    assert not [task for task, again in made if again], end.reason


COVERS = {
    "those": scenes(),
    "ends": st.tuples(st.floats(-1.9, -0.3), st.floats(-1.9, 1.9), st.floats(0.3, 1.9), st.floats(-1.9, 1.9)),
    "coverage": st.sampled_from([None, 0.6]),
    "connected": st.booleans(),
    "at_once": st.integers(1, 3),
    "number": st.integers(0, 1000),
}


@given(**COVERS)
@settings(max_examples=10, deadline=None)
def test_no_cover_asks_twice_or_for_what_is_there(scene: Scene, **cover: Any) -> None:
    check_a_cover(scene, **cover)


@pytest.mark.slow
@given(**COVERS)
@settings(max_examples=200, deadline=None)
def test_of_many_covers_none_asks_twice_or_for_what_is_there(scene: Scene, **cover: Any) -> None:
    check_a_cover(scene, **cover)


def test_a_region_that_joins_nothing_is_not_grown_again(scene: Scene) -> None:
    """The grower knows no box over the wall. So the cover ends soon, and says what is apart."""
    options = CoverOptions(connect=((-1.0, 0.5), (1.0, 0.5)), at_once=1)
    end, made = covered(scene, [(-0.1, 0.1, -LIMIT, 1.9)], options, [((-1.9, -1.9), (-1.5, -1.5))], np.random.default_rng(0))
    assert not end.reached
    assert "the configurations to connect are in 2 components" in end.reason
    assert len({task.request for task, _ in made}) == len(made) < MOST
    assert {Purpose.CONNECT, Purpose.JOIN} == {task.purpose for task, _ in made}
