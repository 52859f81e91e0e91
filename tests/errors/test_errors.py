"""Every error that can reach a user says what is wrong, where, and what to do.

The rules hold for every place of the source that makes an error (:mod:`tests.errors.sites`), and for the errors that users' acts provoke.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from client.verify import REFUSED
from tests.docs.errors import PAGE, codes, page
from tests.errors.bundles import BUNDLES
from tests.errors.commands import COMMANDS
from tests.errors.covers import COVERS
from tests.errors.elsewhere import PROOF_FILES, TESTED, UNTESTED
from tests.errors.models import MODELS
from tests.errors.motions import MOTIONS
from tests.errors.named import NAMED
from tests.errors.python import PYTHON
from tests.errors.regions import REGIONS
from tests.errors.scene_files import SCENE_FILES
from tests.errors.scenes import SCENES
from tests.errors.service import SERVICE
from tests.errors.sites import HOLE, ROOT, Site, sites
from tests.errors.teams import TEAMS
from tests.errors.trial import Provocation, Trial

TABLES = (SCENE_FILES, SCENES, MODELS, BUNDLES, REGIONS, NAMED, MOTIONS, COVERS, SERVICE, COMMANDS, PYTHON, TEAMS)
PROVOCATIONS = [Provocation(code, field, act) for table in TABLES for (code, field), acts in table.items() for act in acts]
PROVOKED: dict[Provocation, list[Site]] = {}

DEMANDS = re.compile(r"\bmust\b|\bat most\b|\bonly\b")
"""Words of a message that says by itself what has to be."""
INSIDE = re.compile(r"\[Errno|Traceback|numpy|ndarray|\bnp\.|0x[0-9a-f]{6}|\bNone\b|Error:|/ciris-|bazel|condition '")
"""What says something about the program's inside and nothing to users."""
ABOUT_ALL = {
    "api/children.py",
    "api/connections.py",
    "api/guard.py",
    "api/problems.py",
    "api/questions.py",
    "api/room.py",
    "api/streams.py",
    "api/writing.py",
    "certifier/jobs/parallel.py",
    "client/bench.py",
    "client/demo.py",
    "ciris/asynchronous/client.py",
    "ciris/synchronous/client.py",
    "ciris/find.py",
    "ciris/job.py",
    "workers/pairs.py",
    "workers/turns.py",
}
"""Here the service or the program as a whole is meant."""


@pytest.fixture
def trial(tmp_path: Path, request: pytest.FixtureRequest) -> Trial:
    return Trial(tmp_path, request)


def place(site: Site) -> str:
    return f"{site.module}:{site.line}"


def of_proofs(site: Site) -> bool:
    """Says whether `ciris verify` names the file and says what to do, once for all such errors."""
    return site.module.startswith(PROOF_FILES)


def names_a_thing(site: Site) -> bool:
    return HOLE.search(site.message) is not None or site.module in ABOUT_ALL


@pytest.mark.parametrize(
    ("rule", "broken"),
    [
        ("the code is a plain name", lambda site: site.code and not re.fullmatch(r"[a-z][a-z_]+(\{\.\.\.\})?", site.code)),
        ("name the field or the thing", lambda site: site.where == "" and not names_a_thing(site) and not of_proofs(site)),
        ("say what to do", lambda site: site.hint == "" and not DEMANDS.search(site.message) and not of_proofs(site)),
        ("no words of the inside", lambda site: INSIDE.search(f"{site.message} {site.where or ''} {site.hint or ''}")),
    ],
)
def test_every_place_that_makes_an_error_keeps_to_the_rules(rule: str, broken: Callable[[Site], object]) -> None:
    assert not [f"{place(site)}: {site.message}" for site in sites() if broken(site)], rule


def test_the_page_of_codes_is_current() -> None:
    assert PAGE.read_text() == page(), "run python -m tests.docs.errors"


@pytest.mark.parametrize("provocation", PROVOCATIONS, ids=str)
def test_an_error_says_what_where_and_what_to_do(provocation: Provocation, trial: Trial) -> None:
    error, made = trial.refusal(provocation.act)
    assert (error.code, error.field or "") == (provocation.code, provocation.field), error
    assert error.code in codes()
    assert made, f"no place of the source says so: {error}"
    assert error.field or any(names_a_thing(site) for site in made), "name the field or the thing"
    assert error.hint or DEMANDS.search(error.message), "say what to do"
    assert not INSIDE.search(str(error).replace(str(trial.directory), ""))
    assert "\n" not in str(error)
    PROVOKED[provocation] = made


def test_every_place_is_provoked_or_stands_elsewhere() -> None:
    assert set(PROVOKED) == set(PROVOCATIONS), "run the whole file in one process: this test is about what all provocations have found"
    made = {site for found in PROVOKED.values() for site in found}
    rest = {(f"{site.module}:{site.function}", site) for site in sites() if site not in made and not of_proofs(site)}
    named = {*TESTED, *UNTESTED}
    missing = [f"{place(site)}: {site.message}" for function, site in rest if function not in named]
    assert not missing, "provoke these in a table of this directory, or name in elsewhere.py what does"
    assert named == {function for function, _ in rest}, "all errors of a function of elsewhere.py are provoked here"


@pytest.mark.parametrize(("function", "file"), TESTED.items())
def test_the_file_named_is_about_the_error(function: str, file: str) -> None:
    module, _, name = function.partition(":")
    text = (ROOT / file).read_text()
    assert any(site.code is None or site.code in text for site in sites() if (site.module, site.function) == (module, name))


def test_a_proof_that_does_not_hold_has_a_place_and_something_to_do(trial: Trial) -> None:
    path = trial.write(broken__proof=b"no proof")
    said = trial.say("verify", path)
    assert re.fullmatch(rf"error: {re.escape(str(path))}: the proof does not hold: .+ \({re.escape(REFUSED)}\)", said)
