"""A sign of life for health checks: a file that a worker touches for as long as its event loop turns and it is connected to Redis."""

from __future__ import annotations

from typing import Any

from celery.bootsteps import StartStopStep

from db.settings import settings

SECONDS = 10.0


class Heartbeat(StartStopStep):
    """Step of a Celery worker's start."""

    requires = ("celery.worker.components:Timer",)

    def start(self, worker: Any) -> None:
        file = settings().heartbeat_file
        if file is not None:
            file.touch()
            worker.timer.call_repeatedly(SECONDS, file.touch)
