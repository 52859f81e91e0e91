"""Every error that can reach a user stands in one table: what is wrong, where, and what to do. All that is cheap to provoke is provoked."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from certifier.errors import CirisError
from client.verify import REFUSED
from tests.errors.bundles import BUNDLES
from tests.errors.commands import COMMANDS
from tests.errors.covers import COVERS
from tests.errors.drawing import DRAWING
from tests.errors.models import FORMATS
from tests.errors.motions import MOTIONS
from tests.errors.proofs import PROOFS
from tests.errors.python import PYTHON
from tests.errors.regions import REGIONS
from tests.errors.rows import Row, Trial, pattern
from tests.errors.scene_files import SCENE_FILES
from tests.errors.scenes import SCENES
from tests.errors.service import SERVICE
from tests.errors.sites import Site, sites
from tests.errors.teams import TEAMS
from tests.errors.workers import WORKERS

TABLE = [
    *SCENE_FILES,
    *SCENES,
    *FORMATS,
    *BUNDLES,
    *REGIONS,
    *MOTIONS,
    *COVERS,
    *DRAWING,
    *SERVICE,
    *COMMANDS,
    *PYTHON,
    *PROOFS,
    *TEAMS,
    *WORKERS,
]

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


def outcome(row: Row, trial: Trial) -> object:
    """Returns the error that a row's provocation raises, or what its command says."""
    assert callable(row.provoke)
    try:
        return row.provoke(trial)
    except CirisError as error:
        return error


@pytest.mark.parametrize("row", [row for row in TABLE if callable(row.provoke)], ids=str)
def test_an_error_says_what_where_and_what_to_do(row: Row, trial: Trial) -> None:
    said = outcome(row, trial)
    assert isinstance(said, CirisError | str), "nothing was refused"
    assert row.fits(said) if isinstance(said, CirisError) else row.fits_line(said), said
    assert not INSIDE.search(str(said).replace(str(trial.directory), ""))
    assert "\n" not in str(said)


@pytest.mark.parametrize("row", TABLE, ids=str)
def test_a_row_has_a_place_and_something_to_do(row: Row) -> None:
    assert row.where or "{" in row.message or row.module in ABOUT_ALL, "name the field or the thing"
    assert row.hint or DEMANDS.search(row.message), "say what to do"


def of(site: Site, row: Row) -> bool:
    """Says whether a row is about a site."""
    known = [(site.code, row.code), (site.where, row.where), (site.hint, row.hint)]
    if row in PROOFS:
        del known[1:]
    told = all(part is None or re.fullmatch(pattern(part), said) for part, said in known)
    return (site.module, site.message) == (row.module, row.message) and told


def test_the_table_has_every_error_of_the_source() -> None:
    missing = [site for site in sites() if not any(of(site, row) for row in TABLE)]
    assert not missing, f"add a row for each of these to the tables of {Path(__file__).parent.name}/"


def test_the_source_has_every_error_of_the_table() -> None:
    found = sites()
    assert not [str(row) for row in TABLE if not any(of(site, row) for site in found)]


def test_a_proof_that_does_not_hold_has_a_place_and_something_to_do(trial: Trial) -> None:
    path = trial.write(broken__proof=b"no proof")
    assert re.fullmatch(rf"{re.escape(str(path))}: the proof does not hold: .+ \({re.escape(REFUSED)}\)", trial.ciris("verify", path))
