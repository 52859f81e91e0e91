"""Routes that only read, as clients who wait for something ask for them again and again.

FastAPI runs such a function in one thread, checks in a second one what it returned, and makes the JSON in the event loop, though a
model's own fields were checked when it was made. Here all of it is one visit to one of a few threads.
"""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import wraps
from typing import Any

from fastapi import Response
from fastapi.routing import APIRoute
from pydantic import BaseModel

READERS = 4
"""Threads, each with one of the process' connections to the database while it reads."""
_threads = ThreadPoolExecutor(READERS, "read")


class ReadingRoute(APIRoute):
    """For ``APIRouter(route_class=...)``: a GET whose function returns a model and awaits nothing; other routes stay as they are."""

    def __init__(self, path: str, endpoint: Callable[..., Any], **options: Any) -> None:
        if options.get("methods") == ["GET"] and _returns_model(endpoint):
            endpoint = _in_one_visit(endpoint)
        super().__init__(path, endpoint, **options)


def _returns_model(endpoint: Callable[..., Any]) -> bool:
    returned = inspect.signature(endpoint, eval_str=True).return_annotation
    return not inspect.iscoroutinefunction(endpoint) and inspect.isclass(returned) and issubclass(returned, BaseModel)


def _in_one_visit(endpoint: Callable[..., BaseModel]) -> Callable[..., Any]:
    def answer(arguments: dict[str, Any]) -> Response:
        return Response(endpoint(**arguments).model_dump_json(), media_type="application/json")

    @wraps(endpoint)
    async def visit(**arguments: Any) -> Response:
        return await asyncio.get_running_loop().run_in_executor(_threads, answer, arguments)

    return visit
