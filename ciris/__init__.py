"""Certified collision-free regions of robot configuration space, from Python: docs/python.md.

import ciris

service = ciris.connect()
region = service.grow("my-cell", q=[0, 0.3, 0, -1.8, 0, 0.9, 0], deadline=60)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ciris.public import *  # noqa: F403 - one list says what is public


def __getattr__(name: str) -> Any:
    """Loads everything at the first name that is asked for. The command asks for none, and so starts in half the time."""
    return getattr(import_module("ciris.public"), name)


def __dir__() -> list[str]:
    return list(import_module("ciris.public").__all__)
