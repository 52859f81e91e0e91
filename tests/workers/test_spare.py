"""A small job gets a process although all do work that lasts, and the long jobs lose nothing by it."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sqlalchemy import select, update
from sqlalchemy.exc import OperationalError

from certifier.growth.options import GrowthOptions
from certifier.jobs.local import grow
from certifier.map.options import MapOptions
from certifier.model import Scene
from db import jobs, leases, pairs, steps, workers
from db.models import JobRow, StepRow, WorkerRow
from db.session import database
from db.states import WorkerState
from db.workers import Made, WorkerKind
from jobs import kind
from jobs.kind import GivesWay
from tests.scenes import slider
from tests.services import Queue
from tests.workers.options import box_around, grow_box
from tests.workers.record import check_record, region_of
from tests.workers.service import ended, events_of, eventually, job_of, running_service, submit
from workers import spare
from workers.app import SOLVE, waiting
from workers.slots import Slots
from workers.solver import Piece, do, work
from workers.spare import work_for_newcomer
from workers.turns import coordinate

LONG: dict[str, Any] = {"kind": "grow", "seed": {"q": [0.0, 0.0], "tries": 100}, "random_seed": 0, "cells": 200}
"""Many seedings in one step, which takes many times as long as all of a small job."""


SLOT_SECONDS = 2.0
"""The process for new jobs, if it has begun a seeding while another process accepted a region, takes the place of that one within this."""


def seeding(job_id: str) -> StepRow | None:
    with database().read() as session:
        return session.scalar(select(StepRow).where(StepRow.job_id == job_id, StepRow.kind == "propose", StepRow.state == "running"))


def has_region(job_id: str) -> bool:
    return any(event.kind == "region" for event in events_of(job_id))


def lost(job_id: str) -> list[str]:
    return [event.data["reason"] for event in events_of(job_id) if event.kind == "lost"]


@pytest.mark.slow
def test_a_small_job_ends_before_the_seedings_that_have_all_processes(
    planar: Scene, sqlite_url: str, own_queue: Queue, tmp_path: Path
) -> None:
    own_queue.flush()
    with running_service(sqlite_url, own_queue.url, tmp_path):
        assert ended(submit(planar, box_around(np.zeros(2), 0.1))).outcome == "certified"
        first, second = (submit(planar, LONG) for _ in range(2))
        both = "both seed, and nothing else is to be done for them"
        eventually(lambda: all(seeding(job) and has_region(job) for job in (first, second)), both)
        time.sleep(SLOT_SECONDS)
        for kind in ("cancelled", "killed", "given up"):
            third = submit(planar, LONG)
            step = eventually(lambda job=third: seeding(job), "the new job seeds beside them")  # type: ignore[misc]
            if kind == "cancelled":
                with database().write() as session:
                    jobs.cancel(session, third)
                assert ended(third).state == "cancelled"
            elif kind == "killed":
                os.kill(int((step.worker or "").rsplit(":", 2)[1]), signal.SIGKILL)
                eventually(lambda job=third: lost(job) == ["its process died"], "the step is free again")  # type: ignore[misc]
        small = submit(planar, grow_box(planar.to_s([0.0, 0.0]), 0.22, cells=200))
        assert ended(small).outcome == "certified"
        assert seeding(first) is not None
        assert seeding(second) is not None
        assert lost(third) == ["new jobs waited"]
        assert lost(first) == lost(second) == []
        for job in (first, second, third):
            assert ended(job).outcome == "certified"
            check_record(job)
        alone = grow(planar, GrowthOptions.from_document(LONG)).manifest
        for job in (first, second, third):
            found = region_of(job)
            assert all(found[name] == alone[name] for name in ("halfspace_normals", "halfspace_offsets", "inscribed_ellipsoid"))


MANY, AT_ONCE_SECONDS = 100, 3.0
"""A second for the long step that has the process, at most one until it is asked to leave, and the rest for a busy machine."""
SMALL: dict[str, Callable[[np.ndarray], dict[str, Any]]] = {
    "certify": lambda s: box_around(s, 0.1),
    "grow": lambda s: grow_box(s, 0.22, cells=200),
}


@pytest.mark.slow
def test_a_small_job_is_begun_at_once_beside_a_hundred_long_ones(
    planar: Scene, database_url: str, own_queue: Queue, tmp_path: Path
) -> None:
    own_queue.flush()
    with running_service(database_url, own_queue.url, tmp_path):
        assert ended(submit(planar, box_around(np.zeros(2), 0.1))).outcome == "certified"
        long = [submit(planar, LONG) for _ in range(MANY)]
        eventually(lambda: all(job_of(job).state == "running" for job in long), "all have begun", every=1.0)
        eventually(lambda: sum(seeding(job) is not None for job in long) >= 2, "all processes seed", every=1.0)
        waited = []
        for kind in SMALL:
            for _ in range(5):
                small = job_of(submit(planar, SMALL[kind](planar.to_s([0.0, 0.0]))))
                done = ended(small.id)
                assert done.outcome == "certified"
                assert done.claimed_at is not None
                assert done.finished_at is not None
                waited.append((done.claimed_at - done.created_at).total_seconds())
                print(
                    f"{kind}: first piece after {waited[-1]:.1f} s, end after {(done.finished_at - done.created_at).total_seconds():.1f} s"
                )
        assert sum(job_of(job).state == "running" for job in long) > MANY / 2, "the long jobs have ended"
    assert max(waited) < AT_ONCE_SECONDS


@pytest.fixture
def no_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spare, "WAIT_SECONDS", 0.1)
    monkeypatch.setattr(spare, "LOOK_SECONDS", 0.05)


def not_new(job_id: str) -> None:
    with database().write() as session:
        session.execute(update(JobRow).where(JobRow.id == job_id).values(claimed_at=job_of(job_id).created_at.replace(year=2000)))


@pytest.mark.usefixtures("no_wait")
def test_without_a_slot_only_what_new_jobs_wait_for_is_done(job_id: str, own_queue: Queue) -> None:
    own_queue.flush()
    piece = work_for_newcomer(Slots(0))
    assert piece is not None
    assert piece.job_id == job_id
    assert waiting(SOLVE) == 1, "the message is there for others"
    other = submit(slider(posts=3), box_around([0.0], 0.2))
    coordinate(other)
    not_new(other)
    assert work_for_newcomer(Slots(0)) is None, "the job is not new any more"


@pytest.mark.usefixtures("no_wait")
def test_a_step_that_it_gave_up_is_not_begun_again_for_a_region_that_waits(job_id: str, own_queue: Queue) -> None:
    """Or else it is begun and given up all the time, which helps nobody and takes a process from others."""
    own_queue.flush()
    with database().write() as session:
        job = jobs.lock(session, job_id)
        pairs.skip(session, job)
        seeding = steps.add(session, job, "propose", {})
        seeding.attempts = 1
        accepting = steps.add(session, job, "accept", {"iteration": 0})
        seeding_id, accepting_id = seeding.id, accepting.id
    assert work_for_newcomer(Slots(0)) is not None
    with database().read() as session:
        assert session.get_one(StepRow, seeding_id).attempts == 1
        assert session.get_one(StepRow, accepting_id).attempts == 1
    assert work_for_newcomer(Slots(0)) is None


def accepting(job_id: str) -> StepRow | None:
    with database().read() as session:
        return session.scalar(select(StepRow).where(StepRow.job_id == job_id, StepRow.kind == "accept"))


def until_it_accepts(job_id: str) -> None:
    """Takes the job to where all that is left is to verify and store what it has found."""
    while accepting(job_id) is None:
        piece = work()
        assert piece is not None
        coordinate(piece.job_id)


@pytest.mark.usefixtures("no_wait")
def test_without_a_slot_a_region_of_any_job_is_accepted_while_no_new_job_waits(job_id: str, own_queue: Queue) -> None:
    until_it_accepts(job_id)
    not_new(job_id)
    other = submit(slider(posts=3), box_around([0.0], 0.2))
    coordinate(other)
    own_queue.flush()
    new = work_for_newcomer(Slots(0))
    assert new is not None
    assert new.job_id == other
    own_queue.flush()
    assert work_for_newcomer(Slots(0)) == Piece(job_id, True)
    assert waiting(SOLVE) == 1, "the message is there for others"
    coordinate(job_id)
    assert job_of(job_id).region_id is not None
    assert work_for_newcomer(Slots(0)) is None


A_MAP: dict[str, Any] = {**asdict(MapOptions(coverage=0.5)), "former": None}


def comes_meanwhile(new: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The new job is there as soon as the process has claimed something."""

    def do_meanwhile(claim: pairs.Claim | steps.Claim) -> Piece:
        coordinate(new)
        return do(claim)

    monkeypatch.setattr(spare, "do", do_meanwhile)


