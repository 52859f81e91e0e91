"""docs/python.md: all its code, as one program, and the programs of examples/ after it, as it calls them, against a real service."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.client.conftest import ROOT, surroundings
from tests.docs.test_quickstart import BLOCK, service

CHECK = """
assert waypoints[0].tolist() == [0.1, 0.05] and waypoints[-1].tolist() == [1.0, -1.5]
assert all(service.certify_path(scene, segment) for segment in pairwise(waypoints))
"""


def programs() -> str:
    """The page's code as one program."""
    page = (ROOT / "docs" / "python.md").read_text()
    return "\n".join(text for language, text in BLOCK.findall(page) if language == "python")


def test_editors_find_nothing_wrong_with_the_programs(tmp_path: Path) -> None:
    (tmp_path / "page.py").write_text(programs())
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--config-file", os.devnull, str(tmp_path / "page.py")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_every_program_of_the_page_works_as_it_stands(tmp_path: Path) -> None:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = surroundings(CIRIS_DATA_DIR=str(tmp_path / "data"), PATH=path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    page = (ROOT / "docs" / "python.md").read_text()

    def run(*arguments: str) -> str:
        command = [sys.executable, *arguments]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=500, check=False)
        assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
        return done.stdout

    calls = re.findall(r"^    python (examples/(\w+)\.py .*)$", page, re.MULTILINE)
    (trajectory,) = re.findall(r"^```json\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    (tmp_path / "trajectory.json").write_text(trajectory)
    with service(environment, tmp_path):
        said = run("-c", f"{programs()}\n{CHECK}")
        printed = {name: run(*call.split()).splitlines() for call, name in calls}
    assert re.search(r"^Region\(\w{8} of planar-2dof: 2 joints, \d+ faces, .* rad\^2, exact\)$", said, re.MULTILINE)
    assert "[ True False]" in said
    for name, ends in (("planner_gcs", [[0.1, 0.05], [0.2, 0.1]]), ("planner_ompl", [[0.1, 0.05], [1.0, -1.5]])):
        assert np.allclose([np.fromstring(printed[name][k], sep=",") for k in (0, -1)], ends)
    assert printed["moveit_trajectory"][0].startswith("certified: no collision in 1.5 s, ")
