"""How the map of a scene grows in the service. One process leads a job round by round, and all free ones work on the pieces of a round.

The rounds are the same, whichever process leads, and whatever the others do (certifier.map.growing). What a round has found is kept
before the next one begins. So a process that leads after another one died repeats the rounds with what is kept, and the map is the same.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from functools import lru_cache, partial
from itertools import count
from typing import Any, TypeVar

import numpy as np
from cachetools import LRUCache
from sqlalchemy.orm import Session

from certifier import stored
from certifier.errors import ProofError
from certifier.jobs.map import Worker, grow_round, in_s, states_of, ways_of
from certifier.map.free_set import as_file, free_set
from certifier.map.growing import Growing, Task, Trees
from certifier.map.options import MapOptions
from certifier.map.packed import Entry, pack_entries, pack_tasks, unpack_entries, unpack_tasks
from certifier.map.pair import Found
from certifier.model import Scene
from certifier.proof.map import MapProof
from certifier.proof.sub_scene import contents_of
from certifier.verify.map import verify_map
from ciris.free_set import FreeSet
from db import clock, events, jobs, leases, maps, proofs, steps, workers
from db import work as queue
from db.models import JobRow
from db.session import database
from db.settings import settings
from db.states import LEAD, StepState, WorkerState
from db.transaction import persistently
from jobs.failures import not_begun
from jobs.kind import Done, between_parts
from jobs.scenes import load_scene
from workers.app import send_work

Value = TypeVar("Value")

PIECE_CELLS = 512
"""A piece may look at this many cells, or it is one task."""
NOTE_S = 2.0
"""The job tells this often how far its map is."""
SLICE_S, RESUMED = 10.0, 3.0
"""A process that has led for SLICE_S lets other jobs go first, if they wait; or for RESUMED times as long as it took to have the map in its
memory, if that is longer."""
TURN = 0.4
"""It gives way after this part of the time that workers have for one piece of work, whether others wait or not."""
PATIENCE_S = 10.0
"""After the deadline, pieces that others hold are waited for this long."""
LOOK_S = 0.02
"""How often the process that leads looks whether the others are ready."""
POINTS = 300
"""The curve of the coverage has at most this many points."""


@dataclass(frozen=True)
class Account:
    """How far a map is.

    Attributes:
        coverage, error: the share of the free configurations that it proves, and its standard error.
        cells: how many cells are proved.
        looked: how many were looked at.
        given_up: how many tasks were given up because the verifier refused what they found.
        seconds: since the job began.
        curve: (seconds, coverage) while it grew.
    """

    coverage: float
    error: float
    cells: int
    looked: int
    given_up: int
    seconds: float
    curve: list[list[float]] = field(default_factory=list)

    def then(self, seconds: float, growing: Growing) -> Account:
        """Returns the account after another round."""
        share, error = growing.coverage
        curve = [*(self.curve if len(self.curve) < POINTS else self.curve[1::2]), [seconds, share]]
        return Account(share, error, growing.planes, growing.looked, growing.refused, seconds, curve)

    @property
    def said(self) -> str:
        """Returns the account in words."""
        return f"{self.cells} cells proved, with about {100 * self.coverage:.1f} % of the free configurations, as samples say"


NOTHING = Account(0.0, 1.0, 0, 0, 0, 0.0)


@dataclass
class _Led:
    """What a process that leads a job knows of its map after some rounds.

    Attributes:
        told: how many of the trees that are taken over were kept with a round.
    """

    growing: Growing
    rounds: int = 0
    told: int = 0

    @property
    def begins(self) -> bool:
        """Says whether the next round only keeps which trees are taken over from a former map."""
        return self.rounds == 0 and len(self.growing.taken_over) > 0

    def taken_over(self) -> list[Entry]:
        """Returns the trees that were taken over since this was asked last, without any work on them."""
        new, self.told = self.growing.taken_over[self.told :], len(self.growing.taken_over)
        none = np.zeros(0, np.int64)
        return [Entry(pairs, none, Found.of_none(self.growing.trees[pairs].pair.scene.n)) for pairs in new]


_led: LRUCache[str, _Led] = LRUCache(2)
"""A process keeps the maps that it led last, because it may lead them again."""


def lead(claim: steps.Claim, scene: Scene) -> Done:
    """Grows the map of a job, and reports why it ended; None where others go first."""
    begun = time.monotonic()
    options, now, job = _asked(claim.job_id)
    late = None if job.deadline_at is None else begun + (job.deadline_at - now).total_seconds()
    before = (now - (job.started_at or now)).total_seconds()
    leading, account = _Leading(claim, scene, late), _account_of(claim.job_id)
    try:
        leading.saving(lambda session, job: maps.forget(session, job.id))  # what a process that died has posted is posted anew
        if (reason := leading.over()) is not None:
            if account is NOTHING:
                raise not_begun()
            return Done({"ended": reason, "reached": False})
        led = _resumed(claim.job_id, scene, options)
        if led.begins:
            leading.begin(led)
            account = account.then(before + time.monotonic() - begun, led.growing)
            leading.tell(account)
        slice_s = max(SLICE_S, RESUMED * (time.monotonic() - begun))
        while (reason := grow_round(led.growing, partial(leading.work, led), options.coverage, leading.over)) is None:
            led.rounds += 1
            account = account.then(before + time.monotonic() - begun, led.growing)
            leading.tell(account)
            led_s = time.monotonic() - begun
            if led_s > TURN * settings().time_limit_seconds or (led_s > slice_s and leading.gives_way()):
                _led[claim.job_id] = led
                leading.tell_rest(account)
                return Done({"ended": None})
        leading.tell_rest(account)
        return Done({"ended": reason, "reached": led.growing.coverage.share >= options.coverage})
    except NotLeading:  # the job has ended, or this process was believed dead: nothing that it reports is saved
        return Done({"ended": None})


class _Leading:
    """Has the pieces of a round worked on, by this process and by others.

    Args:
        late: when the deadline is, by the monotonic clock; None where there is none.
    """

    def __init__(self, claim: steps.Claim, scene: Scene, late: float | None) -> None:
        self._claim, self._scene, self._late, self._told = claim, scene, late, 0.0
        self._work: dict[str, float] = {}

    def over(self) -> str | None:
        """Returns why the map is to end now, if it is."""
        return "deadline" if self._late is not None and time.monotonic() > self._late else None

    def begin(self, led: _Led) -> None:
        """Keeps which trees are taken over from a former map."""
        begun = {0: pack_entries(self._scene, led.taken_over())}
        self.saving(lambda session, job: maps.keep(session, job.id, 0, begun))
        led.rounds = 1

    def work(self, led: _Led, tasks: Sequence[Task]) -> Iterator[tuple[Task, Found]]:
        """Works on the tasks of a round, keeps what was found, and yields it in the order of the tasks."""
        pieces, number = _divided(tasks), led.rounds
        more = {len(pieces): pack_entries(self._scene, led.taken_over())} if led.told < len(led.growing.taken_over) else {}
        if len(pieces) == 1:
            found = {0: worked(self._scene, self._claim.scene_id, tasks)}
            self.saving(lambda session, job: maps.keep(session, job.id, number, found | more))
        else:
            files = [pack_tasks(self._scene, piece) for piece in pieces]
            self.saving(lambda session, job: maps.post(session, job, files))
            send_work(min(len(pieces) - 1, settings().solve_processes))
            self._share()
            spent, found = self.saving(lambda session, job: (maps.spent(session, job.id), maps.settle(session, job, number, more)))
            self._work = {process: self._work.get(process, 0.0) + spent.get(process, 0.0) for process in self._work | spent}
        for i, data in found.items():
            for task, entry in zip(pieces[i], unpack_entries(self._scene, data), strict=True):
                yield task, entry.found

    def _share(self) -> None:
        """Works on pieces as long as some are open, and waits for those that others hold."""
        while True:
            if self.over():
                self.saving(lambda session, job: maps.forget(session, job.id, open_only=True))
            if not self._did_one():
                with database().read() as session:
                    left = maps.unsettled(session, self._claim.job_id)
                if not left or (self._late is not None and time.monotonic() > self._late + PATIENCE_S):
                    return
                time.sleep(LOOK_S)

    def _did_one(self) -> bool:
        """Works on an open piece, and says whether there was one."""

        def claimed() -> steps.Claim | None:
            with database().write() as session:
                job = jobs.lock(session, self._claim.job_id)
                return steps.claim(session, job, accepts=False, lease_seconds=settings().lease_seconds, pieces=True)

        claim = persistently(claimed)
        if claim is None:
            return False
        done = piece(claim, self._scene)

        def save() -> None:
            with database().write() as session:
                job = jobs.lock(session, claim.job_id)
                if steps.save(session, claim, StepState.DONE, done.report, 0.0):  # the time is part of that of leading
                    done.save(session, job)

        persistently(save)
        return True

    def saving(self, change: Callable[[Any, JobRow], Any]) -> Any:
        """Changes rows of the job, as long as this process leads it."""

        def save() -> Any:
            with database().write() as session:
                job = jobs.lock(session, self._claim.job_id)
                if not maps.leads(session, self._claim.token):
                    raise NotLeading
                return change(session, job)

        return persistently(save)

    def tell(self, account: Account) -> None:
        """Keeps the account of the map, and says in the job's events how far it is, now and then."""
        self.saving(lambda session, job: jobs.keep_growth(session, job, stored.document(account)))
        if time.monotonic() > self._told + NOTE_S:
            self._note(account)

    def tell_rest(self, account: Account) -> None:
        """Says what others did since the last note, for this process leads no longer."""
        if self._work:
            self._note(account)

    def _note(self, account: Account) -> None:
        self._told = time.monotonic()
        work, self._work = self._work, {}
        note = {"text": account.said, "part": account.coverage, "cells": account.looked, "work": work}
        self.saving(lambda session, job: events.emit(session, job, events.NOTE, note))

    def gives_way(self) -> bool:
        """Says whether other jobs wait for a process, or this one is to end or to pause."""
        with database().read() as session:
            if workers.wanted(session, leases.parent_worker()) not in (None, WorkerState.RUNNING):
                return True
            return queue.next_job(session) not in (None, self._claim.job_id)


