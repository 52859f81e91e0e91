"""``ciris doctor`` finds out what is installed, which solvers work and what the machine can do."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

from certifier.errors import CirisError
from certifier.words import counted
from ciris.find import api_key, data_dir, service_url
from ciris.synchronous.client import Client
from client.cores import cores

PACKAGES = ("drake", "python-flint", "numpy", "scipy", "numba", "fastapi", "celery", "redis", "sqlalchemy")


@dataclass(frozen=True)
class Finding:
    """A finding is one thing that was looked at. ``good`` is False where something that is needed is missing."""

    name: str
    text: str
    good: bool = True


def examine(url: str | None) -> list[Finding]:
    """Looks at everything, and returns the findings in an order for people."""
    return [
        Finding("python", f"{platform.python_version()} on {platform.platform()}", sys.version_info >= (3, 11)),
        Finding("machine", f"{counted(cores(), 'core')}, {_memory_gib():.1f} GiB of memory"),
        *map(_package, PACKAGES),
        _tried("drake solvers", _solvers),
        _tried("exact arithmetic", _flint),
        Finding("data directory", str(data_dir())),
        _service(url),
    ]


def _memory_gib() -> float:
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30


def _package(name: str) -> Finding:
    try:
        return Finding(name, version(name))
    except PackageNotFoundError:
        return Finding(name, "is not installed", False)


def _tried(name: str, look: Callable[[], str]) -> Finding:
    try:
        return Finding(name, look())
    except (ImportError, RuntimeError, AssertionError) as error:
        return Finding(name, f"{type(error).__name__}: {error}", False)


def _solvers() -> str:
    """Returns the names of the solvers that this Drake may use. It first tries Clarabel, which is needed."""
    from pydrake import solvers

    program = solvers.MathematicalProgram()
    x = program.NewContinuousVariables(1)
    program.AddLinearCost(x[0])
    program.AddBoundingBoxConstraint(1, 2, x)
    assert abs(solvers.ClarabelSolver().Solve(program).get_optimal_cost() - 1) < 1e-6, "Clarabel solved a linear program wrongly"
    kinds = (solvers.ClarabelSolver, solvers.ScsSolver, solvers.SnoptSolver, solvers.IpoptSolver, solvers.MosekSolver)
    return ", ".join(kind.__name__.removesuffix("Solver") for kind in kinds if kind().available() and kind().enabled())


def _flint() -> str:
    from flint import fmpq

    assert fmpq(1, 3) + fmpq(1, 6) == fmpq(1, 2)
    return "rationals work"


def _service(url: str | None) -> Finding:
    try:
        with Client(service_url(url), api_key()) as client:
            ready = client.ready()
            wrong = "; ".join(f"{name}: {state}" for name, state in ready["checks"].items() if state != "ok")
            how = "is not ready" if not ready["ready"] else "is ready, but jobs wait" if wrong else "is ready"
            return Finding("service", f"{client.url} {how}{f' ({wrong})' if wrong else ''}", not wrong)
    except CirisError as error:
        return Finding("service", str(error), good=error.code == "no_service" and url is None)
