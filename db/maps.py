"""The map of a scene while a job grows it: the pieces of work that a round is divided into, and what all of them have found.

One process leads a job, which its step of the job holds. It posts the pieces of a round as steps, which any process may claim, and keeps
what they found when the round is over. So another process that leads next can repeat all rounds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from sqlalchemy import delete, func, insert, select
from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db import leases, proofs
from db.models import JobRow, MapPairRow, MapPieceRow, StepRow
from db.states import ACCEPT, PIECE, STEP, StepState, unfinished

MOST_CONTENTS = 10_000
"""At most this many pairs are looked for in other maps; a query has no room for many more."""


def post(session: Session, job: JobRow, tasks: Sequence[bytes]) -> None:
    """Adds the pieces of a round. The caller holds the job's lock."""
    rows = [{"job_id": job.id, "turn": job.turn, "kind": PIECE, "number": i, "input": {}, "data": data} for i, data in enumerate(tasks)]
    session.execute(insert(StepRow), rows)


def given(session: Session, step_id: int) -> bytes:
    """Returns the tasks of a piece that somebody holds."""
    data = session.scalar(select(StepRow.data).where(StepRow.id == step_id))
    return data or b""


def put(session: Session, step_id: int, found: bytes) -> None:
    """Keeps what was found for a piece, with its step. The caller holds the job's lock."""
    session.get_one(StepRow, step_id).data = found


def unsettled(session: Session, job_id: str) -> int:
    """Returns how many pieces of the job's round have not ended.

    Raises:
        CirisError: why one of them has failed.
    """
    failed = session.scalar(select(StepRow.report).where(*_pieces(job_id), StepRow.state == StepState.FAILED).limit(1))
    if failed is not None:
        raise CirisError.from_document(failed)
    return session.scalar(select(func.count()).select_from(StepRow).where(*_pieces(job_id), StepRow.state.in_(unfinished(STEP)))) or 0


def forget(session: Session, job_id: str, *, open_only: bool = False) -> None:
    """Deletes the pieces of the job's round. A process that holds one finds out, and ends. The caller holds the job's lock."""
    where = (StepRow.state == StepState.OPEN,) if open_only else ()
    session.execute(delete(StepRow).where(*_pieces(job_id), *where))


def settle(session: Session, job: JobRow, round: int, more: dict[int, bytes]) -> dict[int, bytes]:
    """Keeps what the pieces of a round have found, and returns it by their numbers. The caller holds the job's lock.

    Args:
        more: what else to keep of the round, by numbers that no piece has.
    """
    query = select(StepRow.number, StepRow.data).where(*_pieces(job.id), StepRow.state == StepState.DONE).order_by(StepRow.number)
    found = {number: data or b"" for number, data in session.execute(query)}
    keep(session, job.id, round, found | more)
    forget(session, job.id)
    return found


def keep(session: Session, job_id: str, round: int, found: dict[int, bytes]) -> None:
    """Keeps what was found in a round, by the numbers of the pieces. The caller holds the job's lock."""
    if found:
        rows = [{"job_id": job_id, "round": round, "number": number, "data": data} for number, data in found.items()]
        session.execute(insert(MapPieceRow), rows)


def spent(session: Session, job_id: str) -> dict[str, float]:
    """Returns process -> the seconds that it took for pieces of the job's round; without those that the process that leads did itself."""
    done = (*_pieces(job_id), StepRow.state == StepState.DONE, StepRow.seconds > 0.0)
    rows = session.execute(select(StepRow.worker, func.sum(StepRow.seconds)).where(*done).group_by(StepRow.worker))
    return {process or "": seconds or 0.0 for process, seconds in rows}


def leads(session: Session, token: str) -> bool:
    """Says whether the step with this token, which leads a job, is still held."""
    return session.scalar(select(StepRow.id).where(leases.held(StepRow, token))) is not None


def of_round(session: Session, job_id: str, round: int) -> dict[int, bytes]:
    """Returns what was found in a round, by the numbers of the pieces; nothing for a round that has not been."""
    query = select(MapPieceRow.number, MapPieceRow.data).where(MapPieceRow.job_id == job_id, MapPieceRow.round == round)
    rows = session.execute(query.order_by(MapPieceRow.number)).all()
    return dict(rows)


