"""Rows to start from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from sqlalchemy import func, select
from sqlalchemy.orm import Session

from certifier import stored
from certifier.growth.actions import Certify
from certifier.model import Polytope
from certifier.outcome import Outcome, Stage
from certifier.pair.result import PairResult
from db import jobs, pairs, regions, scenes
from db import pairs as rows
from db.models import IterationRow, JobRow, PairRow, RegionRow, SceneRow
from db.pairs import NewPair
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
    """Iteration 0 with this many open pairs of 1 s each."""
    new = [pairs.NewPair(i, f"a{i}", f"b{i}", 1.0) for i in range(pair_count)]
    add_iteration(session, job, index=0, label="contract", C=[[1.0], [-1.0]], d=[1.0, 1.0], center=[0.0], pairs=new, failures=failures)


def add_iteration(
    session: Session, job: JobRow, *, index: int, label: str, C: ArrayLike, d: ArrayLike, pairs: Sequence[NewPair], **asked: Any
) -> None:
    """Adds an iteration with these pairs; ``asked`` are further fields of the action that asks for it."""
    given = {"center": None, "reuse": {}, "hard": [], "failures": None, **asked}
    polytope = Polytope(np.array(C, dtype=float), np.array(d, dtype=float))
    center = None if given["center"] is None else np.array(given["center"], dtype=float)
    action = Certify(index, label, polytope, pairs=list(dict.fromkeys(pair.index for pair in pairs)), **{**given, "center": center})
    rows.add_iteration(session, job, stored.document(action), pairs)


def certified(index: int, proof: bytes = b"proof") -> dict[tuple[int, int], PairResult]:
    return {(index, 0): PairResult(Outcome.CERTIFIED, Stage.SOS, seconds=0.1, margin=0.01, proof=proof)}


def add_region(session: Session, job: JobRow, lower: float = -1.0, upper: float = 1.0, proof: bytes = b"proof") -> RegionRow:
    """Stores lower <= s <= upper as the region of a new iteration of the job."""
    index = session.scalar(select(func.count()).where(IterationRow.job_id == job.id)) or 0
    faces = {"C": np.array([[1.0], [-1.0]]), "d": np.array([upper, -lower])}
    add_iteration(session, job, index=index, label="contract", pairs=[], **faces)
    session.flush()
    manifest = {
        "scene": {"hash": job.scene_id},
        "space": {"s_lower": [-2.0], "s_upper": [2.0]},
        "volume": {"ellipsoid": 0.5},
        "q_volume": {"value": upper - lower, "stderr": 0.0, "unit": "m", "box_side": None},
        "guarantee": "exact",
        "halfspace_normals": faces["C"].tolist(),
        "halfspace_offsets": faces["d"].tolist(),
        "bounding_box": {"lower": [lower], "upper": [upper]},
        "share": None,
    }
    return regions.add(session, job, index, manifest, {name: manifest[name] for name in ("q_volume", "share")}, proof)


def all_pairs(session: Session, job_id: str) -> Sequence[PairRow]:
    """The job's pairs with their parts, in the order of the iterations and of the scene's pairs."""
    order = (PairRow.iteration, PairRow.pair_index, PairRow.part)
    return session.scalars(select(PairRow).where(PairRow.job_id == job_id).order_by(*order)).all()
