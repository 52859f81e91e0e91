"""Routes that only read: one visit to one of a few threads, with the documentation that FastAPI would give them."""

from __future__ import annotations

import json
import threading
import time
from concurrent.futures import ThreadPoolExecutor

from fastapi import APIRouter, FastAPI, Response
from fastapi.testclient import TestClient
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel

from api.reading import LONG, READERS, ReadingRoute, _written


class Answer(BaseModel):
    thread: str


class Readers:
    """An application with one route of each kind, and how many read in it at a time."""

    def __init__(self) -> None:
        self.app, router = FastAPI(), APIRouter(route_class=ReadingRoute)
        self.most = self._now = 0
        self._lock = threading.Lock()

        @router.get("/read/{seconds}")
        def read(seconds: float) -> Answer:
            with self._lock:
                self._now += 1
                self.most = max(self.most, self._now)
            time.sleep(seconds)
            with self._lock:
                self._now -= 1
            return Answer(thread=threading.current_thread().name)

        @router.get("/raw")
        def raw() -> Response:
            return Response("raw", media_type="text/plain")

        @router.post("/write", status_code=201)
        def write(response: Response) -> Answer:
            response.headers["Location"] = "/read/0"
            return Answer(thread=threading.current_thread().name)

        self.app.include_router(router)


def test_readers_are_few_however_many_ask() -> None:
    readers = Readers()
    with TestClient(readers.app) as client, ThreadPoolExecutor(3 * READERS) as callers:
        answers = list(callers.map(lambda _: client.get("/read/0.05").json(), range(5 * READERS)))
    assert readers.most == READERS
    assert {answer["thread"].rpartition("_")[0] for answer in answers} == {"read"}


def test_what_a_route_documents_and_how_others_answer_stays_as_it_is() -> None:
    readers = Readers()
    with TestClient(readers.app) as client:
        assert client.get("/read/not-a-number").status_code == 422
        assert client.get("/raw").text == "raw"
        written = client.post("/write")
    assert (written.status_code, written.headers["location"]) == (201, "/read/0")
    assert not written.json()["thread"].startswith("read")
    answer = readers.app.openapi()["paths"]["/read/{seconds}"]["get"]["responses"]["200"]
    assert answer["content"]["application/json"]["schema"] == {"$ref": "#/components/schemas/Answer"}


class Cell(BaseModel):
    name: str
    value: float | None = None


class Page(BaseModel):
    cells: list[Cell]


class Matrix(Page):
    numbers: list[int]
    note: str = "\u00e9\n"


@given(st.integers(LONG - 1, LONG + 2) | st.integers(0, 3), st.sampled_from(["a", '"', "\u20ac"]), st.booleans())
def test_a_long_list_and_an_iterator_are_written_as_pydantic_writes_a_list(length: int, name: str, noted: bool) -> None:
    cells = [Cell(name=name, value=None if i % 3 else i / 7) for i in range(length)]
    for model, others in ((Matrix, {"numbers": list(range(length)), "note": name * noted}), (Page, {})):
        for given_cells in (cells, iter(cells)):
            answer = model.model_construct(cells=given_cells, **others)
            assert json.loads(_written(answer)) == json.loads(model(cells=cells, **others).model_dump_json())
