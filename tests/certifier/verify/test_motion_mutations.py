"""Thousands of changes of proofs of motions: every one is refused with a ProofError, or what is stated of it is true."""

from __future__ import annotations

import numpy as np
import pytest

from certifier.verify.sides import Sides
from tests.certifier.verify.fuzz_motion import Campaign, case
from tests.certifier.verify.motion_mutations import KINDS, changed_bytes, changed_meaning, valid
from tests.certifier.verify.motion_oracle import MotionFile
from tests.certifier.verify.test_rounding import far_files

FEW = 40
LONG_CAMPAIGN = 10_000
PARTS = 20
"""The long campaign has this many parts, so that none of them takes minutes."""


def structured(count: int, seed: int, campaign: Campaign) -> list[str]:
    """What is wrong of structured changes."""
    rng, found = np.random.default_rng(seed), []
    for number in range(count):
        kind, data = changed_meaning(valid()[rng.integers(len(valid()))], rng)
        wrong = campaign.judge(kind, data)
        if wrong:
            found.append(f"{number}: {kind}: {wrong}")
    return found


def test_the_campaigns_proofs_hold_and_are_true():
    """In both spaces, of degrees 1 to 5, with tubes and ends before the motion's; the oracle's bound is near what is stated."""
    campaign, files = Campaign(), [MotionFile(data) for data in valid()]
    assert [campaign.judge("valid", data) for data in valid()] == [None] * len(valid())
    assert {(file.space, file.degree) for file in files} >= {("q", 1), ("s", 1), ("s", 2), ("q", 3), ("s", 4), ("q", 5), ("s", 5)}
    assert {file.end < 1 for file in files} == {file.rho > 0 for file in files} == {True, False}
    assert {joint["kind"] for file in files for joint in file.scene["joints"]} == {"revolute", "prismatic", "weld"}


def test_structured_changes_of_proofs_are_refused_or_true():
    campaign = Campaign()
    assert structured(FEW, 0, campaign) == []
    assert len({kind for kind, _ in campaign.outcomes}) == len(KINDS), campaign


def test_changed_bytes_of_proofs_are_refused_or_true():
    campaign, rng = Campaign(), np.random.default_rng(0)
    for _ in range(FEW):
        assert campaign.judge("bytes", changed_bytes(valid()[rng.integers(len(valid()))], rng)) is None
    assert {code for _, code in campaign.outcomes} >= {"accepted", "proof_malformed", "proof_motion"}, campaign


@pytest.mark.slow
@pytest.mark.parametrize("part", range(PARTS))
def test_a_long_campaign_of_structured_changes(part):
    campaign = Campaign()
    assert structured(LONG_CAMPAIGN // PARTS, 1 + part, campaign) == []
    print(campaign)


def test_a_case_is_made_again_from_its_number():
    assert [case(number, 3) for number in range(9)] == [case(number, 3) for number in range(9)]


def test_the_oracle_finds_what_a_verifier_without_a_bound_of_accelerations_would_accept(monkeypatch):
    monkeypatch.setattr(Sides, "accelerations", lambda self, levers, rates, changes: np.zeros(len(rates)))
    rng, campaign = np.random.default_rng(0), Campaign()
    changed = (changed_meaning(valid()[rng.integers(len(valid()))], rng) for _ in range(400))
    wrong = next(wrong for kind, data in changed if (wrong := campaign.judge(kind, data)))
    assert "apart at most" in wrong


def test_the_oracle_finds_an_overlap_that_only_rounding_hides(monkeypatch):
    """2e-10 m deep, with a body's frame a million metres off its joint. Processors round sums differently, so not every one hides it."""
    monkeypatch.setattr(Sides, "sizes", lambda self, slid: np.full(len(slid), 1.0))
    campaign = Campaign()
    wrong = [found for data in far_files() if (found := campaign.judge("far", data))]
    print(len(wrong), campaign)
    assert wrong
    assert all("apart at most" in found for found in wrong)
