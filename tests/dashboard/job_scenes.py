"""Jobs that are made by hand in the database, for the page of a job: a pair with cells, and a job with many pairs."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from sqlalchemy import insert

from certifier.model import Scene
from certifier.outcome import Outcome, Stage
from certifier.pair.result import PairResult
from certifier.proof.outline import Outline, Silhouette, Tree
from certifier.proof.partition import EMPTY, OPEN, PLANE
from db import jobs, pairs, scenes
from db.models import IterationRow, PairRow
from db.session import Database
from db.states import IterationState, PairState
from tests.db.builders import add_iteration

SLIDE: dict[str, Any] = {"C": [[1.0], [-1.0]], "d": [0.5, 0.5], "center": [0.0]}


def new_job(database: Database, scene: Scene) -> str:
    with database.write() as session:
        row = scenes.add(session, scene)
        job, _ = jobs.create(session, kind="grow", scene_id=row.id, options={"seed": {"q": [0.0]}, "random_seed": 0})
        jobs.start(session, job)
        return job.id


def begin(database: Database, scene: Scene, job_id: str, *, cells: int = 1) -> None:
    new = [pairs.NewPair(index, pair.a, pair.b, 1.0) for index, pair in enumerate(scene.pairs)]
    with database.write() as session:
        job = jobs.lock(session, job_id)
        add_iteration(session, job, index=0, label="proposal", **SLIDE, pairs=new, reuse={}, hard=[], failures=None, cells=cells)


def settle(database: Database, job_id: str, *results: PairResult, batch: float = 100.0) -> None:
    """Claims as many pairs as there are results, and saves them."""
    with database.write() as session:
        claim = pairs.claim(session, jobs.lock(session, job_id), lease_seconds=60, batch_seconds=batch)
        assert claim is not None
        pairs.save(session, claim, {(pair.index, 0): result for pair, result in zip(claim.pairs, results, strict=True)})


def certified() -> PairResult:
    return PairResult(Outcome.CERTIFIED, Stage.SOS, seconds=0.1, margin=0.01, proof=b"proof")


def too_close(scene: Scene, leaves: int) -> PairResult:
    """A pair that is not certified, with this many cells and the configuration at which it is nearest."""
    return replace(left_open(scene, leaves), outcome=Outcome.TOO_CLOSE, detail="0.001 m apart", witness_s=np.array([0.4]))


def left_open(scene: Scene, leaves: int) -> PairResult:
    """A pair that is not certified, with this many cells. No configuration of them is known."""
    tree = cut_up(leaves)
    found: dict[str, Any] = {"open_cells": tree.open, "subtrees": b"", "outline": outline(scene, 0, tree).to_bytes()}
    return PairResult(Outcome.INCONCLUSIVE, None, seconds=2.0, **found)


def cut_up(leaves: int) -> Tree:
    """So many cells along the first joint between -0.6 and 0.6; the last one is open, and the first misses the polytope."""
    nodes: list[int] = []
    cuts: list[float] = []

    def add(lower: float, upper: float, below: int) -> None:
        if below == 1:
            nodes.append(OPEN if upper == 0.6 else EMPTY if lower == -0.6 else PLANE)
            return
        nodes.append(0)
        cuts.append(lower + (upper - lower) * 0.45)
        middle = cuts[-1]
        add(lower, middle, below // 2)
        add(middle, upper, below - below // 2)

    add(-0.6, 0.6, leaves)
    choices = np.arange(nodes.count(PLANE)) % 2 * 3
    return Tree(np.array(nodes, dtype=np.int8), np.array(cuts), choices.astype(np.int8))


def outline(scene: Scene, index: int, tree: Tree) -> Outline:
    bodies = {geometry.name: geometry.body for geometry in scene.geometries}
    sides = [
        (Silhouette((name,), bodies[name], 1, 0.1, own=True), Silhouette((name,), bodies[name], 1, 0.2, own=False))
        for name in (scene.pairs[index].a, scene.pairs[index].b)
    ]
    return Outline((0,), np.array([-0.6]), np.array([0.6]), (sides[0], sides[1]), tree)


def large_job(database: Database, scene: Scene, iterations: int, leaves: int) -> str:
    """A running job whose last iteration has open pairs; the first pair of all has this many ``leaves`` there."""
    job_id = new_job(database, scene)
    states = [PairState.CERTIFIED] * 17 + [PairState.TOO_CLOSE, PairState.INCONCLUSIVE, PairState.REFUTED]
    with database.write() as session:
        for index in range(iterations):
            job = jobs.lock(session, job_id)
            add_iteration(session, job, index=index, label=f"stage {index}", **SLIDE, pairs=[], cells=64)
            session.get_one(IterationRow, (job_id, index)).state = IterationState.FAILED
            done = [
                {
                    "job_id": job_id, "iteration": index, "pair_index": i, "part": 0, "a": pair.a, "b": pair.b, "forecast_seconds": 1.0,
                    "state": states[(i * 7 + index) % len(states)], "seconds": (i % 97) / 10, "margin": 0.001, "stage": Stage.SOS,
                }
                for i, pair in enumerate(scene.pairs)
            ]  # fmt: skip
            session.execute(insert(PairRow), done)
    new = [pairs.NewPair(index, pair.a, pair.b, 1.0) for index, pair in enumerate(scene.pairs)]
    with database.write() as session:
        job = jobs.lock(session, job_id)
        add_iteration(session, job, index=iterations, label="last", **SLIDE, pairs=new, reuse={}, hard=[], failures=None, cells=64)
    settle(database, job_id, left_open(scene, leaves), batch=0)
    return job_id
