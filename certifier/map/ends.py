"""Why a map ends."""

from __future__ import annotations

from certifier.outcome import DEADLINE

ENDS = {
    "coverage": "the map covers as much as was asked for",
    "deadline": DEADLINE,
    "nothing_left": "nothing is left that a map could prove",
    "size": "the verifier would not read a larger map",
    "interrupted": "it was interrupted",
    "cancelled": "somebody cancelled it",
    "worker_lost": "a process died; look whether the machine ran out of memory: fewer cores need less of it",
}
"""Each reason, in words. A job of the service has the words as its reason."""
