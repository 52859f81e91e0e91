"""This module tells receivers that a job has ended, until they answer with success or the last attempt fails.

It signs the messages as Standard Webhooks (standardwebhooks.com) describes, and runs beside the sweeper. A delivery may come twice,
with the same ``webhook-id``. It goes only to public addresses, on ports 443 and 80, unless the settings list the host. It follows no
redirects.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import json
import logging
import socket
import ssl
import threading
import time
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from http.client import HTTPConnection, HTTPException
from typing import Self
from urllib.parse import SplitResult, urlsplit

from structlog.contextvars import bound_contextvars

from certifier.errors import CirisError
from db import traces, webhooks
from db.models import JobRow
from db.session import database
from db.settings import settings
from db.types import utcnow
from db.vault import vault
from workers.addresses import resolve
from workers.troubles import Troubles

log = logging.getLogger(__name__)

SECONDS = 15.0
"""A receiver that has not answered within this many seconds has failed, even if it is still sending."""


def run(stop: threading.Event, troubles: Troubles) -> None:
    """Delivers until ``stop`` is set. What fails (the database is away) is tried again."""
    sealed = False
    with Couriers() as couriers:
        while not stop.is_set():
            with troubles.noting("telling the receivers of webhooks"):
                if not sealed and vault().usable:
                    with database().write() as session:
                        webhooks.seal_all(session)
                    sealed = True
                couriers.send_due()
            couriers.rest(stop, settings().sweep_seconds)


class Couriers:
    """Couriers make deliveries, each in a thread of its own. A receiver that does not answer keeps one of them, and nobody else."""

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(webhooks.AT_ONCE, thread_name_prefix="webhook")
        self._under_way: dict[Future[None], webhooks.Place] = {}

    def send_due(self) -> None:
        """Begins what is due as far as there is room for it, and waits for no receiver. One that has failed raises its error."""
        for future in [future for future in self._under_way if future.done()]:
            del self._under_way[future]
            future.result()
        with database().write() as session:
            due = webhooks.claim(session, utcnow(), list(self._under_way.values()))
        for delivery in due:
            self._under_way[self._pool.submit(_deliver, delivery)] = delivery.place

    def rest(self, stop: threading.Event, seconds: float) -> None:
        """Waits until one that is under way has ended and left room, but not longer than these seconds."""
        if self._under_way:
            wait(self._under_way, seconds, FIRST_COMPLETED)
        else:
            stop.wait(seconds)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown()
        for future in self._under_way:
            future.result()


def _deliver(delivery: webhooks.Delivery) -> None:
    webhook = delivery.webhook
    at, began = utcnow(), time.monotonic()
    status, answer, error = None, "", ""
    try:
        with traces.span("webhook", delivery.job.traceparent, job=delivery.job.id, webhook=webhook.id, attempt=webhook.attempts):
            status, answer = _post(urlsplit(webhook.url), webhook.id, vault().open(webhook.secret, webhook.url), _body(delivery.job))
        if not 200 <= status < 300:
            error = f"the receiver answered {status}"
    except (CirisError, OSError, HTTPException) as problem:
        error = _said(problem)
        log.info("a receiver could not be called: %s: %s", type(problem).__name__, problem)
    with bound_contextvars(job=delivery.job.id, webhook=webhook.id), database().write() as session:
        if error:
            log.warning("attempt %d to deliver a webhook failed: %s", webhook.attempts, error)
        webhooks.settle(session, webhook.id, webhooks.Answered(at, time.monotonic() - began, status, answer, error))


def _said(problem: Exception) -> str:
    """Returns what people who may see the webhook learn of an error: nothing of names and addresses of the service's own network."""
    match problem:
        case CirisError():
            return problem.message
        case ssl.SSLCertVerificationError():
            return "the receiver's certificate is not valid"
        case ssl.SSLError():
            return "the receiver does not speak TLS as it should"
        case TimeoutError():
            return f"the receiver has not answered within {SECONDS:.0f} s"
        case HTTPException():
            return "the receiver's answer is not HTTP"
        case _:
            return "no connection to the receiver, or it broke off"


def _body(job: JobRow) -> bytes:
    data = {
        "id": job.id,
        "kind": job.kind,
        "scene": job.scene_id,
        "state": job.state,
        "outcome": job.outcome,
        "reason": job.reason,
        "error": job.error,
        "region": job.region_id,
    }
    ended = job.finished_at and job.finished_at.isoformat()
    return json.dumps({"type": "job.ended", "timestamp": ended, "data": data}).encode()


def signature(secret: str, webhook_id: str, timestamp: int, body: bytes) -> str:
    """Returns the value of ``webhook-signature``: HMAC-SHA256 of ``id.timestamp.body``. The key is the bytes that the secret encodes."""
    key = base64.b64decode(secret.removeprefix("whsec_"))
    signed = hmac.new(key, f"{webhook_id}.{timestamp}.".encode() + body, hashlib.sha256)
    return f"v1,{base64.b64encode(signed.digest()).decode()}"


def _post(url: SplitResult, webhook_id: str, secret: str, body: bytes) -> tuple[int, str]:
    """Posts the body, and returns the status of the answer, and how the answer begins."""
    timestamp = int(time.time())
    headers = {
        "Content-Type": "application/json",
        "User-Agent": "ciris",
        "webhook-id": webhook_id,
        "webhook-timestamp": str(timestamp),
        "webhook-signature": signature(secret, webhook_id, timestamp, body),
        **traces.headers(),
    }
    connection = _Pinned(url)
    limit = threading.Timer(SECONDS, connection.abandon)
    limit.start()
    try:
        connection.request("POST", (url.path or "/") + (f"?{url.query}" if url.query else ""), body, headers)
        response = connection.getresponse()
        return response.status, response.read(webhooks.ANSWER).decode(errors="replace")
    finally:
        limit.cancel()
        connection.close()


class _Pinned(HTTPConnection):
    """Connects to the address that was checked, under the name that was given."""

    def __init__(self, url: SplitResult) -> None:
        self._tls, self._abandoned = url.scheme == "https", False
        super().__init__(url.hostname or "", url.port or (443 if self._tls else 80), timeout=SECONDS)

    def connect(self) -> None:
        address = resolve(self.host, self.port, settings().webhook_hosts)
        self.sock = socket.create_connection((address, self.port), self.timeout)
        if self._abandoned:
            raise TimeoutError("timed out")
        if self._tls:
            self.sock = ssl.create_default_context().wrap_socket(self.sock, server_hostname=self.host)

    def abandon(self) -> None:
        self._abandoned = True
        if self.sock is not None:
            with suppress(OSError):
                self.sock.shutdown(socket.SHUT_RDWR)
