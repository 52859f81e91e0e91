"""A worker touches a file for health checks while its event loop runs and it is connected to Redis."""

from __future__ import annotations

from typing import Any

from celery.bootsteps import StartStopStep

from db.settings import settings

SECONDS = 10.0


class Heartbeat(StartStopStep):
    """This is a step of a Celery worker's start. It starts the heartbeat."""

    requires = ("celery.worker.components:Timer",)

    def start(self, worker: Any) -> None:
        file = settings().heartbeat_file
        if file is not None:
            file.touch()
            worker.timer.call_repeatedly(SECONDS, file.touch)
