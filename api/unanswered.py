"""Each API process notes which configurations it was asked about that nothing proves, so that a map may begin with them.

A question does not wait for that. A thread writes what was noted, a second later and for all questions of that second.
"""

from __future__ import annotations

import logging
import time
from concurrent.futures import ThreadPoolExecutor
from threading import Lock
from typing import Annotated

import numpy as np
from fastapi import Depends, Request

from certifier.errors import CirisError
from certifier.model import Array
from db import questions
from db.session import UNAVAILABLE, Database
from db.settings import settings
from db.types import utcnow

log = logging.getLogger(__name__)
SECONDS = 1.0
"""What was noted is written after this time."""
SCENES = 100
"""Questions about more scenes than this in that time are not noted."""


class Unanswered:
    """Holds what was noted and is not written yet: of each scene, the latest ``CIRIS_KEPT_QUESTIONS`` configurations."""

    def __init__(self) -> None:
        self._noted: dict[str, tuple[Database, Array]] = {}
        self._lock = Lock()
        self._thread = ThreadPoolExecutor(1, "unanswered-questions")

    def note(self, db: Database, scene_id: str, q: Array) -> None:
        """Notes configurations q, (k, n), that nothing proves; none where the service keeps no questions."""
        most = settings().kept_questions
        if not most or not len(q):
            return
        with self._lock:
            first = not self._noted
            before = self._noted[scene_id][1] if scene_id in self._noted else q[:0]
            if scene_id in self._noted or len(self._noted) < SCENES:
                self._noted[scene_id] = db, np.concatenate([before, q])[-most:]
        if first:
            self._thread.submit(self._write)

    def _write(self) -> None:
        time.sleep(SECONDS)
        with self._lock:
            noted, self._noted = self._noted, {}
        for scene_id, (db, q) in noted.items():
            try:
                with db.write() as session:
                    questions.note(session, scene_id, q, settings().kept_questions, utcnow())
            except (CirisError, *UNAVAILABLE) as error:
                log.warning("what was asked about scene %s could not be noted: %s", scene_id, error)
            except Exception:  # those of other scenes are noted all the same
                log.exception("what was asked about scene %s could not be noted", scene_id)


async def _unanswered(request: Request) -> Unanswered:
    kept: Unanswered = request.app.state.unanswered
    return kept


KeptUnanswered = Annotated[Unanswered, Depends(_unanswered)]
