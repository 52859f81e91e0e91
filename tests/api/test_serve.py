"""The server process: what it refuses to bind to, and that it starts."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_an_address_that_others_can_reach_is_refused(tmp_path: Path) -> None:
    environment = {**os.environ, "CIRIS_HOST": "0.0.0.0", "CIRIS_DATA_DIR": str(tmp_path), "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-m", "api"], env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert done.stderr == (
        "error: CIRIS_HOST: others can reach 0.0.0.0, and this service asks nobody for a key (CIRIS_ALLOW_REMOTE=1 allows it)\n"
    )
    assert list(tmp_path.iterdir()) == []
