"""The transition tables, and that a row can only take the paths in them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st
from sqlalchemy.orm import Session

from db import version
from db.models import DEFAULT_PROJECT, Base, IterationRow, JobRow, PairRow, ProjectRow, StepRow, WebhookRow
from db.session import Database
from db.states import JobState, PairState, StepState, WebhookState, sources, transition, unfinished
from tests.db.builders import a_running_job

MODELS = {JobRow: JobState, PairRow: PairState, StepRow: StepState}


@pytest.fixture(scope="module")
def session() -> Iterator[Session]:
    """One writing transaction on a database in memory."""
    database = Database("sqlite://")
    Base.metadata.create_all(database.writer)
    with database.writer.begin() as connection:
        connection.exec_driver_sql("CREATE TABLE alembic_version (version_num VARCHAR(32) NOT NULL)")
        connection.exec_driver_sql("INSERT INTO alembic_version VALUES (?)", (version.revisions()[-1],))
    with database.write() as session:
        session.add(ProjectRow(name=DEFAULT_PROJECT))
        a_running_job(session, pair_count=1)
        yield session
    database.close()


@examples(max_examples=40)
@given(wanted=st.lists(st.sampled_from(PairState), max_size=12))
def test_a_pair_only_takes_paths_of_its_table(session: Session, wanted: list[PairState]) -> None:
    row = session.query(PairRow).one()
    row.state = PairState.OPEN
    session.flush()
    now = PairState.OPEN
    for target in wanted:
        allowed = target in PairRow.transitions[now]
        assert transition(session, PairRow, target, PairRow.id == row.id) == int(allowed)
        now = target if allowed else now
        session.refresh(row)
        assert row.state == now


@examples(max_examples=40)
@given(wanted=st.lists(st.sampled_from(JobState), max_size=12))
def test_a_job_that_has_ended_never_changes(session: Session, wanted: list[JobState]) -> None:
    row = session.query(JobRow).one()
    row.state = JobState.QUEUED
    session.flush()
    ended: str | None = None
    for target in wanted:
        moved = transition(session, JobRow, target, JobRow.id == row.id)
        session.refresh(row)
        assert not (moved and ended)
        if not JobRow.transitions[row.state]:
            ended = row.state
    assert ended in (None, row.state)


@pytest.mark.parametrize("model", [JobRow, PairRow, StepRow, IterationRow, WebhookRow])
def test_every_state_can_be_reached_and_every_unfinished_one_can_end(model: type[JobRow]) -> None:
    table = model.transitions
    first = next(iter(table))
    reached = {first}
    while more := {target for state in reached for target in table[state]} - reached:
        reached |= more
    assert reached == set(table)
    # People may have a receiver told again, so for webhooks no state is the last one.
    ended = {WebhookState.DELIVERED} if model is WebhookRow else set(table) - unfinished(table)
    assert ended
    ending = set(ended)
    while more := {state for state in table if table[state] & ending} - ending:
        ending |= more
    assert ending == set(table)


def test_sources_are_the_inverse_of_the_table() -> None:
    assert sources(PairRow.transitions, PairState.RUNNING) == {PairState.OPEN}
    assert sources(JobRow.transitions, JobState.CANCELLED) == {JobState.QUEUED, JobState.CANCELLING}
