"""Progress of a proposal, and the reason that a job gives when the deadline ends the proposal."""

from __future__ import annotations

import numpy as np
import pytest

from certifier.errors import CirisError
from certifier.growth.options import GrowthOptions
from certifier.isolation import telling
from certifier.jobs import local
from certifier.jobs.growing import proposing
from certifier.seeding import iris, propose, trim
from certifier.seeding.options import SeedOptions
from certifier.seeding.proposal import NO_ROOM
from tests.certifier.scenes import planar_arm

SEED = [0.0, 0.0]
GROW = GrowthOptions(seed={"q": SEED, "contain": [[0.5, 0.0]]})
"""The box about the seed does not contain the other configuration, so there is no region before the proposal."""


def test_a_growth_says_for_how_long_it_proposes_and_how_many_faces_there_are(monkeypatch: pytest.MonkeyPatch) -> None:
    told = []

    def run(*_: object, tell, **__: object) -> None:
        tell({})
        tell({"faces": 31})
        raise CirisError("child_died", "it died")

    monkeypatch.setattr(local, "run_in_child", run)
    with pytest.raises(CirisError, match="it died"):
        local.grow(planar_arm(2), GROW, lambda kind, data: told.append((kind, data.get("text"))))
    assert [text for kind, text in told if kind == "note"] == ["proposing, 0 s", "proposing, 0 s, 31 faces"]
    assert proposing(40.4, {"faces": 1, "hindrance": ""}) == "proposing, 40 s, 1 face"


@pytest.mark.parametrize("known", ["", f"the seed is 0.03 mm from contact of a and b{NO_ROOM}"])
def test_a_deadline_while_it_proposes_is_explained_by_what_is_known_of_the_seed(known: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(*_: object, tell, **__: object) -> None:
        tell({"hindrance": known})
        raise CirisError("child_timeout", "it took more than 1 s")

    monkeypatch.setattr(local, "run_in_child", run)
    with pytest.raises(CirisError) as error:
        local.grow(planar_arm(2), GROW, deadline_s=1.0)
    assert (error.value.code, error.value.message) == ("not_grown", f"the deadline was reached; {known}".removesuffix("; "))
    assert error.value.hint == ("allow more time, or move the seed away from the contact" if known else "allow more time")


def test_faces_and_hindrance_are_told_before_iris_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    for module in (iris, trim, propose):
        monkeypatch.setattr(module, "tell", lambda **said: told.extend(said))
    propose.propose(planar_arm(2), SeedOptions(q=tuple(SEED)))
    assert told[0] == "hindrance"
    assert "faces" in told


def test_telling_without_a_listener_is_nothing() -> None:
    telling.tell(faces=np.int64(3).item())