class NotLeading(RuntimeError):
    """Another process leads the job by now."""


def piece(claim: steps.Claim, scene: Scene) -> Done:
    """Works on a claimed piece of a round."""

    tasks = unpack_tasks(scene, _read(lambda session: maps.given(session, claim.step_id)))
    found = worked(scene, claim.scene_id, tasks)
    return Done({}, lambda session, _: maps.put(session, claim.step_id, found))


def worked(scene: Scene, scene_id: str, tasks: Sequence[Task]) -> bytes:
    """Works on tasks, and returns what was found as bytes."""
    work = _worker(scene_id)
    return pack_entries(scene, [Entry(task.pairs, task.nodes, work(task)) for task in tasks])


def accept(claim: steps.Claim, scene: Scene) -> Done:
    """Puts the map of a job together from all that was found, verifies the proof, and stores it with its free set.

    Raises:
        ProofError: the proof does not hold, and nothing is stored.
    """
    options, _, _ = _asked(claim.job_id)
    trees = Trees(scene, _former_of(claim.job_id))
    for number in count():
        found = _of_round(claim.job_id, number)
        if not found:
            break
        for data in found.values():
            for entry in unpack_entries(scene, data):
                trees.tree(entry.pairs).take(entry.nodes, entry.found)
    proof, cells = trees.proof().to_bytes(), _cells_of(trees)
    statement, file = verify_map(proof, progress=between_parts), _free_set_of(proof)
    states = states_of(trees, in_s(scene, options.at))
    report = {
        "cells": statement.cells,
        "uncovered_pairs": statement.missing,
        "at": [{"q": list(q), "state": state} for q, state in zip(options.at, states, strict=True)],
        "paths": [0.0 if file is None else FreeSet.of_bytes(file, "the free set").share_of(path) for path in options.paths],
        "proof": proofs.digest(proof),
        "proof_bytes": len(proof),
        "free_set": file is not None,
    }

    def save(session: Any, _: JobRow) -> None:
        steps.keep_proof(session, claim, proof)
        maps.keep_contents(session, claim.job_id, cells)
        if file is not None:
            maps.put(session, claim.step_id, file)

    return Done(report, save)


