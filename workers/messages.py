"""How a Celery worker treats its messages."""

from __future__ import annotations

from typing import Any

from celery.worker.request import Request


class Acknowledged(Request):
    """A message whose acknowledgement must arrive: when it does not, the connection to Redis is made anew.

    Celery by itself only logs the failure and goes on to count the message as one that is worked on. With as many of those as there
    are processes, which one outage of Redis can make, the worker would wait for ever and take no more.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **{**options, "connection_errors": ()})
