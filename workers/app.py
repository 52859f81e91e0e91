"""The Celery application: built once from the settings, set up to lose no work, and the senders of its messages.

Messages carry only ids and are sent after the transaction that they announce. A message may come twice, late or never: what is
to be done stands in the database, claims are conditional, and the sweeper sends again what was lost.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from functools import cache

from celery import Celery
from kombu import Queue
from kombu.exceptions import OperationalError

from db.settings import settings

log = logging.getLogger(__name__)

CONTROL, SOLVE = "control", "solve"
COORDINATE, SOLVE_PAIRS, RUN_STEP = "ciris.coordinate", "ciris.solve_pairs", "ciris.run_step"

SENDING = {"max_retries": 1, "interval_start": 0, "interval_step": 0}
"""Whoever sends does not wait for Redis to come back: the sweeper sends again."""


@cache
def celery_app() -> Celery:
    """The application, one for the process."""
    app = Celery("ciris", broker=settings().redis_url, set_as_current=True)
    app.conf.update(
        task_queues=[Queue(CONTROL), Queue(SOLVE)],
        task_default_queue=CONTROL,
        task_routes={COORDINATE: CONTROL, SOLVE_PAIRS: SOLVE, RUN_STEP: SOLVE},
        task_serializer="json",
        accept_content=["json"],
        task_ignore_result=True,
        # A task is done when its results are in the database: a worker that dies gives its message back at once.
        task_acks_late=True,
        task_reject_on_worker_lost=True,
        worker_prefetch_multiplier=1,
        worker_hijack_root_logger=False,
        broker_connection_retry_on_startup=True,
        broker_connection_max_retries=None,
        broker_transport_options={
            # A whole worker that dies gives its messages back within seconds, not minutes.
            "unacked_restore_interval": 5,
            "unacked_restore_throttle": 1,
            "visibility_timeout": 3600,
            # Waiting for a message is not a broken connection.
            "socket_timeout": None,
            "socket_connect_timeout": 2,
            **SENDING,
        },
        task_publish_retry_policy=SENDING,
    )
    return app


def send_coordinate(job_id: str) -> bool:
    """Asks for a coordination of the job; False when Redis cannot be reached (the sweeper asks again)."""
    return _send(COORDINATE, [[job_id]])


def send_pairs(job_id: str, iteration: int, batches: Sequence[Sequence[int]]) -> bool:
    """Sends batches of pair indices to the solvers; False as for :func:`send_coordinate`."""
    return _send(SOLVE_PAIRS, [[job_id, iteration, list(batch)] for batch in batches])


def send_step(step_id: int) -> bool:
    """Sends a step to the solvers; False as for :func:`send_coordinate`."""
    return _send(RUN_STEP, [[step_id]])


def stop_messages(task_ids: Sequence[str]) -> None:
    """Kills the processes that work on these messages. What is not reached ends by itself and can save nothing."""
    if task_ids:
        try:
            celery_app().control.revoke(list(task_ids), terminate=True, signal="SIGKILL")
        except OperationalError as error:
            log.warning("Redis cannot be reached; %d tasks that are not needed run to their end: %s", len(task_ids), error)


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
    """How many messages wait in a queue.

    Raises:
        kombu.exceptions.OperationalError: Redis cannot be reached.
    """
    app = celery_app()
    with app.connection_for_read() as connection, connection.channel() as channel:
        return int(app.amqp.queues[queue](channel).queue_declare(passive=False).message_count)
