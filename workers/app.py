"""This module builds the Celery application from the settings, and sends its messages.

A message to the control worker names a job. A message to the solvers only says that there is work; a solver that takes it asks the
database which work (db.work).

A message is sent after the transaction that it announces. It may come twice, late or never: the database says what work there is,
claims are conditional, and the sweeper sends again what was lost.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from functools import cache

from celery import Celery
from kombu import Queue
from kombu.exceptions import OperationalError
from redis.exceptions import RedisError

from db.settings import settings

log = logging.getLogger(__name__)

CONTROL, SOLVE = "control", "solve"
COORDINATE, WORK = "ciris.coordinate", "ciris.work"

SILENCE_SECONDS = 10
"""A Redis that says nothing for this many seconds is believed gone, and a new connection is opened."""
GRACE_SECONDS = 30
"""A step ends itself with an error at its own limit. The worker kills its process this many seconds after that limit."""
START_SECONDS = 120
"""A worker kills a process that it has forked anew and that has not said within this many seconds that it is up.

Celery's four seconds are too few on a machine at work, and the next process needs as long. The time also counts what the worker itself is
late to listen. A process that really hangs leaves the others alone meanwhile.
"""

SENDING = {"max_retries": 1, "interval_start": 0, "interval_step": 0}
"""A sender does not wait until Redis comes back: the sweeper sends again."""


@cache
def celery_app() -> Celery:
    """Returns the application, one for the process."""
    app = Celery("ciris", broker=_verifying(settings().redis_url), set_as_current=True)
    app.conf.update(
        task_queues=[Queue(CONTROL), Queue(SOLVE)],
        task_default_queue=CONTROL,
        task_routes={COORDINATE: CONTROL, WORK: SOLVE},
        task_serializer="json",
        accept_content=["json"],
        task_ignore_result=True,
        # A task is done when its results are in the database, so a worker that dies gives its message back at once.
        task_acks_late=True,
        task_reject_on_worker_lost=True,
        worker_prefetch_multiplier=1,
        worker_proc_alive_timeout=START_SECONDS,
        task_time_limit=settings().time_limit_seconds + GRACE_SECONDS,
        worker_enable_remote_control=False,
        worker_hijack_root_logger=False,
        broker_connection_retry_on_startup=True,
        broker_connection_max_retries=None,
        broker_transport_options={
            "socket_timeout": SILENCE_SECONDS,
            "socket_connect_timeout": 2,
            "socket_keepalive": True,
            "health_check_interval": SILENCE_SECONDS // 2,
            **SENDING,
        },
        task_publish_retry_policy=SENDING,
    )
    return app


def _verifying(url: str) -> str:
    """Returns the URL of a queue so that TLS looks at the server's certificate, which Celery does only when the URL says so."""
    if not url.startswith("rediss://") or "ssl_cert_reqs=" in url:
        return url
    return f"{url}{'&' if '?' in url else '?'}ssl_cert_reqs=required"


def send_coordinate(job_id: str) -> bool:
    """Asks for a coordination of the job. Returns False when Redis cannot be reached; the sweeper then asks again."""
    return _send(COORDINATE, [[job_id]])


def send_work(count: int = 1) -> bool:
    """Wakes ``count`` solvers. Each of them wakes another while work is left. It returns False when Redis cannot be reached."""
    return _send(WORK, [[]] * count)


def _send(name: str, calls: Sequence[Sequence[object]]) -> bool:
    app = celery_app()
    try:
        with app.producer_pool.acquire(block=True) as producer:
            for args in calls:
                app.send_task(name, args=args, producer=producer)
    except OperationalError as error:
        log.warning("Redis cannot be reached; %s is sent later by the sweeper: %s", name, error)
        return False
    return True


def waiting(queue: str) -> int:
    """Returns how many messages wait in a queue.

    Raises:
        kombu.exceptions.OperationalError: Redis cannot be reached.
    """
    app = celery_app()
    try:
        with app.connection_for_read() as connection, connection.ensure_connection(**SENDING).channel() as channel:
            return int(app.amqp.queues[queue](channel).queue_declare(passive=False).message_count)
    except RedisError as error:
        raise OperationalError(str(error)) from error
