"""This package holds the `ciris` command line.

Commands that compute do so in as many processes as there are cores, each in one thread. A BLAS with more threads makes them wait for each
other: two processes on two cores took six times as long to verify a pair.
"""

import os

# This must come before numpy is loaded.
os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"))
