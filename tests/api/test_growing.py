"""The growth of a region as a kind of job, over its rows."""

from __future__ import annotations

import pytest

from certifier import stored
from certifier.growth.machine import begin
from certifier.growth.options import GrowthOptions
from certifier.outcome import Outcome
from db import jobs
from db.models import JobRow
from db.session import Database
from jobs import growing
from tests.db.builders import a_running_job
from tests.scenes import slider


def test_a_late_job_ends_although_another_version_stored_its_state(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growing, "load_scene", lambda _: slider("slider", 2))
    document = stored.document(begin(slider("slider", 2), GrowthOptions(seed={"q": [0.0]})).state)
    with database.write() as session:
        job = a_running_job(session)
        jobs.keep_growth(session, job, {**document, "reach_of_old": 1.0})
        job_id = job.id
    with database.read() as session:
        end = growing.Growing().late(session, session.get_one(JobRow, job_id))
    assert end.outcome is Outcome.INCONCLUSIVE
    assert end.reason.startswith("the deadline was reached")
