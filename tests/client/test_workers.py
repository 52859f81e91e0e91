"""The commands about workers, against a service over HTTP."""

from __future__ import annotations

from db import leases
from tests.client.conftest import Ciris


def test_workers_are_listed_with_what_they_do(ciris: Ciris, url: str, busy: str) -> None:
    (worker,) = ciris("worker", "ls", "--json", CIRIS_URL=url).json
    assert (worker["processes"], worker["busy"]) == (4, 1)
    header, line = ciris("worker", "ls", CIRIS_URL=url).stdout.splitlines()
    assert header.split()[:3] == ["id", "kind", "state"]
    assert line.split()[:7] == [worker["id"][:8], "solve", "running", "1", "4", "8", "16.0"]
    assert line.endswith(f"pairs of {busy[:8]}")
    shown = ciris("worker", "show", worker["id"][:8], CIRIS_URL=url).stdout
    assert f"pairs 0 of iteration 0 of job {busy[:8]} in {leases.this_worker()}" in shown


def test_a_worker_is_paused_resumed_and_drained(ciris: Ciris, url: str, busy: str) -> None:
    (worker,) = ciris("worker", "ls", "--json", CIRIS_URL=url).json
    for verb, wanted in (("pause", "paused"), ("resume", "running"), ("drain", "draining")):
        assert ciris("worker", verb, worker["id"], "--json", CIRIS_URL=url).json["wanted"] == wanted
    assert "running, to be draining" in ciris("worker", "show", worker["id"], CIRIS_URL=url).stdout
    refused = ciris("worker", "pause", worker["id"], CIRIS_URL=url)
    assert (refused.status, refused.error) == (2, "worker: the worker is ending (start another one)")
    assert ciris("worker", "show", "nobody", CIRIS_URL=url).status == 2
