"""Compiles the kernels once, before the tests: ``python -m tests.kernels``.

Otherwise the first tests and their children compile the same kernels side by side, which takes the processors minutes.
"""

from __future__ import annotations

from certifier.jobs import kernels
from planner.sampling import child

if __name__ == "__main__":
    kernels.warm_up()
    child.warm_up()
