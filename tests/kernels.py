"""Compiles the kernels of the certifier once, before the tests: ``python -m tests.kernels growth`` and ``python -m tests.kernels motions``.

Otherwise the first tests and their children compile the same kernels side by side, which takes the processors minutes.
"""

from __future__ import annotations

import io
import os
import sys
import tempfile
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

PLANAR = str(Path(__file__).parents[1] / "examples/planar_2dof/scene.yaml")


def growth() -> int:
    """Has a region grown in both ways, in this process alone; returns the exit status."""
    from client.cli import main

    said = io.StringIO()
    with tempfile.TemporaryDirectory() as directory, redirect_stdout(said), redirect_stderr(said):
        grow = ["grow", PLANAR, "--local", "--out"]
        status = max(main([*grow, f"{directory}/whole.proof"]), main([*grow, f"{directory}/targeted.proof", "--paper"]))
    if status:
        print(said.getvalue(), file=sys.stderr)
    return status


def motions() -> int:
    """Has motions found and certified, in this process alone."""
    from certifier.jobs import motion
    from planner.sampling import child

    motion.warm_up()
    child.warm_up()
    return 0


if __name__ == "__main__":
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {(min if sys.argv[1] == "growth" else max)(os.sched_getaffinity(0))})
    sys.exit({"growth": growth, "motions": motions}[sys.argv[1]]())
