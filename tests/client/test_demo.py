"""``./start`` on the small arm: a first run that computes, a second that shows what is stored."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from certifier.errors import CirisError
from certifier.outcome import DEADLINE
from client import demo, service
from tests.client.conftest import PLANAR, surroundings
from workers.stack import COMPILES

SCRIPT = f"import sys, pathlib, client.demo as demo; demo.SCENE = pathlib.Path({str(PLANAR)!r}); sys.exit(demo.main(['--once']))"


def test_a_busy_machine_gets_more_time_before_it_is_told_to_come_back(monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    region, box = (service.Grown({"share": share}, b"", 1.0) for share in ({"value": 0.4}, None))
    asked: list[float] = []
    answers: list[service.Grown | None] = []

    def grow(client: Any, request: dict[str, Any], screen: Any, idempotency_key: str) -> service.Grown:
        asked.append(request["deadline_seconds"])
        if (answer := answers.pop(0)) is None:
            raise CirisError("not_grown", f"{DEADLINE}; a and b were in the way of a region in 2 rounds")
        return answer

    monkeypatch.setattr(demo.service, "grow", grow)
    for first in (None, box):
        answers[:] = [first, region]
        assert demo._grown(None, {}) is region
        assert "no region but a box about the seed was certified within 120 s" in capsys.readouterr().out
    answers[:] = [box, box]
    assert demo._grown(None, {}) is box
    answers[:] = [None, None]
    with pytest.raises(CirisError, match="too busy for a first region"):
        demo._grown(None, {})
    assert asked == [120, 1200] * 4
    answers[:] = [region]
    assert demo._grown(None, {}) is region


def test_a_first_start_says_that_the_solvers_compile(tmp_path: Path) -> None:
    environment = surroundings(CIRIS_DATA_DIR=str(tmp_path / "data"), NUMBA_CACHE_DIR=str(tmp_path / "compiled"))
    with subprocess.Popen([sys.executable, "-c", SCRIPT], cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True) as start:
        try:
            assert start.stdout is not None
            assert [start.stdout.readline() for _ in range(2)] == ["starting the service ...\n", f"{COMPILES}\n"]
        finally:
            start.terminate()


@pytest.mark.slow
def test_the_second_run_shows_the_region_of_the_first(tmp_path: Path) -> None:
    said = []
    for _ in range(2):
        environment = surroundings(CIRIS_DATA_DIR=str(tmp_path / "data"))
        done = subprocess.run([sys.executable, "-c", SCRIPT], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert done.stdout.count(" certified ") >= 6
        assert "the proof was verified here" in done.stdout
        assert not (tmp_path / "data" / "stack.json").exists()
        said.append(done.stderr)
    assert "done in an earlier run" not in said[0]
    assert "done in an earlier run" in said[1]
