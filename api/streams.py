"""Streams of events stay open for as long as somebody listens. A project has a limited number, and they look at the database by turns."""

from __future__ import annotations

from collections import Counter
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends, Request

from api.access import Reader
from certifier.errors import CirisError

OF_PROJECT = 100
"""One process holds at most this many streams of a project."""
POLL_SECONDS = 0.3
"""A stream looks this often whether there is something new."""
LOOKS_PER_SECOND = 50
"""All streams of a project together look at most this often, each as often as the others."""


@dataclass(frozen=True)
class Listening:
    """One stream among those of its project.

    Args:
        streams: project -> the number of its streams.
    """

    streams: Counter[str]
    project: str

    @property
    def pause(self) -> float:
        """Seconds until the stream looks again."""
        return max(POLL_SECONDS, self.streams[self.project] / LOOKS_PER_SECOND)


async def _listening(request: Request, caller: Reader) -> AsyncIterator[Listening]:
    """Counts a stream from before its answer begins until it has ended.

    Raises:
        CirisError: busy, when the project has as many as it may.
    """
    streams: Counter[str] = request.app.state.streams
    if streams[caller.project] >= OF_PROJECT:
        problem = f"the project {caller.project} listens to {OF_PROJECT} streams of events here already"
        raise CirisError("busy", problem, hint="close some, or ask for the events as a list now and then")
    streams[caller.project] += 1
    try:
        yield Listening(streams, caller.project)
    finally:
        streams[caller.project] -= 1
        if not streams[caller.project]:
            del streams[caller.project]


Stream = Annotated[Listening, Depends(_listening)]
