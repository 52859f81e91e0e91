"""How long requests take, seen by a client that has a process of its own: ``python -m tests.api.latency URL KEY COUNT``."""

from __future__ import annotations

import http.client
import json
import subprocess
import sys
import time
from http import HTTPStatus
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAUSE_SECONDS = 0.02


def latencies(url: str, key: str, count: int) -> dict[str, float]:
    """Returns quantiles of the milliseconds that a request takes. Whatever threads compute in this process, they delay no answer."""
    command = [sys.executable, "-m", "tests.api.latency", url, key, str(count)]
    found: dict[str, float] = json.loads(subprocess.run(command, stdout=subprocess.PIPE, check=True, cwd=ROOT).stdout)
    return found


def main(url: str, key: str, count: int) -> None:
    connection = http.client.HTTPConnection(url.removeprefix("http://"), timeout=60)
    seconds = []
    for _ in range(count):
        began = time.perf_counter()
        connection.request("GET", "/v1/project", headers={"Authorization": f"Bearer {key}"})
        answer = connection.getresponse()
        answer.read()
        assert answer.status == HTTPStatus.OK, answer.status
        seconds.append(time.perf_counter() - began)
        time.sleep(PAUSE_SECONDS)
    connection.close()
    seconds.sort()
    print(json.dumps({f"p{100 * part:g}": 1e3 * seconds[int(part * (count - 1))] for part in (0.5, 0.9, 0.99, 1.0)}))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
