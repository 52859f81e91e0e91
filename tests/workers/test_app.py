"""What the settings of Celery have to withstand, in a real worker."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from certifier.orphans import die_with_parent
from tests.services import Queue
from tests.workers.service import ROOT, environment, eventually
from workers.app import SOLVE, celery_app, send_work, waiting

SLOW = """
import os, sys, time
from pathlib import Path
from celery.signals import worker_process_init
from workers.__main__ import main

started = Path(sys.argv.pop())

def start(**_):
    time.sleep(6.0 if list(started.iterdir()) else 0.0)
    (started / str(os.getpid())).touch()

worker_process_init.connect(start, weak=False)
sys.argv = ["workers", "solve"]
main()
"""
"""A worker. All of its processes but the first need longer to start than the four seconds that Celery gives them by default."""


@pytest.mark.slow
def test_a_process_that_starts_slowly_is_not_killed(sqlite_url: str, own_queue: Queue, tmp_path: Path) -> None:
    log, started = tmp_path / "solve.log", tmp_path / "started"
    started.mkdir()

    def all_done() -> bool:
        with celery_app().connection_for_read() as connection:
            return waiting(SOLVE) + connection.default_channel.client.hlen("unacked") == 0

    with environment(CIRIS_DATABASE_URL=sqlite_url, CIRIS_REDIS_URL=own_queue.url, CIRIS_SOLVE_PROCESSES="1"):
        with log.open("wb") as output:
            command = [sys.executable, "-c", SLOW, str(started)]
            worker = subprocess.Popen(command, cwd=ROOT, stdout=output, stderr=output, preexec_fn=partial(die_with_parent, signal.SIGKILL))
        try:
            first = eventually(lambda: next(started.iterdir(), None), "the first process has started", 60)
            send_work()
            eventually(all_done, "it takes messages", 60)
            os.kill(int(first.name), signal.SIGKILL)
            send_work()
            eventually(lambda: len(list(started.iterdir())) == 3 and all_done(), "the next process takes them", 60)
        finally:
            worker.send_signal(signal.SIGQUIT)
            worker.wait()
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    assert not any("Timed out waiting for UP message" in line["message"] for line in lines)
    assert [line["logger"] for line in lines if "SIGKILL" in line["message"]], "the pool says in the same form what befell a process"
    assert not any("superuser" in line["message"] for line in lines)
