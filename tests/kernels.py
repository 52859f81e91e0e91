"""Compiles the kernels once, before the tests: ``python -m tests.kernels``.

Otherwise the first tests and their children compile the same kernels side by side, which takes the processors minutes.
"""

from __future__ import annotations

from certifier.jobs import kernels
from certifier.jobs.map import grow_map
from certifier.seeding.arm import arm
from planner.sampling import child

if __name__ == "__main__":
    kernels.warm_up()
    grow_map(arm(), coverage=0.1)
    child.warm_up()