def _cells_of(trees: Trees) -> Counter[str]:
    """Returns how many cells of a map have a plane, by what their pairs are about."""
    contents, cells = contents_of(trees.scene), Counter[str]()
    for pairs, tree in trees.trees.items():
        for pair in pairs:
            cells[contents[pair]] += tree.descent.held
    return +cells


def _free_set_of(proof: bytes) -> bytes | None:
    """Returns the free set of a verified map as a file; None where no configuration is proved to be free."""
    try:
        return as_file(free_set(MapProof.from_bytes(proof)))
    except ProofError:
        return None


def _divided(tasks: Sequence[Task]) -> list[list[Task]]:
    """Returns the tasks as pieces of work, each of a few tasks in a row."""
    pieces: list[list[Task]] = []
    cells = 0
    for task in tasks:
        if not pieces or cells + task.most > PIECE_CELLS:
            pieces.append([])
            cells = 0
        pieces[-1].append(task)
        cells += task.most
    return pieces


def _resumed(job_id: str, scene: Scene, options: MapOptions) -> _Led:
    """Returns the map after all rounds whose results are kept."""
    led = _led.pop(job_id, None)
    if led is None:
        led = _Led(Growing(scene, in_s(scene, options.at), options.random_seed, _former_of(job_id), ways_of(scene, options.paths)))
    while found := _of_round(job_id, led.rounds):
        pieces = [] if led.begins else _divided(led.growing.round())
        for i, data in found.items():
            for task, entry in zip(pieces[i], unpack_entries(scene, data), strict=True) if i < len(pieces) else ():
                led.growing.take(task, entry.found)
        led.rounds += 1
        led.taken_over()
    return led


