"""``ciris cover`` as people type it."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest

from certifier.model import Scene
from client.follow import Teller
from client.output import Screen
from db import jobs, scenes
from db.session import Database
from planner.cover.options import CoverOptions
from tests.client.conftest import Ciris

COVERAGE = {"value": 0.5, "stderr": 0.01, "samples": 100}


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (["--connect", "0"], "--connect: at least two configurations can be connected, and one was given"),
        (["--connect", "0", "--connect", "-0.2,1"], "--connect[1]: 2 numbers were given; the scene has 1 joint"),
        (["--seed", "5"], "--seed[0][0]: joint model/slide is at 5 m, not between its limits -1 and 1 m"),
    ],
)
def test_what_makes_no_sense_is_bad_input(ciris: Ciris, url: str, scene: Scene, arguments: list[str], error: str) -> None:
    done = ciris("cover", "slider", *arguments, CIRIS_URL=url)
    assert done.status == 2
    assert done.error.startswith(error)


def cancelling(database: Database) -> threading.Thread:
    """Returns a thread that runs until there is a job, and cancels it."""

    def end() -> None:
        made: list[str] = []
        while not made:
            time.sleep(0.1)
            with database.write() as session:
                made = [jobs.cancel(session, job.id).id for job in jobs.page(session).rows]

    ending = threading.Thread(target=end, daemon=True)
    ending.start()
    return ending


def test_what_will_probably_end_a_job_is_printed(ciris: Ciris, url: str, database: Database, planar: Scene) -> None:
    with database.write() as session:
        scene = scenes.add(session, planar).id
    ending = cancelling(database)
    done = ciris("grow", scene, "--q", "0,0", "--contain", "0.75,1.5", CIRIS_URL=url)
    ending.join()
    assert "warning: a region cannot hold the straight line in s from seed.q to seed.contain[0]" in done.stderr


def test_its_options_become_those_of_the_job(ciris: Ciris, url: str, scene: Scene, database: Database, tmp_path: Path) -> None:
    """Nobody works on the job, so it is cancelled by the time the command looks at it."""
    (tmp_path / "path.csv").write_text("0\n0.1\n")
    given = ["--connect", "0", "--connect", "-0.2", "--seed", "-0.1", "--path", str(tmp_path / "path.csv"), "--coverage", "0.8"]

    ending = cancelling(database)
    done = ciris("cover", "slider", *given, "--connected", "--at-once", "3", "--stages", "2", CIRIS_URL=url)
    ending.join()
    assert done.status == 2
    assert done.stderr.splitlines()[-1].startswith("error: cancelled before it started")
    with database.read() as session:
        (job,) = jobs.page(session).rows
    options = CoverOptions.from_document(job.options)
    assert (options.connect, options.seeds, options.paths) == (((0.0,), (-0.2,)), ((-0.1,),), (((0.0,), (0.1,)),))
    assert (options.coverage, options.connected, options.at_once, options.stages) == (0.8, True, 3, 2)


def test_its_events_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    teller = Teller(Screen(), [], watch=False)
    known = {"coverage": COVERAGE, "regions": 3, "components": [2, 1], "growing": ["cover"]}
    child = {"job": "0123456789", "number": 4}
    teller.tell({"kind": "cover", "data": known})
    teller.tell({"kind": "child", "data": child | {"purpose": "join[1]", "state": "queued"}})
    teller.tell({"kind": "child", "data": child | {"state": "succeeded", "region_id": "abcdefghij", "reason": "certified"}})
    teller.tell({"kind": "child", "data": child | {"state": "failed", "region_id": None, "reason": "they touch"}})
    assert capsys.readouterr().err.splitlines() == [
        "region 4 (job 01234567): certified region abcdefgh; before it, 50 +- 1 % covered by 3 regions in 2 components",
        "region 4 (job 01234567): no region: they touch; before it, 50 +- 1 % covered by 3 regions in 2 components",
    ]
