"""A kind of job is one object. It says what the job asks for, what happens next in it, how it ends, and what people read of it."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from datetime import datetime
from typing import Any, ClassVar

from sqlalchemy.orm import Session

from certifier.errors import CirisError
from certifier.growth.actions import Finish
from certifier.isolation.child import Tell, prepare, run_in_child
from certifier.model import Scene
from certifier.outcome import DEADLINE, Outcome
from db import steps
from db.models import JobRow
from db.session import Database
from db.settings import settings
from db.states import STEP, StepState, unfinished
from db.transaction import Afterwards
from jobs.request import JobRequest

LOOK_SECONDS, LOADING_SECONDS = 1.0, 60.0
"""A step whose child loads looks every LOOK_SECONDS whether it is to give way, and waits for LOADING_SECONDS at most."""


@dataclass(frozen=True)
class Turn:
    """Holds what a coordinator starts from.

    Attributes:
        number: how many decisions about the job were saved before.
        state: what the kind has kept of the job (:func:`db.jobs.growth`); None before the first decision.
        report: the kind's report on the present action; None before the first decision.
    """

    job_id: str
    traceparent: str | None
    kind: Kind
    number: int
    scene_id: str
    options: dict[str, Any]
    deadline_at: datetime | None
    state: dict[str, Any] | None
    report: Any


@dataclass(frozen=True)
class Done:
    """Says what a step found, and what else to save with it in the same transaction."""

    report: Any
    save: Callable[[Session, JobRow], None] = lambda session, job: None


@dataclass(frozen=True)
class Held:
    """Says in words what holds a job back, or has cut its region.

    Attributes:
        pair: index of the pair that it is about; None where it is about none.
        a, b: the pair's geometries.
        q: a configuration, joint positions, at which it happens; None where none is known.
        faces, lost: how many faces were added for the pair, and which share of the polytope they cut off; None where that is not known.
        at: the words of the text that name ``q``, in degrees and metres; None where the text does not name it.
    """

    text: str
    q: list[float] | None = None
    pair: int | None = None
    a: str | None = None
    b: str | None = None
    faces: int | None = None
    lost: float | None = None
    at: str | None = None


class Kind:
    """A kind of job.

    Attributes:
        name: as requests and rows have it.
        subject: what its jobs make, for people: ``the region``.
        request: the model of a request for such a job.
        template: of dashboard/templates, with the kind's part of the job's page.
        forms: place of options in the request -> their title on the page that starts jobs, and the dataclass that has them; the place ""
            is the request itself.
        makes_jobs: whether its regions are grown by jobs of their own.
        estimates: whether its outcome says that goals were reached which samples measure, so that it is no proof.
    """

    name: ClassVar[str]
    subject: ClassVar[str] = "the region"
    request: ClassVar[type[JobRequest]]
    template: ClassVar[str] = "kinds/region.html"
    forms: ClassVar[dict[str, tuple[str, type]]] = {}
    makes_jobs: ClassVar[bool] = False
    estimates: ClassVar[bool] = False

    def options(self, body: Any, scene: Scene, db: Database) -> dict[str, Any]:
        """Returns the options of a job from its request, after comparing the request with the scene.

        Raises:
            CirisError: what is wrong; the field names the place in the request.
        """
        raise NotImplementedError

    def completed(self, options: dict[str, Any], scene_id: str, scene: Scene, db: Database) -> dict[str, Any]:
        """Returns the options that a new job has, with what it takes from what the service knows at this time."""
        return options

    def warnings(self, options: dict[str, Any], scene: Scene) -> list[str]:
        """Returns sentences about why a job with these options will probably be in vain, as far as that takes milliseconds."""
        return []

    def decide(self, turn: Turn) -> Any:
        """Returns what is next. Nothing here reads or writes anything but the scene.

        Raises:
            CirisError: why the job cannot go on.
        """
        raise NotImplementedError

    def report(self, session: Session, job: JobRow, state: dict[str, Any] | None) -> Any:
        """Returns the report on the job's present action; None while the action is unfinished."""
        raise NotImplementedError

    def save(self, session: Session, job: JobRow, turn: Turn, decision: Any, afterwards: Afterwards) -> bool:
        """Saves a decision, and adds the rows of the work that it asks for. The caller holds the job's lock.

        It returns True when something may have to be decided before any work is done.
        """
        raise NotImplementedError

    def do(self, claim: steps.Claim, scene: Scene) -> Done:
        """Does a claimed step of a job, in a process that may die.

        Raises:
            CirisError: why the step has failed.
        """
        raise NotImplementedError

    def is_late(self, session: Session, job: JobRow, now: datetime) -> bool:
        """Says whether the deadline ends the job now."""
        return job.deadline_at is not None and job.deadline_at <= now

    def late(self, session: Session, job: JobRow) -> Finish:
        """Returns the end of a job that is late."""
        return Finish(Outcome.INCONCLUSIVE, DEADLINE)

    def stop(self, session: Session, job: JobRow, afterwards: Afterwards) -> None:
        """Ends what a job has begun besides its pairs and steps."""

    def waits(self, session: Session, job: JobRow) -> bool:
        """Says whether a job that is to end waits for something that it has begun besides its pairs and steps."""
        return False

    def failure(self, finish: Finish, error: dict[str, Any] | None) -> dict[str, Any] | None:
        """Returns the error of a job that has ended; None where it has succeeded.

        Args:
            error: what went wrong during the job, if something did.
        """
        return error

    def held(self, session: Session, scene: Scene, job: JobRow) -> list[Held]:
        """Returns what holds a job back, worst first."""
        return []

    def result(self, session: Session, job: JobRow) -> dict[str, Any]:
        """Returns what the kind's part of the job's page shows besides the job, its regions and its pairs."""
        return {}


