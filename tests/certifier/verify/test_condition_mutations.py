"""Changes of proofs whose scenes have conditions: each is refused with a ProofError, or what its statement says of conditions is true."""

from __future__ import annotations

import traceback
from collections import Counter

import numpy as np
import pytest

from certifier.errors import ProofError
from certifier.verify.file import verify_file
from tests.certifier.verify.condition_mutations import KINDS, changed, valid
from tests.certifier.verify.condition_oracle import untrue

FEW = {"region": 80, "motion": 120, "map": 30}
LONG_CAMPAIGN, PARTS = {"region": 6000, "motion": 5000, "map": 1000}, 4
"""The long campaign has this many parts for each kind of proof."""


def judged(data: bytes) -> tuple[str, str | None]:
    """Returns what the verifier made of a file, and what is wrong about it."""
    try:
        with np.errstate(all="ignore"):
            statement = verify_file(data)
    except ProofError as error:
        return error.code, None
    except Exception:
        return "crashed", traceback.format_exc()
    return "accepted", untrue(data, statement.kind, statement.lines)


def campaign(kind: str, count: int, seed: int) -> tuple[Counter[tuple[str, str]], list[str]]:
    """Returns what became of the changes, and what is wrong of them."""
    rng, outcomes, wrong = np.random.default_rng([seed, len(kind)]), Counter(), []
    for at in range(count):
        what, data = changed(valid(kind)[rng.integers(len(valid(kind)))], rng)
        outcome, problem = judged(data)
        outcomes[what, outcome] += 1
        if problem:
            wrong.append(f"{kind} {at} of seed {seed}: {what}: {problem}")
    return outcomes, wrong


@pytest.mark.parametrize("kind", FEW)
def test_the_campaigns_proofs_hold_and_are_true(kind: str) -> None:
    assert [judged(data) for data in valid(kind)] == [("accepted", None)] * len(valid(kind))


@pytest.mark.parametrize("kind", FEW)
def test_changes_of_conditions_are_refused_or_true(kind: str) -> None:
    outcomes, wrong = campaign(kind, FEW[kind], 0)
    assert wrong == []
    assert {outcome for _, outcome in outcomes} >= {"accepted", "proof_model"}, outcomes
    assert len({what.split(",")[0] for what, _ in outcomes}) == len(KINDS), outcomes


def test_the_oracle_sees_what_a_verifier_that_believes_conditions_would_accept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("certifier.verify.scene.check_conditions", lambda _: None)
    _, wrong = campaign("motion", 60, 0)
    assert any("this fails by" in one for one in wrong)


@pytest.mark.slow
@pytest.mark.parametrize("part", range(PARTS))
@pytest.mark.parametrize("kind", FEW)
def test_a_long_campaign(kind: str, part: int) -> None:
    outcomes, wrong = campaign(kind, LONG_CAMPAIGN[kind] // PARTS, 1 + part)
    print(
        kind, part, sum(n for (_, outcome), n in outcomes.items() if outcome == "accepted"), "accepted and true", sorted(outcomes.items())
    )
    assert wrong == []
