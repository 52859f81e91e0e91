"""Before a process of the API takes requests, it opens connections and asks what most requests ask.

SQLAlchemy builds a query when it is first asked, which takes milliseconds, in each thread that asks it meanwhile. PostgreSQL prepares
itself in each connection. If the first requests paid for this, those of many clients who come at once would wait for a second.
"""

from __future__ import annotations

import logging
from contextlib import ExitStack, suppress

from sqlalchemy.exc import SQLAlchemyError
from sqlalchemy.orm import Session

from api.reading import READERS
from certifier.errors import SceneError
from db import activity, events, jobs, keys, labels, pairs, progress, regions, scenes, sessions
from db.models import DEFAULT_PROJECT, JobRow, SceneRow
from db.session import Database
from db.states import JobState, PairState

log = logging.getLogger(__name__)

SECONDS = 5.0
"""The process does not wait longer than this before it takes requests."""
NOBODY = "00000000-0000-0000-0000-000000000000"
"""No row has this id."""


def warm_up(db: Database) -> None:
    """Asks in one connection for each reading thread, and in one more for keys. What is wrong with the database, requests will say."""
    of_project = db.of(DEFAULT_PROJECT)
    try:
        with ExitStack() as held:
            _ask_for_callers(held.enter_context(db.read()))
            for _ in range(READERS):
                _ask_for_jobs(held.enter_context(of_project.read()))
    except (SQLAlchemyError, ValueError) as error:  # ValueError: a row cannot be read
        log.warning("the first requests will take longer, because the database could not be asked beforehand: %s", error)


def _ask_for_callers(session: Session) -> None:
    keys.find(session, {NOBODY})
    sessions.find(session, {NOBODY})
    keys.exist(session)


def _ask_for_jobs(session: Session) -> None:
    """Asks for what is shown of a job that does not exist, and for lists of jobs and regions."""
    seeded, seeding = (
        JobRow(id=NOBODY, state=JobState.RUNNING, turn=0, event_seq=0, open_pairs=number, running_pairs=0, pieces=1) for number in (1, 0)
    )
    session.get(JobRow, NOBODY)
    activity.of_jobs(session, [seeded, seeding])
    progress.of_jobs(session, [seeded])
    progress.in_states(session, [PairState.SKIPPED], [(NOBODY, 0)])
    labels.of_jobs(session, [NOBODY])
    regions.shares(session, [NOBODY])
    events.since(session, NOBODY)
    pairs.iterations(session, NOBODY)
    pairs.page(session, NOBODY, limit=1)
    session.get(SceneRow, NOBODY)
    with suppress(SceneError):
        scenes.find(session, NOBODY)
    jobs.page(session, limit=1)
    regions.page(session, scene_id=NOBODY, limit=1)
