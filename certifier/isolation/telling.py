"""A function that runs in a child process tells how far it is. The asking process hears what it has said last."""

from __future__ import annotations

import json
import os
from typing import Any

_to: list[int] = []


def begin(pipe: int) -> None:
    """Writes what :func:`tell` says to a pipe from now on, a line each."""
    _to[:] = [pipe]


def tell(**said: Any) -> None:
    """Tells by names what is JSON-able and short; the last value of each name counts. Where nobody listens, nothing happens."""
    for pipe in _to:
        os.write(pipe, json.dumps(said).encode() + b"\n")
