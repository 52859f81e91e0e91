"""Rows to start from."""

from __future__ import annotations

from sqlalchemy.orm import Session

from certifier.outcome import Outcome, Stage
from certifier.pair.result import PairResult
from db import jobs, pairs, scenes
from db.models import JobRow, SceneRow
from tests.scenes import slider


def a_scene(session: Session, name: str = "slider", posts: int = 2) -> SceneRow:
    return scenes.add(session, slider(name, posts))


def a_job(session: Session, **values: object) -> JobRow:
    job, _ = jobs.create(session, kind="grow", scene_id=a_scene(session).id, options={"random_seed": 0}, **values)  # type: ignore[arg-type]
    return job


def a_running_job(session: Session, pair_count: int = 4, *, failures: int | None = 1) -> JobRow:
    """A running job whose iteration 0 has ``pair_count`` open pairs of 1 s each."""
    job = a_job(session)
    jobs.start(session, job)
    add_pairs(session, job, pair_count, failures=failures)
    return job


def add_pairs(session: Session, job: JobRow, pair_count: int, *, failures: int | None = 1) -> None:
    """Iteration 0 with so many open pairs of 1 s each."""
    pairs.add_iteration(
        session,
        job,
        index=0,
        label="contract",
        C=[[1.0], [-1.0]],
        d=[1.0, 1.0],
        center=[0.0],
        pairs=[pairs.NewPair(i, f"a{i}", f"b{i}", 1.0) for i in range(pair_count)],
        reuse={},
        hard=[],
        failures=failures,
    )


def certified(index: int, proof: bytes = b"proof") -> dict[tuple[int, int], PairResult]:
    return {(index, 0): PairResult(Outcome.CERTIFIED, Stage.SOS, seconds=0.1, margin=0.01, proof=proof)}
