"""docs/quickstart.md, as somebody with a robot that is no example walks through it: every command and the program at its end."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from certifier.verify.region import verify_region
from tests.client.conftest import ROOT, surroundings

BLOCK = re.compile(r"^```(sh|python)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
UNTIL = "--deadline 120"
"""Growth goes on until then in the document. Here it ends with the first region, as soon as it does on this machine."""


def blocks() -> list[tuple[str, str]]:
    """The document's commands and programs, in order."""
    return BLOCK.findall((ROOT / "docs" / "quickstart.md").read_text())


@contextmanager
def service(environment: dict[str, str], directory: Path) -> Iterator[None]:
    stack = subprocess.Popen(["ciris", "up", "--port", "0"], cwd=directory, env=environment, stdout=subprocess.PIPE, text=True)
    assert stack.stdout is not None
    assert "ciris is up" in stack.stdout.readline()
    try:
        yield
    finally:
        stack.send_signal(signal.SIGINT)
        stack.communicate(timeout=30)


def test_every_command_of_the_quickstart_works(tmp_path: Path) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = surroundings(CIRIS_DATA_DIR=str(tmp_path / "data"), PATH=path)

    def run(language: str, text: str) -> str:
        command = ["bash", "-euo", "pipefail", "-c", text] if language == "sh" else [sys.executable, "-c", text]
        directory = cell if cell.exists() else tmp_path
        done = subprocess.run(command, cwd=directory, env=environment, capture_output=True, text=True, timeout=200, check=False)
        assert done.returncode == 0, f"{text}\n{done.stdout}\n{done.stderr}"
        return done.stdout

    cell = tmp_path / "my_cell"
    steps = [(language, text.replace(UNTIL, f"{UNTIL} --stages 1")) for language, text in blocks()]
    assert sum(UNTIL in text for _, text in steps) == 2
    (up,) = (place for place, (_, text) in enumerate(steps) if text == "ciris up\n")
    said = [run(*step) for step in steps[:up]]
    assert "nothing touches at seed.yaml" in said[2]
    assert re.search(r"lift_arm/shoulder .*window", said[2])
    statement = verify_region((cell / "region.proof").read_bytes())
    assert [joint.name for joint in statement.scene.moving] == [f"lift_arm/{name}" for name in ("lift", "shoulder", "elbow", "wrist")]
    assert said[-1].startswith("the proof holds:")
    with service(environment, tmp_path):
        said = [run(*step) for step in steps[up + 1 :]]
    assert "inside: 0.25, 0.3, -0.5, 0.2" in said[0]
    assert any("condition 'forward': the direction (1, 0, 0) of 'lift_arm/tool' stays within 40 degrees" in one for one in said)
    assert any("the condition 'forward' is not kept: the angle is 57.3 degrees, and 40 at most" in one for one in said)
    assert said[-1].startswith("between_the_boards has the joints lift_arm/lift")
