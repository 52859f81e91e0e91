"""Clients who wait for something call the routes that only read again and again, so this module makes such routes cheap.

FastAPI runs such a function in one thread, checks its result in a second thread, and makes the JSON in the event loop. The check
is not needed: a model checks its own fields when it is made. Here one of a few threads does all of it in one visit.
"""

from __future__ import annotations

import inspect
import json
import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial, wraps
from typing import Any

from fastapi import Response
from pydantic import BaseModel

from api.strict import StrictRoute
from api.turns import Turns

READERS = 4
"""This many threads answer reading routes. Each takes one of the process' database connections while it reads."""
LONG = 500
"""A list of more models is written item by item."""
TOGETHER, PAUSE_SECONDS = 20, 0.00005
"""While several projects ask, the one whose long list is written gives way for PAUSE_SECONDS after TOGETHER items, which take 0.4 ms."""
_threads = Turns("read", READERS, READERS - 1)


class ReadingRoute(StrictRoute):
    """Use it as ``APIRouter(route_class=...)``. It speeds up every GET whose function is not async and returns a model.

    Other routes stay as they are.
    """

    def __init__(self, path: str, endpoint: Callable[..., Any], **options: Any) -> None:
        if options.get("methods") == ["GET"] and _returns_model(endpoint):
            endpoint = _in_one_visit(endpoint)
        super().__init__(path, endpoint, **options)


def _returns_model(endpoint: Callable[..., Any]) -> bool:
    returned = inspect.signature(endpoint, eval_str=True).return_annotation
    return not inspect.iscoroutinefunction(endpoint) and inspect.isclass(returned) and issubclass(returned, BaseModel)


def _in_one_visit(endpoint: Callable[..., BaseModel]) -> Callable[..., Any]:
    def answer(arguments: dict[str, Any]) -> Response:
        return Response(_written(endpoint(**arguments)), media_type="application/json")

    @wraps(endpoint)
    async def visit(**arguments: Any) -> Response:
        return await _threads.run(getattr(arguments.get("db"), "project", None), partial(answer, arguments))

    return visit


def _written(answer: BaseModel) -> str:
    """Returns the JSON of an answer. It writes long lists item by item: while one call writes them, no other thread goes on.

    A route may give a list as an iterator of models. Then each is made when it is written, and no pass of the garbage collector, during
    which no thread goes on either, looks at thousands of them.
    """
    long = {name: value for name, value in answer if _is_long(value)}
    rest = answer.model_dump_json(exclude=set(long))
    lists = [f"{json.dumps(name)}:[{','.join(_one_by_one(items))}]" for name, items in long.items()]
    return "{" + ",".join(filter(None, (rest[1:-1], *lists))) + "}"


def _is_long(value: Any) -> bool:
    return isinstance(value, Iterator) or (isinstance(value, list) and len(value) > LONG and isinstance(value[0], BaseModel))


def _one_by_one(items: Iterable[BaseModel]) -> Iterator[str]:
    for number, item in enumerate(items, 1):
        if number % TOGETHER == 0 and _threads.shared:
            time.sleep(PAUSE_SECONDS)
        yield item.model_dump_json()
