"""The application puts the routes, the problems, the guard and the dashboard together."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import AsyncIterator, MutableMapping
from contextlib import asynccontextmanager
from functools import cache, partial
from typing import Any

from anyio import move_on_after, to_thread
from fastapi import APIRouter, FastAPI
from fastapi.routing import APIRoute
from starlette.routing import BaseRoute

from api import delivery, document, guard, login, problems, warm_up
from api.access import Keyring
from api.access_log import AccessLog
from api.announce import Announcer
from api.cells import OutlinesKept
from api.children import AT_ONCE, ChildLimiter
from api.free_sets import FreeSetsKept
from api.libraries import Libraries
from api.links import LinksKept
from api.metrics import Requests
from api.motions import MotionsKept
from api.oidc import provider_of
from api.pages import site
from api.pages.rendering import render_problem
from api.parameters import KNOWN
from api.probes import Probes
from api.questions import LARGE, SMALL
from api.reading import READERS
from api.room import Room
from api.routers import (
    cells,
    drawing,
    events,
    inventory,
    jobs,
    motions,
    planning,
    plans,
    project,
    projects,
    regions,
    results,
    scenes,
    service,
    webhooks,
    workers,
)
from api.unanswered import Unanswered
from api.writing import WRITERS
from certifier.isolation.confinement import probed
from certifier.scene.bundle import expect_bundles
from db.session import CONNECTIONS, Database, database
from db.settings import LOOPBACK_NAMES, settings

log = logging.getLogger(__name__)

DESCRIPTION = """Certified collision-free regions of robot configuration space.

You upload a scene and start a job that grows or certifies a polytope. You get certified regions with proofs that anyone can check
offline. Errors are problem+json (RFC 9457) with a `code`, the `field` and a `hint`. The service refuses unknown fields, numbers that
are not finite, and bodies with more than 200 000 values."""


THREADS = CONNECTIONS - AT_ONCE - READERS - WRITERS - SMALL - LARGE - 3
"""All other requests share this many threads: those connections that children, reading and writing routes, questions, keys and the two
probes that read the database leave.
"""

UNTRACED = frozenset({"/healthz", "/readyz", "/metrics"})


def create_app(db: Database | None = None) -> FastAPI:
    """Makes the service on this database; the default is the database of the settings."""
    app = FastAPI(
        title="ciris",
        version="1",
        description=DESCRIPTION,
        docs_url=None,
        redoc_url=None,
        separate_input_output_schemas=False,
        lifespan=_lifespan,
        telemetry={"metrics": False, "logs": False, "operation_spans": False, "exclude": _untraced},
        form_limits={"max_files": 1, "max_fields": 2},
        routes=_routes(),
    )
    app.state.database = db or database()
    app.state.requests = Requests(settings().requests_file)
    app.state.probes = Probes(app.state.database)
    app.state.children = ChildLimiter()
    app.state.streams = Counter[str]()
    app.state.libraries = Libraries()
    app.state.links = LinksKept()
    app.state.motions = MotionsKept()
    app.state.free_sets = FreeSetsKept()
    app.state.unanswered = Unanswered()
    app.state.outlines = OutlinesKept()
    app.state.room = Room()
    app.state.keyring = Keyring(app.state.database, open_without_keys=settings().loopback and not settings().oidc_issuer)
    app.state.provider = provider_of(settings())
    app.state.announcer = Announcer()
    app.add_middleware(delivery.Unchanged)
    app.add_middleware(
        delivery.Compressed,
        minimum_size=delivery.COMPRESSED_BYTES,
        compresslevel=delivery.COMPRESSION,
        exclude_content_types=delivery.NOT_COMPRESSED,
    )
    app.add_middleware(delivery.Head)
    app.add_middleware(delivery.Methods)
    app.add_middleware(
        guard.Guard,
        keyring=app.state.keyring,
        hosts=LOOPBACK_NAMES if settings().loopback else None,
        rate=settings().requests_per_second,
        respond=partial(problems.respond, render_problem),
    )
    app.add_middleware(AccessLog, requests=app.state.requests)
    problems.install(app, render_problem)
    app.openapi = partial(document.describe, app)  # type: ignore[method-assign]
    return app


@cache
def _routes() -> list[BaseRoute]:
    """Returns the routes of every application of this process: FastAPI takes longer to prepare them than most requests take."""
    routes = APIRouter(generate_unique_id_function=_operation_id)
    for module in (
        *(scenes, jobs, results, webhooks, events, regions, cells, planning, plans, drawing, motions),
        *(project, projects, inventory, workers, service),
    ):
        routes.include_router(module.router, dependencies=[KNOWN])
    routes.include_router(events.project, dependencies=[KNOWN])
    routes.include_router(login.router)
    site.install(routes)
    return routes.routes


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    """Limits the threads that answer requests, and says how uploads are read.

    Each thread has its connection to the database, so more threads would only wait for each other.
    """
    to_thread.current_default_thread_limiter().total_tokens = THREADS
    log.info("uploads are read with: %s", await to_thread.run_sync(probed))
    expect_bundles()
    with move_on_after(warm_up.SECONDS):
        await to_thread.run_sync(warm_up.warm_up, app.state.database, abandon_on_cancel=True)
    yield


def _untraced(scope: MutableMapping[str, Any]) -> bool:
    """Leaves out of the traces what machines ask all the time, what is sent for as long as somebody listens, and what a page is made of."""
    path = scope["path"]
    return path in UNTRACED or path.endswith("/stream") or path.startswith("/static/")


def _operation_id(route: APIRoute) -> str:
    return route.name
