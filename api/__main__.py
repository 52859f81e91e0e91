"""``python -m api`` runs the HTTP service on the host and port of the settings. The database must be migrated already."""

from __future__ import annotations

import gc
import socket
import sys

import uvicorn
from fastapi import FastAPI

from api.app import create_app
from api.connections import BoundedProtocol, allow_files
from api.delivery import every
from certifier.errors import CirisError
from db import keys, logs, traces
from db.session import check_version
from db.settings import settings
from db.vault import vault

SHUTDOWN_SECONDS = 2
"""When the service ends, open streams may delay its end by at most this many seconds."""
KEEP_ALIVE_SECONDS = 75
"""The service keeps an idle connection open for this many seconds. This is longer than clients keep one: if the service
closed first, a client's next request could be lost.
"""
BACKLOG = 2048
"""At most this many connections may wait until the service accepts them. The number is uvicorn's own default."""
NOT_STARTED = 3
"""The process exits with this status when the server did not start, as ``uvicorn.run`` does."""
GARBAGE = 20_000, 10, 100
"""The thresholds of Python's garbage collector: how many new objects start a pass over the young objects, then how many passes
start one over the middle and over the old objects.
"""
SWITCH_SECONDS = 0.0002
"""A thread that computes gives way to another one after this time. One request waits for the interpreter several times."""


def main() -> None:
    """Serves until a signal ends the process. It refuses an address that others can reach while there are no API keys."""
    logs.configure("api")
    try:
        check_version(settings().database)
        keys.check_bind(settings())
        vault()  # a key that is none is found out now
    except CirisError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
    allow_files()
    sys.setswitchinterval(SWITCH_SECONDS)
    traces.configure("api")
    config = uvicorn.Config(
        _frozen_app,
        factory=True,
        http=BoundedProtocol,
        ws="none",
        forwarded_allow_ips=[str(network) for network in settings().trusted_proxies],
        host=settings().host,
        port=settings().port,
        timeout_graceful_shutdown=SHUTDOWN_SECONDS,
        timeout_keep_alive=KEEP_ALIVE_SECONDS,
        log_config=None,
        access_log=False,
    )
    server = uvicorn.Server(config)
    server.run(sockets=None if settings().requests_file is None else [_shared_socket()])
    traces.end()
    if not server.started:
        sys.exit(NOT_STARTED)


def _shared_socket() -> socket.socket:
    """Returns a listening socket on the port that all API processes of this service share. The kernel distributes the connections."""
    address = settings().host, settings().port
    return socket.create_server(address, family=settings().family, reuse_port=True, backlog=BACKLOG)


def _frozen_app() -> FastAPI:
    """Makes the application with all of its routes, and limits how often the garbage collector runs, because it stops every request.

    FastAPI makes the routes of a router when they are first looked at, for which the first requests would wait. The collector never looks
    at objects that exist when the application is made, and seldom at the later ones.
    """
    app = create_app()
    list(every(app.routes))
    gc.collect()
    gc.freeze()
    gc.set_threshold(*GARBAGE)
    return app


if __name__ == "__main__":
    main()