def keep_done(session: Session, job: JobRow) -> bool:
    """Keeps what the pieces of the round that is under way have found until now, and says whether the job's map has anything.

    The caller holds the job's lock, and nobody leads the job any more.
    """
    last = session.scalar(select(func.max(MapPieceRow.round)).where(MapPieceRow.job_id == job.id))
    found = settle(session, job, 0 if last is None else last + 1, {})
    return last is not None or bool(found)


def accepted(session: Session, job_id: str) -> tuple[dict[str, Any], bytes | None] | None:
    """Returns the report on the map of a job, and its free set as a file; None where there is no map."""
    row = session.execute(select(StepRow.report, StepRow.data).where(StepRow.job_id == job_id, *_STORED)).first()
    return None if row is None else (row[0] or {}, row[1])


def latest(session: Session, scene_id: str) -> str | None:
    """Returns the id of the job that has grown the scene's latest map with a free set; None where there is none."""
    mine = (JobRow.scene_id == scene_id, *_STORED, StepRow.data.is_not(None))
    query = select(JobRow.id).join(StepRow, StepRow.job_id == JobRow.id).where(*mine)
    return session.scalar(query.order_by(StepRow.id.desc()).limit(1))


def keep_contents(session: Session, job_id: str, cells: Mapping[str, int]) -> None:
    """Keeps how many cells the map of a job has with a plane, by what their pairs are about (certifier.proof.sub_scene)."""
    if cells:
        rows = [{"job_id": job_id, "content": content, "cells": number} for content, number in cells.items()]
        session.execute(insert(MapPairRow), rows)


def knows_most(session: Session, project: str, contents: Sequence[str]) -> str | None:
    """Returns the id of the project's job whose map has most cells with a plane of some pairs; None where there is none.

    Args:
        contents: what the pairs are about.
    """
    mine = JobRow.project == project, MapPairRow.content.in_(contents[:MOST_CONTENTS])
    query = select(MapPairRow.job_id).join(JobRow, JobRow.id == MapPairRow.job_id).where(*mine).group_by(MapPairRow.job_id)
    return session.scalar(query.order_by(func.sum(MapPairRow.cells).desc(), MapPairRow.job_id).limit(1))


def to_take_over(session: Session, job_id: str, kind: str, former: str) -> str:
    """Returns the digest of the proof that a job takes over. The steps that lead the job keep it, also where the map's job is deleted.

    Args:
        kind: of these steps.
        former: id of the job that has grown the map.

    Raises:
        CirisError: map_not_found, where it was deleted before the first of these steps.
    """
    for where in (_noted(job_id, kind), (StepRow.job_id == former, *_STORED)):
        digest = session.scalar(select(StepRow.proof_digest).where(*where).limit(1))
        if digest is not None:
            return digest
    raise CirisError("map_not_found", f"the map of the job {former} was deleted", field="former", hint="ask for a map without it")


def taken_over(session: Session, job_id: str, kind: str) -> bytes | None:
    """Returns the proof of the map that a job takes over; None where it takes over none.

    Args:
        kind: of the steps that lead the job.
    """
    digest = session.scalar(select(StepRow.proof_digest).where(*_noted(job_id, kind)).limit(1))
    return None if digest is None else proofs.get(session, digest)


def free_set(session: Session, job_id: str) -> bytes:
    """Returns the free set of a job's map as a file."""
    found = accepted(session, job_id)
    assert found is not None, "the job has a map"
    return found[1] or b""


def end(session: Session, job_id: str) -> None:
    """Deletes what the job does not need after its end. The caller holds its lock."""
    forget(session, job_id)
    session.execute(delete(MapPieceRow).where(MapPieceRow.job_id == job_id))


_STORED = (StepRow.kind == ACCEPT, StepRow.state == StepState.DONE)


def _noted(job_id: str, kind: str) -> tuple[Any, ...]:
    return StepRow.job_id == job_id, StepRow.kind == kind, StepRow.proof_digest.is_not(None)


def _pieces(job_id: str) -> tuple[Any, ...]:
    return StepRow.job_id == job_id, StepRow.kind == PIECE
