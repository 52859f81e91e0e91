"""The coordinator's pure part."""

from __future__ import annotations

from itertools import chain

import pytest
from hypothesis import given
from hypothesis import strategies as st

from certifier.growth import Certification, Failed, Proposed
from certifier.outcome import Outcome
from db.states import JobState, StepKind, StepState
from tests.scenes import slider
from tests.workers.options import box_around
from workers.coordinator import batches, certification_report, ending, next_transition, step_report

forecasts = st.lists(st.floats(0, 2), max_size=60)


@given(forecasts)
def test_batches_hold_every_pair_once_and_none_is_overfull(seconds: list[float]) -> None:
    groups = batches(list(enumerate(seconds)), 0.5)
    assert sorted(chain.from_iterable(groups)) == list(range(len(seconds)))
    for group in groups:
        assert len(group) == 1 or sum(seconds[i] for i in group) <= 0.5 + 1e-9
        assert group == sorted(group)


@given(forecasts)
def test_big_pairs_travel_alone_and_first_the_longest_before_the_others(seconds: list[float]) -> None:
    groups = batches(list(enumerate(seconds)), 0.5)
    big = [i for i, s in enumerate(seconds) if s >= 0.5]
    first = [group[0] for group in groups[: len(big)]]
    assert sorted(first) == big
    assert [seconds[i] for i in first] == sorted((seconds[i] for i in big), reverse=True)


def test_small_pairs_fill_a_batch() -> None:
    assert batches([(i, 0.1) for i in range(7)], 0.5) == [[0, 1, 2, 3, 4], [5, 6]]


def test_skipped_pairs_are_not_reported() -> None:
    states = {0: "certified", 1: "skipped", 2: "refuted", 3: "error"}
    weak = {2: {"points": [[0.5]], "spread": [0.0]}}
    expected = Certification(5, {0: Outcome.CERTIFIED, 2: Outcome.REFUTED, 3: Outcome.ERROR}, weak)
    assert certification_report(5, states, weak) == expected


def test_the_report_of_a_step_is_what_it_found_or_its_error() -> None:
    found = {"C": [[1.0]], "d": [1.0], "center": [0.0], "info": {}}
    assert step_report(StepKind.PROPOSE, StepState.DONE, found) == Proposed(**found)
    assert step_report(StepKind.STEP, StepState.FAILED, {"code": "x"}) == Failed({"code": "x"})


@pytest.mark.parametrize(
    ("kind", "outcome", "state"),
    [
        ("grow", Outcome.CERTIFIED, JobState.SUCCEEDED),
        ("grow", Outcome.REFUTED, JobState.FAILED),
        ("grow", Outcome.INCONCLUSIVE, JobState.FAILED),
        ("certify", Outcome.CERTIFIED, JobState.SUCCEEDED),
        ("certify", Outcome.REFUTED, JobState.SUCCEEDED),
        ("certify", Outcome.NOT_CERTIFIABLE, JobState.SUCCEEDED),
        ("certify", Outcome.ERROR, JobState.FAILED),
    ],
)
def test_how_a_job_ends(kind: str, outcome: Outcome, state: JobState) -> None:
    end = ending(kind, outcome, "because", None)
    assert end.state == state
    assert (end.error is None) == (state == JobState.SUCCEEDED)
    assert state == JobState.SUCCEEDED or ending(kind, outcome, "because", {"code": "cause"}).error == {"code": "cause"}


def test_a_job_that_has_begun_needs_a_report() -> None:
    options = box_around([0.0], 0.1)
    transition = next_transition(slider(), options, None, None)
    assert transition.action.kind == "certify"
    with pytest.raises(ValueError, match="report"):
        next_transition(slider(), options, transition.state, None)