def _of_round(job_id: str, number: int) -> dict[int, bytes]:
    return _read(lambda session: maps.of_round(session, job_id, number))


def _asked(job_id: str) -> tuple[MapOptions, datetime, JobRow]:
    """Returns the options of a job, the time by the database's clock, and the job's row."""
    now, job = _read(lambda session: (clock.now(session), jobs.get(session, job_id)))
    options = {name: value for name, value in job.options.items() if name != "former"}
    return stored.value(MapOptions, options), now, job


def _former_of(job_id: str) -> MapProof | None:
    """Returns the map that a job takes over; None where it takes over none."""
    former = _read(lambda session: maps.taken_over(session, job_id, LEAD))
    return None if former is None else MapProof.from_bytes(former)


def _account_of(job_id: str) -> Account:
    known = _read(lambda session: jobs.growth(session, job_id))
    return NOTHING if known is None else stored.value(Account, known)


def _read(look: Callable[[Session], Value]) -> Value:
    """Returns what is found in the database, which may be away for a while."""

    def read() -> Value:
        with database().read() as session:
            return look(session)

    return persistently(read)


@lru_cache(maxsize=2)
def _worker(scene_id: str) -> Worker:
    """Returns what works on tasks of a scene. It keeps the trees' volumes."""
    return Worker(load_scene(scene_id), {})