@pytest.mark.usefixtures("no_wait", "here")
@pytest.mark.parametrize("lasts", [False, True], ids=["short", "long"])
@pytest.mark.parametrize(("of", "options"), [("certify", box_around([0.0], 0.1)), ("map", A_MAP)], ids=["region", "map"])
def test_what_it_accepts_is_left_to_the_others_when_it_lasts_and_a_new_job_waits(
    of: str, options: dict[str, Any], lasts: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(spare, "TRIAL_SECONDS", 0.0 if lasts else 60.0)
    old = submit(slider(posts=3), options, of)
    coordinate(old)
    until_it_accepts(old)
    not_new(old)
    new = submit(slider(posts=3), box_around([0.0], 0.2))
    comes_meanwhile(new, monkeypatch)
    assert work_for_newcomer(Slots(0)) == Piece(old, not lasts)
    step = accepting(old)
    assert step is not None
    assert (step.state, step.attempts, lost(old)) == (("open", 1, ["new jobs waited"]) if lasts else ("done", 1, []))
    assert {piece.job_id for piece in iter(lambda: work_for_newcomer(Slots(0)), None)} == {new}
    assert (work() == Piece(old, True)) == lasts, "the solvers do it"


@pytest.mark.usefixtures("no_wait")
def test_a_region_of_a_new_job_is_accepted_to_the_end(job_id: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is the end of a small job, and all others may do long work."""
    monkeypatch.setattr(spare, "TRIAL_SECONDS", 0.0)
    until_it_accepts(job_id)
    comes_meanwhile(submit(slider(posts=3), box_around([0.0], 0.2)), monkeypatch)
    assert work_for_newcomer(Slots(0)) == Piece(job_id, True)
    step = accepting(job_id)
    assert step is not None
    assert (step.state, lost(job_id)) == ("done", [])


def test_a_look_at_the_database_that_fails_fails_no_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spare, "TRIAL_SECONDS", 0.0)
    monkeypatch.setattr(spare, "LOOK_SECONDS", 0.0)
    takes_work = True
    monkeypatch.setattr(spare, "_takes_work", lambda session: takes_work)
    trial = spare._Trial(Slots(0), "the job", is_new=True)
    monkeypatch.setattr(spare.work, "newcomer", lambda session, instead_of, accepts: "another job")
    with pytest.raises(GivesWay):
        trial()
    takes_work = False  # paused: what it holds, it does to its end
    trial()
    takes_work = True
    for problem in (OperationalError("", None, Exception("the server closed the connection")), ValueError("a fault of ours")):

        def fails(session: object, instead_of: str, accepts: bool, problem: Exception = problem) -> str:
            raise problem

        monkeypatch.setattr(spare.work, "newcomer", fails)
        trial()


@pytest.mark.parametrize("loaded", [False, True])
def test_a_step_gives_way_while_its_child_loads_and_another_one_loads_then(loaded: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    loading = []

    def prepare(function: str, wait_s: float = 0.0) -> None:
        loading.append(wait_s)
        time.sleep(0.0 if loaded else wait_s)

    def computing(function: str, payload: object, *, tell: Callable[[dict[str, Any]], None], **_: object) -> dict[str, Any]:
        tell({})
        return {}

    def newer_job_waits() -> None:
        raise GivesWay

    monkeypatch.setattr(kind, "_loaded", set())
    monkeypatch.setattr(kind, "prepare", prepare)
    monkeypatch.setattr(kind, "run_in_child", computing if loaded else None)
    monkeypatch.setattr(kind, "LOOK_SECONDS", 0.05)
    with kind.giving_way(newer_job_waits), pytest.raises(GivesWay):
        kind.in_child("package.module:name", {})
    assert loading == ([0.05, 0.0] if loaded else [0.05])
    if loaded:
        for _ in range(2):
            kind.in_child("package.module:name", {})
        assert loading == [0.05, 0.0, 0.05], "it says only once that it has loaded"


@pytest.mark.usefixtures("no_wait")
def test_who_gets_a_slot_leaves_the_rest_to_a_message(job_id: str) -> None:
    with Slots(1).one():
        assert work_for_newcomer(Slots(1)) is None
    assert job_of(job_id).claimed_at is None


@pytest.mark.usefixtures("no_wait")
def test_a_worker_that_is_to_pause_begins_nothing_for_new_jobs(job_id: str) -> None:
    made = Made(leases.parent_worker(), WorkerKind.SOLVE, "1", 1, cores=1, memory_bytes=1)
    with database().write() as session:
        workers.tell(session, made, WorkerState.RUNNING)
        session.execute(update(WorkerRow).values(wanted=WorkerState.PAUSED))
    assert work_for_newcomer(Slots(0)) is None
    with database().write() as session:
        session.execute(update(WorkerRow).values(wanted=WorkerState.RUNNING))
    assert work_for_newcomer(Slots(0)) is not None
