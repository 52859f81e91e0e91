"""The access log has one line for every request: what was asked, who asked, the status, and the time it took. It never shows bodies."""

from __future__ import annotations

import logging
import time
from http import HTTPStatus

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from api.metrics import Requests

log = logging.getLogger(__name__)


class AccessLog:
    """This ASGI middleware writes the log line of each request and counts it. It is the outermost one. It logs a stream when it ends."""

    def __init__(self, app: ASGIApp, requests: Requests) -> None:
        self._app, self._requests = app, requests

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        start, status = time.perf_counter(), int(HTTPStatus.INTERNAL_SERVER_ERROR)

        async def noted(message: Message) -> None:
            nonlocal status
            status = message.get("status", status)
            await send(message)

        try:
            await self._app(scope, receive, noted)
        finally:
            seconds = time.perf_counter() - start
            self._requests.note(scope["method"], status, seconds, stream=scope["path"].endswith("/stream"))
            caller = scope.get("state", {}).get("caller")
            fields = {
                "method": scope["method"],
                "path": scope["path"],
                "status": status,
                "seconds": round(seconds, 4),
                "client": scope["client"][0] if scope.get("client") else None,
                "key": caller and caller.id,
            }
            log.info("request", extra=fields)
