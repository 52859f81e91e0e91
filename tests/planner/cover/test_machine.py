"""The state machine of covers: it ends whatever it is told, says why, and never grows more than was asked for."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from certifier import stored
from certifier.errors import RegionError
from planner.cover.machine import IDLE, LATE, LOOKS, TRIES, advance, begin, unreached
from planner.cover.options import ENOUGH, CoverOptions
from planner.cover.result import said
from planner.cover.state import CoverState, Ended, Finish, Late, Move, Moved, Purpose, Report, Scout, Scouted, Task, Transition, Watch

HERE, THERE = (0.0, 0.0), (1.0, 1.0)
SOMEWHERE = Task((0.5, 0.5), Purpose.COVER)


def seen(covered: int = 0, **found: Any) -> Scouted:
    return Scouted(samples=100, covered=covered, regions=1 + covered, components=(1 + covered,), **found)


def after(state: CoverState, *reports: Report) -> Transition:
    transition = Transition(state, Scout())
    for report in reports:
        transition = advance(transition.state, report)
    return transition


@st.composite
def looks(draw: st.DrawFn, options: CoverOptions) -> Scouted:
    """Anything that a look might say, possible or not."""
    components = tuple(draw(st.lists(st.integers(1, 5), max_size=4)))
    part = st.none() if not components else st.none() | st.integers(0, len(components) - 1)
    tasks = st.builds(Task, st.just(HERE), st.sampled_from(Purpose), st.integers(0, 2), st.sampled_from([(), (HERE, THERE)]))
    return Scouted(
        version=draw(st.integers(0, 100)),
        regions=sum(components),
        samples=100,
        covered=draw(st.integers(0, 100)),
        components=components,
        seeds=tuple(draw(st.booleans()) for _ in options.seeds),
        connect=tuple(draw(part) for _ in options.connect),
        paths=tuple(draw(st.floats(0, 1)) for _ in options.paths),
        proposals=tuple(draw(st.lists(tasks, max_size=4))),
        obstacles=tuple(draw(st.lists(st.just("no way"), max_size=1))),
    )


@given(data=st.data())
@settings(max_examples=150, deadline=None)
def test_whatever_is_reported_in_whatever_order_it_ends_and_says_why(data: st.DataObject) -> None:
    options = CoverOptions(
        seeds=data.draw(st.sampled_from([(), (HERE,)])),
        connect=data.draw(st.sampled_from([(), (HERE, THERE)])),
        paths=data.draw(st.sampled_from([(), ((HERE, THERE),)])),
        coverage=data.draw(st.sampled_from([None, 0.5, 1.0])),
        connected=data.draw(st.booleans()),
        regions=data.draw(st.integers(1, 6)),
        at_once=data.draw(st.integers(1, 3)),
    )
    transition, late, told, asked = begin(options), False, 0, list[str]()
    for _ in range(100):
        state, action = transition.state, transition.action
        document = json.loads(json.dumps(stored.document(state)))
        assert stored.value(CoverState, document) == state
        assert len(state.growing) <= options.at_once
        assert state.begun <= options.regions
        if isinstance(action, Finish):
            break
        if isinstance(action, Watch):
            assert state.growing
            assert set(action.begin) <= set(state.growing)
            asked += [task.request for task in action.begin.values()]
        report: Report
        if not late and data.draw(st.integers(0, 9)) == 0:
            report, late = Late(), True
        elif isinstance(action, Scout):
            report, told = data.draw(looks(options)), told + 1
        elif isinstance(action, Move):
            assert options.connect
            report = Moved(data.draw(st.sampled_from([(), ((0, 1),)])))
        else:
            some = data.draw(st.sets(st.sampled_from(sorted(state.growing)), min_size=1))
            report = Ended({number: data.draw(st.sampled_from([None, "it touches"])) for number in some})
        transition = advance(state, report)
    assert isinstance(action, Finish), "it did not end"
    assert not state.growing
    assert len(set(asked)) == len(asked), "nothing is asked for twice"
    assert action.reason
    if state.last is None:
        assert late
        assert (action.reached, action.fruitless, state.begun) == (False, True, 0), "the deadline came before the first look"
        return
    missing = unreached(options, state.last, state.moved or ())
    assert action.reached == (not missing)
    assert action.reached or all(text in action.reason for text in missing)
    assert (said(state) or {})["goals"] is action.reached
    assert told == state.looks or late


def test_it_begins_what_is_given_first_and_no_more_than_may_grow_at_once() -> None:
    options = CoverOptions(seeds=(HERE,), connect=(HERE, THERE), at_once=2)
    first = after(begin(options).state, seen(seeds=(False,), connect=(None, None), proposals=(SOMEWHERE,)))
    assert isinstance(first.action, Watch)
    assert [task.key for task in first.action.begin.values()] == ["seed[0]", "connect[1]"], "the seed is connect[0] as well"
    then = after(first.state, Ended({0: None}), seen(seeds=(True,), connect=(0, None), proposals=(SOMEWHERE,)))
    assert isinstance(then.action, Watch)
    assert [task.key for task in then.action.begin.values()] == ["cover"], "connect[1] grows already"


def test_goals_that_are_reached_end_it_and_what_grows() -> None:
    state = after(begin(CoverOptions(coverage=0.5)).state, seen(10, proposals=(SOMEWHERE, Task(THERE, Purpose.COVER)))).state
    stopping = after(state, Ended({0: None}), seen(60))
    assert stopping.action == Watch(stop=True)
    last = after(stopping.state, Ended({1: "cancelled"}))
    assert last.action == Scout(), "what was accepted meanwhile counts"
    assert after(last.state, seen(61)).action == Finish(True, "the goals are reached")


def test_regions_that_are_there_already_may_be_enough() -> None:
    assert after(begin(CoverOptions()).state, seen(96)).action == Finish(True, "the goals are reached")


@pytest.mark.parametrize("options", [CoverOptions(), CoverOptions(connected=True, coverage=ENOUGH)])
def test_coverage_is_a_goal_where_nothing_else_is(options: CoverOptions) -> None:
    assert options.enough == ENOUGH
    assert unreached(options, seen(94)) == ["94 % of the free configurations are covered, not 95 %"]
    assert CoverOptions(connected=True).enough is None


def test_a_configuration_around_which_no_region_grows_is_given_up_with_words() -> None:
    state = begin(CoverOptions(connect=(HERE, THERE), at_once=1)).state
    transition = after(state, seen(connect=(0, None)))
    for number in range(TRIES):
        assert isinstance(transition.action, Watch)
        task = transition.action.begin[number]
        assert (task.key, task.turn) == ("connect[1]", number), "each time with another random seed"
        transition = after(transition.state, Ended({number: "bodies touch"}), seen(connect=(0, None)))
    for _ in range(LOOKS - 1):
        assert transition.action == Scout()
        transition = after(transition.state, seen(connect=(0, None)))
    assert transition.action == Move()
    transition = after(transition.state, Moved(()))
    assert isinstance(transition.action, Finish)
    assert not transition.action.reached
    assert transition.action.fruitless
    assert transition.action.reason == "nothing is left that could be tried; no region contains connect[1]; connect[1]: bodies touch"


def test_components_that_cannot_be_joined_end_it_with_words() -> None:
    apart = replace(seen(connect=(0, 1), obstacles=("no motion was found",)), components=(1, 1))
    moving = after(begin(CoverOptions(connect=(HERE, THERE))).state, *[apart] * LOOKS)
    assert moving.action == Move()
    assert after(moving.state, Moved(((0, 1),))).action == Finish(True, "the goals are reached, by motions where regions do not lead")
    action = after(moving.state, Moved(())).action
    assert isinstance(action, Finish)
    assert (action.reached, action.fruitless) == (False, True)
    assert action.reason.endswith("the configurations to connect are in 2 components; no motion was found")


def test_regions_that_change_nothing_end_it() -> None:
    places = [Task((float(i), 0.0), Purpose.COVER) for i in range(IDLE + 1)]
    transition = after(begin(CoverOptions(at_once=1)).state, seen(10, proposals=tuple(places[:1])))
    for number in range(IDLE):
        transition = after(transition.state, Ended({number: None}), seen(10, proposals=tuple(places[: number + 2])))
    assert isinstance(transition.action, Finish)
    assert transition.action.reason.startswith(f"the last {IDLE} regions changed nothing")
    assert transition.state.begun == IDLE


def test_the_deadline_stops_what_grows_and_looks_once_more() -> None:
    growing = after(begin(CoverOptions()).state, seen(10, proposals=(SOMEWHERE,)))
    stopping = after(growing.state, Late())
    assert stopping.action == Watch(stop=True)
    action = after(stopping.state, Ended({0: None}), seen(20)).action
    assert action == Finish(False, f"{LATE}; 20 % of the free configurations are covered, not 95 %")
    nothing = replace(seen(0), regions=0, components=())
    empty = after(after(begin(CoverOptions()).state, nothing).state, Late(), nothing).action
    assert isinstance(empty, Finish)
    assert empty.fruitless, "it has no region"


def test_a_deadline_before_the_first_look_ends_the_cover() -> None:
    """A look may take minutes where hardly any configuration is free."""
    assert after(begin(CoverOptions()).state, Late()).action == Finish(
        False, f"{LATE} before the cover had looked at the scene", fruitless=True
    )


@pytest.mark.parametrize(
    ("document", "field"),
    [
        ({"colour": 1}, "options.colour"),
        ({"coverage": 0.0}, "options.coverage"),
        ({"coverage": 1.5}, "options.coverage"),
        ({"regions": 0}, "options.regions"),
        ({"at_once": True}, "options.at_once"),
        ({"stages": 0}, "options.stages"),
        ({"region_seconds": 0.0}, "options.region_seconds"),
        ({"connect": [[0.0, 0.0]]}, "options.connect"),
    ],
)
def test_options_that_make_no_sense_are_refused(document: dict[str, Any], field: str) -> None:
    with pytest.raises(RegionError) as refused:
        CoverOptions.from_document(document)
    assert refused.value.field == field
