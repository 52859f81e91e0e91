"""This client speaks to the service over HTTP. It returns the API's documents as dicts.

It raises the API's problems as CirisError. The module of this name in ``ciris.synchronous`` is made from this one.
"""

from __future__ import annotations

import asyncio
import json
import os
import time
from collections.abc import AsyncIterator, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import httpx2

from certifier.errors import CirisError
from ciris.documents import Document, bundle, document, given, patience
from ciris.find import api_key
from ciris.problems import address, content, problem, segment, unreachable

Rows = Sequence[list[float] | str]
"""Points, (n,) each, or names of configurations."""
Limit = float | list[float]

TIMEOUT_S = 120.0
QUIET_S = 60.0
"""When a stream says nothing for this many seconds, not even a ping, the client opens it again."""

PATIENCE, LONGEST_WAIT_S = 5, 60
"""Repeats of a request when the service was asked too often, and the longest wait in seconds before each."""
ABSENCE_S, PAUSE_S = 30.0, 0.5
"""While a job is awaited, the service may be silent for this long, as when it starts again; the client asks with these pauses."""


class _Patient(httpx2.AsyncHTTPTransport):
    """Waits as long as the service demands when it was asked too often, then repeats the request, a few times."""

    async def handle_async_request(self, request: httpx2.Request) -> httpx2.Response:
        for _ in range(PATIENCE):
            response = await super().handle_async_request(request)
            wait = response.headers.get("retry-after", "")
            if response.status_code != httpx2.codes.TOO_MANY_REQUESTS or not wait.isdigit() or int(wait) > LONGEST_WAIT_S:
                return response
            await response.aclose()
            await asyncio.sleep(int(wait))
        return await super().handle_async_request(request)


