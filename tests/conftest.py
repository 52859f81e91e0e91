"""What every test runs under: one numerical thread a process, and Hypothesis examples that slow machines may take their time over."""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy is imported

from hypothesis import settings  # noqa: E402

settings.register_profile("ciris", deadline=None, derandomize="CI" in os.environ)
settings.load_profile("ciris")

pytest_plugins = ["tests.services"]
