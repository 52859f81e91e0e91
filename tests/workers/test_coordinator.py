"""The coordinator's pure part."""

from __future__ import annotations

import pytest

from certifier.errors import CirisError
from certifier.growth.actions import Failed
from certifier.outcome import Outcome
from certifier.seeding.proposal import Proposal
from db.states import JobState, StepKind, StepState
from tests.scenes import slider
from tests.workers.options import box_around
from workers.coordinator import ending, next_transition, step_report


def test_the_report_of_a_step_is_what_it_found_or_its_error() -> None:
    found = {"C": [[1.0]], "d": [1.0], "center": [0.0], "contain": [], "info": {}}
    proposal = step_report(StepKind.PROPOSE, StepState.DONE, found)
    assert isinstance(proposal, Proposal)
    assert proposal.to_document() == found
    error = CirisError("x", "it failed", field="seed", hint="try again")
    failed = step_report(StepKind.STEP, StepState.FAILED, error.to_document())
    assert isinstance(failed, Failed)
    assert failed.error.to_document() == error.to_document()


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
        ("certify-path", Outcome.CERTIFIED, JobState.SUCCEEDED),
        ("certify-path", Outcome.TOO_CLOSE, JobState.SUCCEEDED),
        ("certify-path", Outcome.ERROR, JobState.FAILED),
    ],
)
def test_how_a_job_ends(kind: str, outcome: Outcome, state: JobState) -> None:
    end = ending(kind, outcome, "because", None)
    assert end.state == state
    assert (end.error is None) == (state == JobState.SUCCEEDED)
    assert state == JobState.SUCCEEDED or ending(kind, outcome, "because", {"code": "cause"}).error == {"code": "cause"}


@pytest.mark.parametrize(
    ("reason", "code", "hint"),
    [
        ("the deadline was reached", "not_grown", "allow more time"),
        ("a and b touch", "not_grown", "try another seed, or look at the pair named"),
        ("revoked: a and b touch", "revoked", "grow a region of the new scene from another seed"),
    ],
)
def test_a_growth_in_vain_says_what_to_do(reason: str, code: str, hint: str) -> None:
    error = ending("grow", Outcome.INCONCLUSIVE, reason, None).error
    assert error == {"code": code, "message": reason, "field": None, "hint": hint}


def test_a_job_that_has_begun_needs_a_report() -> None:
    options = box_around([0.0], 0.1)
    transition = next_transition(slider(), options, None, None)
    assert transition.action.kind == "certify"
    with pytest.raises(ValueError, match="report"):
        next_transition(slider(), options, transition.state, None)