class AsyncClient:
    """A client is a connection to the service at ``url``. Every method may raise CirisError: what the service said, or ``unreachable``.

    It may be used in a process that was forked, which has connections of its own. Pickled, it has no key: where it is loaded,
    :func:`ciris.find.api_key` finds one.

    Args:
        key: an API key, for a service that asks for one.
        timeout: seconds that a question may take.

    Raises:
        CirisError: url, argument.
    """

    def __init__(self, url: str, key: str | None = None, timeout: float = TIMEOUT_S) -> None:
        self.url = address(url)
        self._headers = {} if key is None else {"Authorization": f"Bearer {key}"}
        self._timeout = patience(timeout)
        self._connect()

    def _connect(self) -> None:
        # Every wait for a job has a connection, so there is no limit to their number.
        limits = httpx2.Limits(max_connections=None, max_keepalive_connections=20)
        # Without TLS nobody needs the certificates, which take 20 ms to load.
        transport = _Patient(trust_env=False, limits=limits, verify=httpx2.URL(self.url).scheme != "http")
        self._process = os.getpid()
        self._connections = httpx2.AsyncClient(
            base_url=self.url, headers=self._headers, timeout=self._timeout, trust_env=False, transport=transport
        )

    @property
    def _http(self) -> httpx2.AsyncClient:
        """The connections of this process: on those of its parent it would hear the parent's answers."""
        if self._process != os.getpid():
            self._connect()
        return self._connections

    def __reduce__(self) -> tuple[object, ...]:
        return _again, (type(self), self.url, self._timeout)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None) -> None:
        await self.aclose()

    async def aclose(self) -> None:
        """Closes the connections."""
        await self._http.aclose()

    async def ready(self) -> Document:
        """Returns whether the service can do its work: ``ready`` and ``checks``."""
        response = await self._send("GET", "/readyz", accepted=(503,))
        return content(response)

    async def add_scene(self, path: str | Path) -> Document:
        """Uploads a scene file with everything it refers to, and returns the scene."""
        return await self._json("POST", "/v1/scenes", files={"bundle": ("scene.zip", bundle(path), "application/zip")})

    async def stage_scene(self, name: str, path: str | Path) -> Document:
        """Uploads a scene file as the next version of a name, which ``NAME@staged`` means, and returns the scene."""
        files = {"bundle": ("scene.zip", bundle(path), "application/zip")}
        return await self._json("POST", "/v1/scenes", params={"stage": name}, files=files)

    async def constrain_scene(self, scene: str, conditions: Sequence[Document], name: str) -> Document:
        """Makes another scene out of one, with more conditions, and returns it."""
        return await self._json("POST", f"/v1/scenes/{segment(scene)}/constrain", json={"name": name, "conditions": list(conditions)})

    async def promote_scene(self, name: str, without_regions: bool = False) -> Document:
        """Makes a name mean its staged scene, and returns what it means and what it meant."""
        return await self._json("POST", f"/v1/scenes/{segment(name)}/promote", params={"without_regions": without_regions})

    async def scenes(self) -> list[Document]:
        """Returns every scene, newest first."""
        return await self._all("scenes")

    async def scene(self, name: str) -> Document:
        """Returns a scene by its id or name."""
        return await self._json("GET", f"/v1/scenes/{segment(name)}")

    async def lint(self, name: str) -> Document:
        """Returns a scene's warnings, substitutions and ignored pairs."""
        return await self._json("GET", f"/v1/scenes/{segment(name)}/lint")

    async def scene_pairs(self, name: str) -> list[Document]:
        """Returns a scene's pairs with the forecast of their cost."""
        return (await self._json("GET", f"/v1/scenes/{segment(name)}/pairs"))["pairs"]

    async def create_job(self, request: Document, idempotency_key: str | None = None) -> tuple[Document, bool]:
        """Creates a job. Returns the job and True, or the job made earlier under the same key and False."""
        headers = given(**{"Idempotency-Key": idempotency_key})
        response = await self._send("POST", "/v1/jobs", json=request, headers=headers)
        return content(response), response.status_code == httpx2.codes.CREATED

    async def jobs(
        self,
        *,
        state: str | None = None,
        scene: str | None = None,
        parent: str | None = None,
        labels: Mapping[str, str] | None = None,
        search: str | None = None,
        most: int = 50,
    ) -> list[Document]:
        """Returns the newest jobs, at most ``most``: in one state, of one scene, of one cover, with labels, or that mention a text."""
        label = [f"{name}={value}" for name, value in labels.items()] if labels else None
        wanted = given(state=state, scene=scene, parent=parent, label=label, search=search)
        found: list[Document] = []
        after = None
        while len(found) < most:
            params = {**wanted, "limit": min(most - len(found), 200), **given(after=after)}
            page = await self._json("GET", "/v1/jobs", params=params)
            found += page["jobs"]
            after = page["next"]
            if after is None:
                break
        return found

    async def job(self, job_id: str) -> Document:
        """Returns a job as it is now; the first characters of its id are enough."""
        return await self._json("GET", f"/v1/jobs/{segment(job_id)}")

    async def job_after_all(self, job_id: str) -> Document:
        """Returns a job as it is now, from a service that may be absent for a while.

        Raises:
            CirisError: unreachable, with what to do to wait for the job again.
        """
        until = time.monotonic() + ABSENCE_S
        while True:
            try:
                return await self.job(job_id)
            except CirisError as error:
                if error.code not in ("unreachable", "timeout"):
                    raise
                if time.monotonic() > until:
                    hint = f"wait for it again with job({job_id!r}) of the service, or with `ciris job follow {job_id[:8]}`"
                    raise CirisError(error.code, f"{error.message}; the job {job_id} goes on", hint=hint) from None
            await asyncio.sleep(PAUSE_S)

    async def cancel(self, job_id: str) -> Document:
        """Asks a job to end, and returns it."""
        return await self._json("POST", f"/v1/jobs/{segment(job_id)}/cancel")

    async def create_jobs(self, requests: Sequence[Document]) -> list[Document]:
        """Creates all of these jobs, at most 100, or none, and returns them."""
        return (await self._json("POST", "/v1/jobs/batch", json={"jobs": list(requests)}))["jobs"]

    async def cancel_jobs(self, *, jobs: Sequence[str] | None = None, labels: Mapping[str, str] | None = None) -> list[Document]:
        """Asks several jobs to end, at most 100: those with these ids, or with all of these labels. Returns them."""
        asked = given(jobs=None if jobs is None else list(jobs), labels=None if labels is None else dict(labels))
        return (await self._json("POST", "/v1/jobs/cancel", json=asked))["jobs"]

    async def retry(self, job_id: str) -> Document:
        """Creates a new job like one that failed or was cancelled, and returns it."""
        return await self._json("POST", f"/v1/jobs/{segment(job_id)}/retry")

    async def delete_scene(self, scene_id: str, dependents: bool = False) -> None:
        """Deletes the scene with this id, and with ``dependents`` its jobs and regions."""
        await self._delete(f"scenes/{segment(scene_id)}", dependents)

    async def delete_job(self, job_id: str, dependents: bool = False) -> None:
        """Deletes the job with this id, which has ended, and with ``dependents`` its regions and the jobs of a cover."""
        await self._delete(f"jobs/{segment(job_id)}", dependents)

    async def delete_region(self, region_id: str) -> None:
        """Deletes the region with this id."""
        await self._send("DELETE", f"/v1/regions/{segment(region_id)}")

    async def _delete(self, path: str, dependents: bool) -> None:
        await self._send("DELETE", f"/v1/{path}", params={"dependents": "delete" if dependents else "keep"})

    async def project(self, name: str | None = None) -> Document:
        """Returns a project: how much it stores, how long solvers worked for it this month, and its limits.

        Args:
            name: any project, for admins of the project ``default``; None for that of the key.
        """
        return await self._json("GET", "/v1/project" if name is None else f"/v1/projects/{segment(name)}")

    async def projects(self) -> list[Document]:
        """Returns all projects with their limits, by name, to an admin of the project ``default``."""
        return await self._all("projects")

    async def add_project(self, name: str) -> Document:
        """Makes a project, for an admin of the project ``default``. :meth:`add_key` makes its first key."""
        return await self._json("POST", "/v1/projects", json={"name": name})

    async def set_limits(
        self, project: str, *, max_bytes: float | None = None, keep_days: float | None = None, max_solver_seconds: float | None = None
    ) -> Document:
        """Sets those limits of a project that are not None, for an admin of the project ``default``. 0 takes a limit away."""
        limits = given(max_bytes=max_bytes, keep_days=keep_days, max_solver_seconds=max_solver_seconds)
        return await self._json("PATCH", f"/v1/projects/{segment(project)}", json=limits)

    async def keys(self) -> list[Document]:
        """Returns the keys of the project, newest first, without what is secret."""
        return await self._all("keys")

    async def add_key(self, name: str, scope: str, days: float | None = None, project: str | None = None) -> Document:
        """Makes a key of the project, which expires after this many days, or never. The answer is the only one that shows it.

        Args:
            project: any project, for admins of the project ``default``; None for that of the key.
        """
        asked = {"name": name, "scope": scope, "days": days, **given(project=project)}
        return await self._json("POST", "/v1/keys", json=asked)

    async def revoke_key(self, name: str) -> None:
        """Revokes the project's key of this name."""
        await self._send("DELETE", f"/v1/keys/{segment(name)}")

    async def webhooks(self, state: str | None = None) -> list[Document]:
        """Returns the webhooks of jobs, those of the newest jobs first; only those in one state: waiting, delivered or failed."""
        return await self._all("webhooks", state=state)

    async def webhook(self, job_id: str) -> Document:
        """Returns a job's webhook with the last attempts to call its receiver."""
        return await self._json("GET", f"/v1/jobs/{segment(job_id)}/webhook")

    async def resend_webhook(self, job_id: str) -> Document:
        """Has the receiver of a job's webhook called again."""
        return await self._json("POST", f"/v1/jobs/{segment(job_id)}/webhook/resend")

    async def workers(self) -> list[Document]:
        """Returns the workers that live, with what they do at this moment, those that began last first."""
        return await self._all("workers")

    async def worker(self, worker_id: str) -> Document:
        """Returns the worker with this id, with what it does at this moment."""
        return await self._json("GET", f"/v1/workers/{segment(worker_id)}")

    async def pause_worker(self, worker_id: str) -> Document:
        """Asks a worker to finish what it holds and to take no more until it is resumed. It learns of it within seconds."""
        return await self._json("POST", f"/v1/workers/{segment(worker_id)}/pause")

    async def resume_worker(self, worker_id: str) -> Document:
        """Asks a paused worker to take work again."""
        return await self._json("POST", f"/v1/workers/{segment(worker_id)}/resume")

    async def drain_worker(self, worker_id: str) -> Document:
        """Asks a worker to finish what it holds and then to end. Nothing takes that back."""
        return await self._json("POST", f"/v1/workers/{segment(worker_id)}/drain")

    async def cover(self, job_id: str) -> Document:
        """Returns the results of a cover."""
        return await self._json("GET", f"/v1/jobs/{segment(job_id)}/cover")

    async def map(self, job_id: str) -> Document:
        """Returns how far a map is, and what is stored of it."""
        return await self._json("GET", f"/v1/jobs/{segment(job_id)}/map")

    async def map_proof(self, job_id: str) -> bytes:
        """Returns the proof of the map that a job has grown."""
        return (await self._send("GET", f"/v1/jobs/{segment(job_id)}/map/proof")).content

    async def free_set(self, job_id: str) -> bytes:
        """Returns the free set of the map that a job has grown, as a file."""
        return (await self._send("GET", f"/v1/jobs/{segment(job_id)}/map/free-set")).content

    async def motion(self, job_id: str) -> Document:
        """Returns what has become of the motion that a job has certified."""
        return await self._json("GET", f"/v1/jobs/{segment(job_id)}/motion")

    async def motion_proof(self, job_id: str) -> bytes:
        """Returns the proof of the motion that a job has certified, or of its beginning."""
        return (await self._send("GET", f"/v1/jobs/{segment(job_id)}/motion/proof")).content

    async def obstacles(self, job_id: str) -> list[Document]:
        """Returns what holds the region of a job back, worst first."""
        return (await self._json("GET", f"/v1/jobs/{segment(job_id)}/obstacles"))["obstacles"]

    async def job_pairs(self, job_id: str, iteration: int | None = None) -> Document:
        """Returns a job's pair matrix, of all iterations or of one."""
        path, params = f"/v1/jobs/{segment(job_id)}/pairs", given(iteration=iteration)
        matrix = await self._json("GET", path, params=params)
        while matrix["next"] is not None:
            page = await self._json("GET", path, params={**params, "after": matrix["next"]})
            matrix = {**matrix, "cells": matrix["cells"] + page["cells"], "next": page["next"]}
        return matrix

    async def events(self, job_id: str, after: int = 0) -> AsyncIterator[Document]:
        """Yields the job's events in order until the job has ended. An interrupted stream goes on where it stopped.

        Raises:
            CirisError: unreachable, where the service does not answer for ABSENCE_S.
        """
        while True:
            try:
                async for event in self._stream(job_id, after):
                    if event is None:
                        return
                    after = event["seq"]
                    yield event
            except CirisError as error:
                if error.code not in ("unreachable", "timeout", "busy"):
                    raise
            await asyncio.sleep(PAUSE_S)
            await self.job_after_all(job_id)

    async def _stream(self, job_id: str, after: int) -> AsyncIterator[Document | None]:
        """Yields the events of one connection, and None when the job has ended."""
        url, timeout = f"/v1/jobs/{segment(job_id)}/events/stream", httpx2.Timeout(self._timeout, read=QUIET_S)
        try:
            async with self._http.stream("GET", url, headers={"Last-Event-ID": str(after)}, timeout=timeout) as response:
                if not response.is_success:
                    await response.aread()
                    raise problem(response)
                kind = ""
                async for line in response.aiter_lines():
                    name, _, value = line.partition(": ")
                    if name == "event":
                        kind = value
                    elif name == "data":
                        yield None if kind == "end" else json.loads(value)
        except (httpx2.TransportError, httpx2.DecodingError) as error:
            raise unreachable(self.url, error) from None
        except RuntimeError:
            self._refuse_if_closed()
            raise

    async def regions(self, *, scene: str | None = None, job: str | None = None) -> list[Document]:
        """Returns every region, newest first, or those of one scene or job."""
        return await self._all("regions", scene=scene, job=job)

    async def region(self, region_id: str) -> Document:
        """Returns a region with its manifest."""
        return await self._json("GET", f"/v1/regions/{segment(region_id)}")

    async def proof(self, region_id: str) -> bytes:
        """Returns a region's proof file."""
        return (await self._send("GET", f"/v1/regions/{segment(region_id)}/proof")).content

    async def verify(self, region_id: str) -> Document:
        """Makes the service check a region's stored proof again. Returns whether it holds, and what it proves."""
        return await self._json("POST", f"/v1/regions/{segment(region_id)}/verify")

    async def pair_proof(self, job_id: str, iteration: int, pair: int) -> bytes:
        """Returns the proof of a pair's outcome in one iteration of a job, together with the scene."""
        return (await self._send("GET", f"/v1/jobs/{segment(job_id)}/pairs/{pair}/proof", params={"iteration": iteration})).content

    async def export(self, region_id: str, format: str, name: str | None = None) -> bytes:
        """Returns a region as the bytes of a ``json``, ``npz`` or ``drake-yaml`` file, in which it has this name, or else its id."""
        params = {"format": format, **given(name=name)}
        return (await self._send("GET", f"/v1/regions/{segment(region_id)}/export", params=params)).content

    async def contains(self, scene: str, q: Rows | None = None, s: Rows | None = None) -> Document:
        """Returns which regions of a scene contain each of these points."""
        return await self._json("POST", "/v1/planning/contains", json={"scene": scene, **given(q=q, s=s)})

    async def contacts(self, scene: str, q: Rows) -> Document:
        """Returns which pairs of a scene may touch at each of these joint positions, in floating point: it proves nothing."""
        return await self._json("POST", "/v1/planning/contacts", json={"scene": scene, "q": q})

    async def certify_path(self, request: Document) -> Document:
        """Returns the verdict about a motion, and the proof in base 64 if the request asks for it."""
        return await self._json("POST", "/v1/planning/certify-path", json=request)

    async def nearest(self, scene: str, q: Rows | None = None, s: Rows | None = None) -> Document:
        """Returns the nearest point that a region or the latest map of a scene proves free, for each of these points, and its distance."""
        return await self._json("POST", "/v1/planning/nearest", json={"scene": scene, **given(q=q, s=s)})

    async def segments(self, scene: str, q: list[Rows] | None = None, space: str = "q", s: list[Rows] | None = None) -> Document:
        """Returns for each pair of points whether the motion between them, straight in ``q`` or ``s``, is in certified regions."""
        return await self._json("POST", "/v1/planning/segment", json={"scene": scene, "space": space, **given(q=q, s=s)})

    async def path(self, request: Document) -> Document:
        """Returns whether a path, through waypoints or along a curve, is in certified regions."""
        return await self._json("POST", "/v1/planning/path", json=request)

    async def plan(self, request: Document) -> Document:
        """Returns a motion between configurations that is proved to be free of collision; or why there is none."""
        return await self._json("POST", "/v1/planning/plan", json=request)

    async def graph(self, scene: str) -> Document:
        """Returns which regions of a scene overlap, as far as the service has compared them."""
        return await self._json("GET", "/v1/planning/graph", params={"scene": scene})

    async def _all(self, name: str, **filters: str | None) -> list[Document]:
        """Returns the entries of all pages of a list."""
        params = given(**filters)
        found: list[Document] = []
        while True:
            page = await self._json("GET", f"/v1/{name}", params=params)
            found += page[name]
            if page["next"] is None:
                return found
            params["after"] = page["next"]

    async def _json(self, method: str, path: str, **options: Any) -> Any:
        response = await self._send(method, path, **options)
        return content(response)

    async def _send(self, method: str, path: str, accepted: tuple[int, ...] = (), **options: Any) -> httpx2.Response:
        try:
            if "json" in options:
                options["json"] = document(options["json"])
            response = await self._http.request(method, path, **options)
        except (httpx2.TransportError, httpx2.DecodingError) as error:
            raise unreachable(self.url, error) from None
        except (TypeError, ValueError, httpx2.InvalidURL):
            message = "the request holds something that cannot be sent, such as a number that is not finite or a name of many pages"
            raise CirisError("argument", message, hint="give texts, finite numbers, and lists of them") from None
        except RuntimeError:
            self._refuse_if_closed()
            raise
        if not response.is_success and response.status_code not in accepted:
            raise problem(response)
        return response

    def _refuse_if_closed(self) -> None:
        if self._connections.is_closed:
            raise CirisError("closed", "the connections to the service are closed", hint="connect again") from None


def _again(kind: type[AsyncClient], url: str, timeout: float) -> AsyncClient:
    """Returns the client that was pickled."""
    return kind(url, api_key(), timeout)