def report_of(session: Session, job: JobRow, kind: str) -> dict[str, Any] | CirisError | None:
    """Returns what the step of this kind of the present turn has found, or why it has failed; None while it has not ended."""
    step = steps.of_turn(session, job, kind)
    if step is None or step.state in unfinished(STEP):
        return None
    found: dict[str, Any] = step.report or {}
    return CirisError.from_document(found) if step.state == StepState.FAILED else found


def in_child(function: str, payload: dict[str, Any], kept: tuple[str, str] | None = None, tell: Tell | None = None) -> dict[str, Any]:
    """Returns what a function finds in a child process. If that aborts, hangs or wants too much memory, only the step fails.

    Args:
        kept, tell: as for certifier.isolation.child.run_in_child.

    Raises:
        CirisError: as :func:`certifier.isolation.child.run_in_child`.
        GivesWay: what :func:`giving_way` was given has raised it.
    """
    look, seconds, memory = _look.get(), settings().time_limit_seconds, settings().child_memory_bytes

    def heard(told: dict[str, Any]) -> None:
        look()
        if tell is not None:
            tell(told)

    module = function.partition(":")[0]
    if module not in _loaded:
        _wait_until_loaded(function, look)
        _loaded.add(module)
    try:
        found: dict[str, Any] = run_in_child(function, payload, timeout_s=seconds, memory_bytes=memory, kept=kept, tell=heard)
    except GivesWay:
        _loaded.discard(module)
        prepare(function)  # the process that computed it has ended; another one loads while other jobs go on
        raise
    return found


_loaded: set[str] = set()
"""The modules that a child of this process has loaded."""
os.register_at_fork(after_in_child=_loaded.clear)


def _wait_until_loaded(function: str, look: Callable[[], None]) -> None:
    """Waits until what computes a function says that it has loaded. Who gives way before leaves it to the next call."""
    until = time.monotonic() + LOADING_SECONDS
    while (began := time.monotonic()) < until:
        prepare(function, LOOK_SECONDS)
        if time.monotonic() - began < LOOK_SECONDS:
            return
        look()


class GivesWay(Exception):
    """A step is given up while its child computes, or while it verifies. It begins anew when it is its job's turn."""


_look: ContextVar[Callable[[], None]] = ContextVar("look", default=lambda: None)


@contextmanager
def giving_way(look: Callable[[], None]) -> Iterator[None]:
    """Calls ``look`` every second that a step waits for a child within the block, and wherever the step calls :func:`between_parts`.

    It raises GivesWay when the step is to be given up.
    """
    token = _look.set(look)
    try:
        yield
    finally:
        _look.reset(token)


def between_parts(done: int, total: int) -> None:
    """Lets a step give way that verifies in this process: it is a ``progress`` of :mod:`certifier.verify`.

    Raises:
        GivesWay: what :func:`giving_way` was given has raised it.
    """
    _look.get()()
