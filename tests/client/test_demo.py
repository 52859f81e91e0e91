"""``./start`` on the small arm: a first run that computes, a second that shows what is stored."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.client.conftest import PLANAR, surroundings

SCRIPT = f"import sys, pathlib, client.demo as demo; demo.SCENE = pathlib.Path({str(PLANAR)!r}); sys.exit(demo.main(['--once']))"


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
