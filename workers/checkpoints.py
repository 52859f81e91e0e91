"""This loop copies SQLite's log into its database, beside the control worker, so that nobody who writes waits for a slow disk.

PostgreSQL's server does the same for itself.
"""

from __future__ import annotations

import logging
import sqlite3
import threading

from db.session import UNAVAILABLE, database
from workers.troubles import Troubles

log = logging.getLogger(__name__)

LOOK_SECONDS = 1.0


def run(stop: threading.Event, troubles: Troubles) -> None:
    """Looks at the log's length until ``stop`` is set. What cannot be copied now (the disk is full) is tried again."""
    while not stop.wait(LOOK_SECONDS):
        with troubles.noting("copying the database's log"):
            try:
                database().checkpoint()
            except (sqlite3.Error, *UNAVAILABLE) as error:
                log.warning("the log of the database could not be copied; it is tried again: %s", error)
