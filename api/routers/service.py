"""These routes say whether the service runs and can do its work."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response, status
from kombu.exceptions import OperationalError
from redis.exceptions import RedisError
from sqlalchemy.exc import SQLAlchemyError

from api import metrics
from api.access import READ, WholeDb
from api.schemas.service import Health, Readiness
from certifier.errors import CirisError
from db import version
from db.session import Database
from db.statistics import collect
from workers.app import CONTROL, SOLVE, waiting

router = APIRouter(tags=["service"])


@router.get("/healthz")
async def get_health() -> Health:
    """Answers whenever the process runs."""
    return Health()


@router.get("/readyz", responses={503: {"model": Readiness, "description": "The service cannot reach something that it needs."}})
def get_readiness(db: WholeDb, response: Response) -> Readiness:
    """Says whether the service can reach the database and the queue, and whether the database's disk has room (SQLite).

    Without the queue the service still accepts jobs, but they wait. Without room it accepts none, begins nothing new, and goes on by
    itself when there is some.
    """
    checks = {"database": _database(db), "queue": _queue()}
    if db.sqlite:
        checks["disk"] = db.disk.trouble() or "ok"
    ready = set(checks.values()) == {"ok"}
    if not ready:
        response.status_code = status.HTTP_503_SERVICE_UNAVAILABLE
    return Readiness(ready=ready, checks=checks)


@router.get(
    "/metrics", dependencies=[READ], response_class=Response, responses={200: {"content": {"text/plain": {"schema": {"type": "string"}}}}}
)
def get_metrics(request: Request, db: WholeDb) -> Response:
    """Returns the numbers of jobs, pairs, waiting messages and requests of all projects, in Prometheus' text format."""
    try:
        messages = {queue: waiting(queue) for queue in (CONTROL, SOLVE)}
    except (OperationalError, RedisError):
        messages = {}
    with db.read() as session:
        statistics = collect(session)
    return Response(metrics.render(statistics, messages, request.app.state.requests), media_type=metrics.MEDIA_TYPE)


def _database(db: Database) -> str:
    try:
        with db.read() as session:
            version.check(session)
    except CirisError as error:
        return error.message
    except SQLAlchemyError as error:
        return f"cannot be used: {type(error).__name__}"
    return "ok"


def _queue() -> str:
    try:
        waiting(CONTROL)
    except (OperationalError, RedisError) as error:
        return f"Redis cannot be reached: {error}"
    return "ok"
