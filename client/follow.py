"""This module tells people a job's events as they happen."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from threading import Event, Lock, Thread
from typing import Any

from certifier.conditions import called
from certifier.errors import CirisError
from certifier.outcome import Outcome, Stage
from certifier.words import counted
from ciris.documents import Document
from ciris.synchronous.client import Client
from client.output import Screen, plain, q_volume, seconds, share

_STEPS = {
    "propose": "seeding",
    "step": "polytope step",
    "accept": "assembling and verifying the proof",
    "motion": "certifying the motion",
    "map": "growing the map",
}
SILENT_S, LOOK_S = 4.0, 1.0
"""After this many seconds without an event the command asks what the job waits for, and how often it looks whether it is time to ask."""
WAITING = ("queued", "stalled")
_LOOK = "scout"
"""The step of a cover whose findings are printed instead of it."""


class Teller:
    """A teller turns events into lines and one status line.

    Args:
        pairs: names of the scene's pairs, in the scene's order.
        watch: True prints a line for every pair.
    """

    def __init__(self, screen: Screen, pairs: list[str], watch: bool) -> None:
        self._screen, self._pairs, self._watch = screen, pairs, watch
        self._total = self._done = 0
        self._failure, self._what, self._kept = "", "pairs", ""

    def tell(self, event: Document) -> None:
        """Says what the event means. It ignores kinds that it does not know."""
        teller = getattr(self, f"_tell_{event['kind']}", None)
        if teller is not None:
            teller(event["data"])

    def _tell_job(self, data: dict[str, Any]) -> None:
        self._screen.status(f"job {data['state']}")

    def _tell_step(self, data: dict[str, Any]) -> None:
        if data["kind"] == _LOOK:
            return
        name = _STEPS.get(data["kind"], data["kind"])
        if data.get("seconds") is None:
            self._screen.status(f"{name} ...")
        else:
            self._screen.line(f"{name}: {data['state']} after {seconds(data['seconds'])}")

    def _tell_iteration(self, data: dict[str, Any]) -> None:
        if data["state"] != "running":
            result = f"{plain(data['state'])}, {self._done} of {self._total} {self._what} settled"
            self._screen.line(f"iteration {data['index']} ({data['label']}): {result}{self._failure}")
            return
        self._total, self._done, self._failure = data["parts"], 0, ""
        of = f"{'pieces of work on' if data.get('together') else 'parts of'} {counted(data['pairs'], 'pair')}"
        self._what = "pairs" if data["parts"] == data["pairs"] else of
        self._screen.status(f"iteration {data['index']} ({data['label']}): {self._total} {self._what}{self._kept}", 0.0)

    def _tell_pairs(self, data: dict[str, Any]) -> None:
        for pair in data["pairs"]:
            self._done += 1
            text = f"{self._pairs[pair['index']]}: {plain(pair['state'])}{', carried over' if pair.get('stage') == Stage.CARRIED else ''}"
            if pair["state"] != Outcome.CERTIFIED:
                self._failure = f"; {text}"
            if self._watch:
                self._screen.line(f"  {self._done}/{self._total} {text} ({seconds(pair['seconds'])})")
            state = f"iteration {data['iteration']}: {self._done} of {self._total} {self._what} settled{self._kept}, {text}"
            self._screen.status(state, self._done / self._total)

    def _tell_cover(self, data: dict[str, Any]) -> None:
        grows = ", ".join(data["growing"])
        regions, components = counted(data["regions"], "region"), counted(len(data["components"]), "component")
        state = f"{share(data['coverage'])} covered by {regions} in {components}"
        self._screen.status(f"{state}{f'; growing {grows}' if grows else ''}", data["coverage"]["value"])
        self._kept = state

    def _tell_child(self, data: dict[str, Any]) -> None:
        name = f"region {data['number']} (job {data['job'][:8]})"
        if "purpose" in data:
            self._screen.status(f"{self._kept}; growing {name} for {data['purpose']}")
        else:
            came = f"certified region {data['region_id'][:8]}" if data["region_id"] else f"no region: {data['reason']}"
            self._screen.line(f"{name}: {came}; before it, {self._kept or 'nothing was covered'}")

    def _tell_note(self, data: dict[str, Any]) -> None:
        self._screen.status(data["text"], data["part"])

    def _tell_region(self, data: dict[str, Any]) -> None:
        name = f" {data['region_id'][:8]}" if "region_id" in data else ""
        kept = f"{share(data['share'])} of the proposal, " if data["share"] else ""
        self._screen.line(f"certified region{name} of iteration {data['iteration']}: {kept}{q_volume(data['q_volume'])}")
        if data["share"] and data["share"]["value"] is not None:
            self._kept = f", {100 * data['share']['value']:.0f} % kept so far"


def follow(client: Client, job_id: str, screen: Screen, watch: bool) -> Document:
    """Tells the job's events until the job has ended, and returns the ended job."""
    pairs = [called(pair["a"], pair["b"]) for pair in client.job_pairs(job_id, iteration=0)["pairs"]]
    teller = Teller(screen, pairs, watch)
    with _saying_why_it_waits(client, job_id, screen) as heard:
        for event in client.events(job_id):
            with heard():
                teller.tell(event)
    screen.clear()
    return client.job(job_id)


@contextmanager
def _saying_why_it_waits(client: Client, job_id: str, screen: Screen) -> Iterator[Callable[[], AbstractContextManager[None]]]:
    """Shows in the status line what a job waits for, when nothing has been heard of it for a while.

    Yields what to open while the command shows an event, so that two threads never write at the same time.
    """
    lock, ended, last = Lock(), Event(), time.monotonic()

    @contextmanager
    def heard() -> Iterator[None]:
        nonlocal last
        with lock:
            yield
            last = time.monotonic()

    def look() -> None:
        while not ended.wait(LOOK_S):
            if time.monotonic() - last < SILENT_S:
                continue
            with suppress(CirisError):
                does = client.job(job_id)["status"]
                with lock:
                    if does.startswith(WAITING) and time.monotonic() - last >= SILENT_S and not ended.is_set():
                        screen.status(f"job {does}")

    looking = Thread(target=look, daemon=True)
    looking.start()
    try:
        yield heard
    finally:
        ended.set()
        looking.join(LOOK_S)
