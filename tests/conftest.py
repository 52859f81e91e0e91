"""What every test runs under: one numerical thread a process, Ctrl-C that works, Hypothesis examples that may take their time."""

import os
import signal

signal.signal(signal.SIGINT, signal.default_int_handler)  # a suite started in the background inherits that it is ignored

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"  # before numpy is imported

from hypothesis import settings  # noqa: E402

settings.register_profile("ciris", deadline=None, derandomize=bool(os.environ.get("CI")))
settings.load_profile("ciris")

pytest_plugins = ["tests.services", "tests.skips"]
