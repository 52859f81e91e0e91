"""Compiles ahead of time what jobs, plans and questions call: ``python -m jobs.kernels``. The image keeps it, so a new container has it.

What is compiled goes to ``NUMBA_CACHE_DIR``, or beside the sources. It is for processors like this machine's.
"""

from __future__ import annotations

import subprocess
import sys

from certifier.compiled import forget_stale
from certifier.jobs import kernels
from certifier.map.free_set import as_file
from ciris.free_set import FreeSet

CHILDREN = ("certifier.seeding.propose", "planner.sampling.child")
"""These modules load Drake, so they are loaded in processes of their own."""


def compile_all() -> None:
    """Compiles what is not compiled yet, or was compiled of other sources.

    Raises:
        subprocess.CalledProcessError: a child has failed.
    """
    forget_stale()
    FreeSet.of_bytes(as_file(kernels.warm_up()), "the arm's free set")  # it is asked once, as the service asks maps
    for module in CHILDREN:
        subprocess.run([sys.executable, "-P", "-c", f"import {module} as module; module.warm_up()"], check=True)


if __name__ == "__main__":
    compile_all()
