"""What is compiled for the image is all that a container needs: jobs in it compile nothing."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PLANAR = str(ROOT / "examples/planar_2dof/scene.yaml")
JOBS = (
    ["grow", PLANAR, "--local", "--out", "region.proof"],
    ["map", PLANAR, "--local", "--coverage", "0.5", "--out", "map.proof"],
    ["certify-path", PLANAR, "--local", "--q", "0,0", "--q", "0.35,-0.1"],
    ["verify", "region.proof"],
)


@pytest.mark.slow  # everything is compiled again, which takes the processor two minutes
def test_jobs_in_a_new_container_compile_nothing(tmp_path: Path) -> None:
    dockerfile = (ROOT / "Dockerfile").read_text()
    assert "RUN NUMBA_CACHE_DIR=$CIRIS_KERNELS python -m jobs.kernels\n" in dockerfile
    assert re.search(r"COPY --chmod=755 deploy/entry \S+/ciris-entry\n", dockerfile)
    image, container, home = (tmp_path / name for name in ("image", "container", "home"))
    home.mkdir()
    plain = {"PATH": os.environ["PATH"], "PYTHONPATH": str(ROOT), "HOME": str(home)}
    subprocess.run([sys.executable, "-m", "jobs.kernels"], env=plain | {"NUMBA_CACHE_DIR": str(image)}, check=True, cwd=tmp_path)
    compiled = {path.relative_to(image): path.read_bytes() for path in image.rglob("*") if path.is_file()}
    assert len(compiled) > 50
    for path in image.rglob("*"):
        path.chmod(0o555)
    environment = plain | {"NUMBA_CACHE_DIR": str(container), "CIRIS_KERNELS": str(image)}
    for job in JOBS:
        command = [str(ROOT / "deploy/entry"), sys.executable, "-m", "client.cli", *job]
        done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    new = [path for path in container.rglob("*") if path.is_file() and not path.is_symlink()]
    assert new == [], "a job has compiled something"
    assert {path.relative_to(image): path.read_bytes() for path in image.rglob("*") if path.is_file()} == compiled
