"""These routes say whether the service runs and can do its work. Whatever hangs, they answer within a second."""

from __future__ import annotations

import asyncio

from fastapi import APIRouter, Request, Response, status

from api import metrics
from api.access import READ, WholeDb
from api.probes import OK, Asked
from api.schemas.service import Health, Readiness

OTHERS = frozenset({"queue"})
"""An API process can serve requests without what these checks are about."""

router = APIRouter(tags=["service"])


@router.get("/healthz")
async def get_health() -> Health:
    """Answers whenever the process runs."""
    return Health()


@router.get("/readyz", responses={503: {"model": Readiness, "description": "This process cannot serve requests."}})
async def get_readiness(probes: Asked, response: Response) -> Readiness:
    """Says whether this process can serve requests: whether the database answers and, with SQLite, whether its disk has room.

    The check of the queue does not count. Without the queue the service accepts jobs, and they wait. Without room on the disk it accepts
    none, begins nothing new, and goes on by itself when there is some. What hangs is named within a second.
    """
    checks = await probes.checks()
    ready = all(said == OK for check, said in checks.items() if check not in OTHERS)
    if not ready:
        response.status_code = status.HTTP_503_SERVICE_UNAVAILABLE
    return Readiness(ready=ready, checks=checks)


@router.get(
    "/metrics", dependencies=[READ], response_class=Response, responses={200: {"content": {"text/plain": {"schema": {"type": "string"}}}}}
)
async def get_metrics(request: Request, db: WholeDb, probes: Asked) -> Response:
    """Returns the numbers of jobs, pairs, waiting messages and requests of all projects, in Prometheus' text format.

    What hangs is left out, and `ciris_check` says that it hangs.
    """
    checks, messages, statistics = await asyncio.gather(probes.checks(), probes.messages(), probes.statistics())
    text = metrics.render(statistics, messages, request.app.state.requests, checks, db.connections())
    return Response(text, media_type=metrics.MEDIA_TYPE)
