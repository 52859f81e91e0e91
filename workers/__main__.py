"""``python -m workers control`` or ``python -m workers solve`` runs one Celery worker, with the settings of the environment.

The control worker coordinates jobs in threads, runs the sweeper, delivers webhooks and copies SQLite's log into its database. The solve
worker runs ``CIRIS_SOLVE_PROCESSES`` processes, and one for new jobs (workers.spare), after it has loaded what they call
(certifier.jobs.kernels). Each computes in one thread, because the pairs already run in parallel.
"""

from __future__ import annotations

import argparse
import os
import sys
import threading
import warnings
from contextlib import suppress
from typing import Any

NURSERY_S = 60.0
"""A process that solves takes work when it has what makes proposals, or after this many seconds."""
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m workers", description="A Celery worker of ciris.")
    parser.add_argument("queue", choices=["control", "solve"])
    parser.add_argument("--background", action="store_true", help="let everything else on this machine go first")
    asked = parser.parse_args()
    queue: str = asked.queue
    os.environ.update(ONE_THREAD)  # must come before numpy is imported

    from celery.exceptions import SecurityWarning
    from celery.signals import setup_logging, worker_process_init, worker_process_shutdown, worker_ready
    from celery.utils.log import get_multiprocessing_logger

    from certifier.compiled import compiling
    from certifier.errors import CirisError
    from certifier.isolation.child import prepare
    from certifier.orphans import die_with_parent
    from db import logs, traces
    from db.session import check_version, database
    from db.settings import SPARE, settings
    from db.states import WorkerState
    from db.workers import WorkerKind
    from workers.app import CONTROL, SOLVE, celery_app
    from workers.heartbeat import Heartbeat
    from workers.presence import Presence
    from workers.processes import NICENESS, give_way
    from workers.tasks import register
    from workers.troubles import Troubles

    stop, worker, niceness = threading.Event(), os.getpid(), os.getpriority(os.PRIO_PROCESS, 0) + NICENESS
    heard, told = os.pipe()
    os.set_blocking(told, False)

    logs.configure(queue)
    try:
        check_version(settings().database)
    except CirisError as error:
        parser.exit(2, f"error: {error}\n")
    app = celery_app()
    register(app, queue)
    app.steps["worker"].add(Heartbeat)
    troubles = Troubles()
    presence = Presence(WorkerKind(queue), stop, troubles)
    threading.Thread(target=presence.run, name="presence", daemon=True).start()
    forked = settings().solve_processes + SPARE
    pool = ["--pool=threads", "--concurrency=2"] if queue == CONTROL else ["--pool=prefork", f"--concurrency={forked}"]
    if queue == SOLVE:
        from certifier.jobs import kernels

        with compiling(lambda: presence.say(WorkerState.COMPILING)):
            kernels.warm_up()  # before it takes any work, and once for all processes that it forks
        presence.say(WorkerState.STARTING)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # Celery says there in plain lines that it was asked to end
    # It warns of a superuser's worker that would take pickled messages. Ours take JSON only.
    warnings.filterwarnings("ignore", category=SecurityWarning)

    @setup_logging.connect(weak=False)
    def keep_logs(**_: Any) -> None:
        get_multiprocessing_logger().propagate = True  # what the pool says would be in plain lines

    @worker_process_init.connect(weak=False)
    def after_fork(**_: Any) -> None:
        die_with_parent(parent=worker)
        database.cache_clear()
        try:
            if queue == SOLVE:
                from certifier.seeding import PROPOSE

                nursery = prepare(PROPOSE, NURSERY_S)
                if asked.background:
                    give_way(niceness, nursery)
            traces.configure(queue)
        finally:  # Celery logs what went wrong, and has the process take work
            with suppress(BlockingIOError):  # once is enough
                os.write(told, b"1")

    @worker_process_shutdown.connect(weak=False)
    def before_end(**_: Any) -> None:
        traces.end()

    def begin_with_first(consumer: Any) -> None:
        """Celery is ready before any process can take work: each loads for seconds, or for a minute on a busy machine."""
        os.read(heard, 1)
        presence.begin(consumer)

    @worker_ready.connect(weak=False)
    def begin(sender: Any, **_: Any) -> None:
        if asked.background:
            give_way(niceness)
        if queue == SOLVE:
            threading.Thread(target=begin_with_first, args=(sender,), name="first process", daemon=True).start()
        else:
            presence.begin(sender)
            traces.configure(queue)
            from workers import checkpoints, sweeper, webhooks

            for loop in (sweeper.run, webhooks.run, checkpoints.run):
                threading.Thread(target=loop, args=(stop, troubles), name=loop.__module__, daemon=True).start()

    app.worker_main(
        [
            "--quiet",
            "worker",
            f"--queues={queue}",
            f"--hostname={queue}-{os.getpid()}@%h",
            *pool,
            "--without-mingle",
            "--without-gossip",
            "--loglevel=INFO",
        ]
    )
    stop.set()
    presence.leave()
    traces.end()
    if presence.refused:
        sys.exit(os.EX_UNAVAILABLE)


if __name__ == "__main__":
    main()
