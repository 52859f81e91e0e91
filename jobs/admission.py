"""Before anything is computed, this module decides from the forecast of a job's pairs whether the job can fit at all."""

from __future__ import annotations

from collections.abc import Sequence

from certifier.errors import CirisError
from certifier.pair.forecast import PairCost
from db.settings import Settings


def check(costs: Sequence[PairCost], limits: Settings, seconds_left: float | None) -> None:
    """Refuses a job with a pair that needs more memory or time than there is. Such a job could only fail later.

    Args:
        seconds_left: seconds until the job's deadline; None without one.

    Raises:
        CirisError: does_not_fit, naming the worst pair.
    """
    if not costs:
        return
    largest = max(costs, key=lambda cost: cost.memory_bytes)
    if largest.memory_bytes > limits.pair_memory_bytes:
        needs, allowed = f"{largest.memory_bytes / 2**30:.3g} GiB of memory", f"{limits.pair_memory_bytes / 2**30:.3g} GiB"
        raise _too_much(largest, needs, f"a process may use {allowed} (CIRIS_PAIR_MEMORY_BYTES)")
    longest = max(costs, key=lambda cost: cost.seconds)
    if longest.seconds > limits.time_limit_seconds:
        raise _too_much(longest, f"{longest.seconds:.0f} s", f"the limit is {limits.time_limit_seconds:.0f} s (CIRIS_TIME_LIMIT_SECONDS)")
    if seconds_left is not None and longest.seconds > seconds_left:
        raise _too_much(longest, f"{longest.seconds:.3g} s", f"the deadline is in {max(seconds_left, 0):.3g} s")


def _too_much(cost: PairCost, needs: str, limit: str) -> CirisError:
    chain, vertices = len(cost.chain_a) + len(cost.chain_b), cost.rationals
    return CirisError(
        "does_not_fit",
        f"certifying {cost.a} and {cost.b} ({chain} joints between them, {vertices} vertices) needs about {needs}; {limit}",
        field="scene",
        hint="give the bodies fewer vertices, ignore the pair with a reason, or raise the limit",
    )
