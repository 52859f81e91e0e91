"""What is compiled for the image is all that a container needs: jobs in it compile nothing, and the first is as fast as the second."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from statistics import median

import pytest

ROOT = Path(__file__).parents[2]
PLANAR = str(ROOT / "examples/planar_2dof/scene.yaml")
JOBS = (
    ["grow", PLANAR, "--local", "--out", "region.proof"],
    ["map", PLANAR, "--local", "--coverage", "0.5", "--at", "0.2,-0.4", "--out", "map.proof"],
    ["map", PLANAR, "--local", "--coverage", "0.6", "--former", "map.proof", "--out", "longer.proof"],
    ["certify-path", PLANAR, "--local", "--q", "0,0", "--q", "0.35,-0.1"],
    ["verify", "region.proof"],
    ["verify", "longer.proof"],
    ["free-set", "longer.proof", "--out", "free.npz"],
)
ASK = """
import ciris
free = ciris.FreeSet.load("free.npz")
ends = [[0.2, -0.4], [0.1, 0.1]]
free.contains(ends), free.contains_motion(ends, ends), free.proved_parts(*ends), free.open_parts(*ends), free.nearest(ends[0])
"""
GROW = ["grow", PLANAR, "--local"]
TIMES = 5


def seconds(command: list[str], environment: dict[str, str], directory: Path) -> float:
    """The processor's seconds of a command that ends well."""
    before = os.times()
    done = subprocess.run(command, env=environment, cwd=directory, capture_output=True, text=True)
    after = os.times()
    assert done.returncode == 0, done.stderr
    return after.children_user + after.children_system - before.children_user - before.children_system


@pytest.mark.slow  # everything is compiled again, which takes the processor two minutes
def test_jobs_in_a_new_container_compile_nothing(tmp_path: Path) -> None:
    dockerfile = (ROOT / "Dockerfile").read_text()
    assert "RUN NUMBA_CACHE_DIR=$CIRIS_KERNELS python -m jobs.kernels\n" in dockerfile
    assert re.search(r"COPY --chmod=755 deploy/entry \S+/ciris-entry\n", dockerfile)
    image, home = tmp_path / "image", tmp_path / "home"
    home.mkdir()
    plain = {"PATH": os.environ["PATH"], "PYTHONPATH": str(ROOT), "HOME": str(home)}
    subprocess.run([sys.executable, "-m", "jobs.kernels"], env=plain | {"NUMBA_CACHE_DIR": str(image)}, check=True, cwd=tmp_path)
    compiled = {path.relative_to(image): path.read_bytes() for path in image.rglob("*") if path.is_file()}
    assert len(compiled) > 50
    for path in image.rglob("*"):
        path.chmod(0o555)
    first, second = [], []
    for number in range(TIMES):
        container = tmp_path / f"container-{number}"
        environment = plain | {"NUMBA_CACHE_DIR": str(container), "CIRIS_KERNELS": str(image)}
        grow, *jobs = [[str(ROOT / "deploy/entry"), sys.executable, "-m", "client.cli", *job] for job in (GROW, *JOBS)]
        first.append(seconds(grow, environment, tmp_path))
        second.append(seconds(grow, environment, tmp_path))
    print(f"processor seconds of the first job in a new container {first}, of the second {second}")
    assert median(first) < 1.1 * median(second)
    for job in jobs:
        seconds(job, environment, tmp_path)
    seconds([str(ROOT / "deploy/entry"), sys.executable, "-c", ASK], environment, tmp_path)
    new = [path for path in container.rglob("*") if path.is_file() and not path.is_symlink()]
    assert new == [], "a job has compiled something"
    assert {path.relative_to(image): path.read_bytes() for path in image.rglob("*") if path.is_file()} == compiled


@pytest.mark.slow  # what is not compiled yet is compiled first
def test_the_first_job_in_a_fresh_home_is_as_fast_as_the_second(tmp_path: Path) -> None:
    plain = {"PATH": os.environ["PATH"], "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, "-m", "jobs.kernels"], env=plain | {"HOME": str(tmp_path)}, check=True, cwd=tmp_path)  # as ./start does
    first, second = [], []
    for number in range(TIMES):
        home = tmp_path / f"home-{number}"
        home.mkdir()
        command = [sys.executable, "-m", "client.cli", *GROW]
        first.append(seconds(command, plain | {"HOME": str(home)}, home))
        second.append(seconds(command, plain | {"HOME": str(home)}, home))
    print(f"processor seconds of the first job in a new home {first}, of the second {second}")
    assert median(first) < 1.1 * median(second)
