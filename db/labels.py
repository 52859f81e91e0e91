"""People give jobs labels, and find jobs by them."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from sqlalchemy import ColumnElement, and_, exists, or_, select
from sqlalchemy.orm import Session

from db.models import JobLabelRow, JobRow, SceneNameRow


def put(session: Session, job_id: str, labels: Mapping[str, str]) -> None:
    """Gives a new job its labels."""
    session.add_all(JobLabelRow(job_id=job_id, name=name, value=value) for name, value in labels.items())


def of_jobs(session: Session, job_ids: Collection[str]) -> dict[str, dict[str, str]]:
    """Returns job id -> its labels by name, for those of these jobs that have some."""
    found: dict[str, dict[str, str]] = {}
    for row in session.scalars(select(JobLabelRow).where(JobLabelRow.job_id.in_(job_ids)).order_by(JobLabelRow.name)):
        found.setdefault(row.job_id, {})[row.name] = row.value
    return found


def has(labels: Mapping[str, str]) -> ColumnElement[bool]:
    """Returns the condition that a job has all of these labels."""
    mine = JobLabelRow.job_id == JobRow.id
    return and_(True, *(exists().where(mine, JobLabelRow.name == name, JobLabelRow.value == value) for name, value in labels.items()))


def mentions(text: str) -> ColumnElement[bool]:
    """Returns the condition that a job's id begins with a text, or that the text is in its reason, a label, or a name of its scene."""
    labelled = exists().where(JobLabelRow.job_id == JobRow.id, JobLabelRow.value.icontains(text, autoescape=True))
    named = exists().where(SceneNameRow.scene_id == JobRow.scene_id, SceneNameRow.name.icontains(text, autoescape=True))
    return or_(JobRow.id.startswith(text, autoescape=True), JobRow.reason.icontains(text, autoescape=True), labelled, named)
