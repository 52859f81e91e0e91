"""``python -m api``: the HTTP service on the settings' host and port, on a migrated database."""

from __future__ import annotations

import gc
import socket
import sys

import uvicorn
from fastapi import FastAPI

from api.app import create_app
from certifier.errors import CirisError
from db import keys, logs
from db.settings import settings

SHUTDOWN_SECONDS = 2
"""How long open streams may hold up the end."""
KEEP_ALIVE_SECONDS = 75
"""Longer than clients keep idle connections: whoever closes first must not be the one who answers."""
BACKLOG = 2048
"""Connections that may wait to be taken, as many as uvicorn has by itself."""
NOT_STARTED = 3
"""The exit status that ``uvicorn.run`` has then."""
GARBAGE = 20_000, 10, 100
"""After how many objects, and passes, the collector looks at the young, the middle and the old ones."""


def main() -> None:
    """Serves until a signal ends it; refuses an address that others can reach while there are no keys."""
    logs.configure("api")
    try:
        keys.check_bind(settings())
    except CirisError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    config = uvicorn.Config(
        _frozen_app,
        factory=True,
        host=settings().host,
        port=settings().port,
        timeout_graceful_shutdown=SHUTDOWN_SECONDS,
        timeout_keep_alive=KEEP_ALIVE_SECONDS,
        log_config=None,
        access_log=False,
    )
    server = uvicorn.Server(config)
    server.run(sockets=None if settings().requests_file is None else [_shared_socket()])
    if not server.started:
        sys.exit(NOT_STARTED)


def _shared_socket() -> socket.socket:
    """Listens beside the other API processes of this service; the kernel deals out the connections."""
    address = settings().host, settings().port
    return socket.create_server(address, family=settings().family, reuse_port=True, backlog=BACKLOG)


def _frozen_app() -> FastAPI:
    """The application. Looking for garbage stops every request: never in what is loaded with it, and seldom in the rest."""
    app = create_app()
    gc.collect()
    gc.freeze()
    gc.set_threshold(*GARBAGE)
    return app


if __name__ == "__main__":
    main()
