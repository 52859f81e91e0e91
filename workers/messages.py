"""This module makes a Celery worker reconnect when it could not acknowledge a message."""

from __future__ import annotations

from typing import Any

from celery.worker.request import Request


class Acknowledged(Request):
    """The acknowledgement of this message must arrive. If it does not, the worker opens a new connection to Redis.

    By default Celery only logs the failure, and counts the message as one that is still worked on. One outage of Redis can leave as many
    such messages as there are processes. Then the worker would wait for ever and take no more messages.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **{**options, "connection_errors": ()})
