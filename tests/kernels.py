"""Compiles the kernels of the certifier once, before the tests: ``python -m tests.kernels``.

Otherwise the first tests and their children compile the same kernels side by side, which takes the processors minutes.
"""

from __future__ import annotations

import io
import os
import sys
import tempfile
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

from client.cli import main

PLANAR = str(Path(__file__).parents[1] / "examples/planar_2dof/scene.yaml")


def compile_kernels(directory: str) -> int:
    """Has a region grown in both ways and a motion certified, in this process alone; returns the exit status."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    grow = ["grow", PLANAR, "--local", "--out"]
    motion = ["certify-path", PLANAR, "--local", "--tube", "--q", "0.2,-0.4", "--q=-0.4,0.3"]
    certified = [*grow, f"{directory}/whole.proof"], [*grow, f"{directory}/targeted.proof", "--paper"], motion
    said = io.StringIO()
    with redirect_stdout(said), redirect_stderr(said):
        status = max(main(arguments) for arguments in certified)
    if status:
        print(said.getvalue(), file=sys.stderr)
    return status


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        sys.exit(compile_kernels(scratch))
