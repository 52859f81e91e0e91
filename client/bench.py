"""``ciris bench`` runs the measurements of the folder benchmarks, which exists only in a checkout of the repository."""

from __future__ import annotations

import os
import sys
from argparse import Namespace
from pathlib import Path
from typing import NoReturn

from certifier.errors import CirisError

CHECKOUT = Path(__file__).parents[1]


def bench(args: Namespace) -> NoReturn:
    """Replaces this process by ``python -m benchmarks``.

    Raises:
        CirisError: ``no_benchmarks`` outside a checkout.
    """
    if not (CHECKOUT / "benchmarks").is_dir():
        raise CirisError("no_benchmarks", "the benchmarks are not installed", hint="run ciris from a checkout of the repository")
    path = os.pathsep.join([str(CHECKOUT), *filter(None, [os.environ.get("PYTHONPATH")])])
    command = [sys.executable, "-P", "-m", "benchmarks", args.benchmark, *args.arguments]
    os.execve(sys.executable, command, os.environ | {"PYTHONPATH": path})
