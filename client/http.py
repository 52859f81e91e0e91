"""The service over HTTP. Documents are the API's, as dicts; problems become :class:`certifier.errors.CirisError`."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import httpx2

from certifier.errors import CirisError
from certifier.scene.bundle import pack_bundle

Document = dict[str, Any]

TIMEOUT_S = 120.0
QUIET_S = 60.0
"""A stream that says nothing for this long, not even a ping, is taken up anew."""

PATIENCE = 5
"""How often a request is repeated that the service was asked too often for."""


class _Patient(httpx2.HTTPTransport):
    """Waits as long as the service asks for when it was asked too often, a few times."""

    def handle_request(self, request: httpx2.Request) -> httpx2.Response:
        for _ in range(PATIENCE):
            response = super().handle_request(request)
            wait = response.headers.get("retry-after", "")
            if response.status_code != httpx2.codes.TOO_MANY_REQUESTS or not wait.isdigit():
                return response
            response.close()
            time.sleep(int(wait))
        return super().handle_request(request)


class Client:
    """A connection to the service at ``url``. Every method raises CirisError: what the service said, or ``unreachable``.

    Args:
        key: an API key, for a service that asks for one.
    """

    def __init__(self, url: str, key: str | None = None) -> None:
        self.url = url.rstrip("/")
        headers = {} if key is None else {"Authorization": f"Bearer {key}"}
        transport = _Patient(trust_env=False)
        self._http = httpx2.Client(base_url=self.url, headers=headers, timeout=TIMEOUT_S, trust_env=False, transport=transport)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Closes the connections."""
        self._http.close()

    def ready(self) -> Document:
        """Whether the service can do its work: ``ready`` and ``checks``."""
        return self._send("GET", "/readyz", accepted=(503,)).json()

    def add_scene(self, path: str | Path) -> Document:
        """Uploads a scene file with everything it refers to."""
        return self._json("POST", "/v1/scenes", files={"bundle": ("scene.zip", pack_bundle(path), "application/zip")})

    def scenes(self) -> list[Document]:
        """Every scene, newest first."""
        return self._all("scenes")

    def scene(self, name: str) -> Document:
        """A scene by id or name."""
        return self._json("GET", f"/v1/scenes/{name}")

    def lint(self, name: str) -> Document:
        """A scene's warnings, substitutions and ignored pairs."""
        return self._json("GET", f"/v1/scenes/{name}/lint")

    def scene_pairs(self, name: str) -> list[Document]:
        """A scene's pairs with the forecast of their cost."""
        return self._json("GET", f"/v1/scenes/{name}/pairs")["pairs"]

    def create_job(self, request: Document, idempotency_key: str | None = None) -> tuple[Document, bool]:
        """A job, and whether it is new rather than made earlier under the same key."""
        headers = {} if idempotency_key is None else {"Idempotency-Key": idempotency_key}
        response = self._send("POST", "/v1/jobs", json=request, headers=headers)
        return response.json(), response.status_code == httpx2.codes.CREATED

    def job(self, job_id: str) -> Document:
        """A job as it is now."""
        return self._json("GET", f"/v1/jobs/{job_id}")

    def cancel(self, job_id: str) -> Document:
        """Asks a job to end."""
        return self._json("POST", f"/v1/jobs/{job_id}/cancel")

    def retry(self, job_id: str) -> Document:
        """A new job like one that failed or was cancelled."""
        return self._json("POST", f"/v1/jobs/{job_id}/retry")

    def job_pairs(self, job_id: str, iteration: int | None = None) -> Document:
        """A job's pair matrix, of all iterations or one."""
        return self._json("GET", f"/v1/jobs/{job_id}/pairs", params={} if iteration is None else {"iteration": iteration})

    def events(self, job_id: str, after: int = 0) -> Iterator[Document]:
        """The job's events, in order, until it has ended; an interrupted stream is taken up where it stopped."""
        while True:
            try:
                for event in self._stream(job_id, after):
                    if event is None:
                        return
                    after = event["seq"]
                    yield event
            except (httpx2.ReadTimeout, httpx2.RemoteProtocolError, httpx2.ReadError):
                self.job(job_id)

    def _stream(self, job_id: str, after: int) -> Iterator[Document | None]:
        """Events of one connection; None for the end of the job."""
        url, timeout = f"/v1/jobs/{job_id}/events/stream", httpx2.Timeout(TIMEOUT_S, read=QUIET_S)
        try:
            with self._http.stream("GET", url, headers={"Last-Event-ID": str(after)}, timeout=timeout) as response:
                if response.is_error:
                    response.read()
                    raise _problem(response)
                kind = ""
                for line in response.iter_lines():
                    name, _, value = line.partition(": ")
                    if name == "event":
                        kind = value
                    elif name == "data":
                        yield None if kind == "end" else json.loads(value)
        except httpx2.ConnectError as error:
            raise self._unreachable(error) from None

    def regions(self, *, scene: str | None = None, job: str | None = None) -> list[Document]:
        """Every region, newest first, of one scene or job if asked."""
        return self._all("regions", scene=scene, job=job)

    def region(self, region_id: str) -> Document:
        """A region with its manifest."""
        return self._json("GET", f"/v1/regions/{region_id}")

    def proof(self, region_id: str) -> bytes:
        """A region's proof file."""
        return self._send("GET", f"/v1/regions/{region_id}/proof").content

    def verify(self, region_id: str) -> Document:
        """The service's own check of a region's stored proof: whether it holds, and what it proves."""
        return self._json("POST", f"/v1/regions/{region_id}/verify")

    def pair_proof(self, job_id: str, iteration: int, pair: int) -> bytes:
        """The proof of what became of one pair of a job's iteration, its scene in it."""
        return self._send("GET", f"/v1/jobs/{job_id}/pairs/{pair}/proof", params={"iteration": iteration}).content

    def export(self, region_id: str, format: str) -> bytes:
        """A region as ``json``, ``npz`` or ``drake-yaml``."""
        return self._send("GET", f"/v1/regions/{region_id}/export", params={"format": format}).content

    def contains(self, scene: str, q: list[list[float]]) -> Document:
        """Which regions of a scene hold each of these configurations."""
        return self._json("POST", "/v1/planning/contains", json={"scene": scene, "q": q})

    def _all(self, name: str, **filters: str | None) -> list[Document]:
        """Every page of a list, one after the other."""
        params = {key: value for key, value in filters.items() if value is not None}
        found: list[Document] = []
        while True:
            page = self._json("GET", f"/v1/{name}", params=params)
            found += page[name]
            if page["next"] is None:
                return found
            params["after"] = page["next"]

    def _json(self, method: str, path: str, **options: Any) -> Any:
        return self._send(method, path, **options).json()

    def _send(self, method: str, path: str, accepted: tuple[int, ...] = (), **options: Any) -> httpx2.Response:
        try:
            response = self._http.request(method, path, **options)
        except httpx2.TransportError as error:
            raise self._unreachable(error) from None
        if response.is_error and response.status_code not in accepted:
            raise _problem(response)
        return response

    def _unreachable(self, error: Exception) -> CirisError:
        return CirisError("unreachable", f"the service at {self.url} does not answer: {error}", hint="is `ciris up` running?")


def _problem(response: httpx2.Response) -> CirisError:
    if response.headers.get("content-type", "").startswith("application/problem+json"):
        problem = response.json()
        return CirisError(problem["code"], problem["detail"], field=problem["field"], hint=problem["hint"])
    return CirisError("not_ciris", f"{response.url} answered {response.status_code}; is that the address of a ciris service?")
