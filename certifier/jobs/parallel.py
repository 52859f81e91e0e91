"""Pairs are certified one after the other in this process, or side by side in children of it."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Generator, Hashable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool

from certifier.errors import CirisError
from certifier.jobs.pairs import CertifyPart
from certifier.orphans import die_with_parent
from certifier.pair.result import PairResult

Asked = tuple[int, int]
"""A pair's index, and the number of the part."""


def side_by_side(certify: CertifyPart, asked: Sequence[Asked], processes: int, kind: Callable[[int], Hashable]) -> Generator[PairResult]:
    """Yields the results of parts of pairs in their order, which do not depend on the number of processes.

    Args:
        processes: number of child processes; 1 for this process alone.
        kind: returns the same for pairs, by their indices, that are alike. One child takes the same part of all of them, because what it
            finds for one helps with the next.

    Raises:
        CirisError: ``worker_lost``, when a child died, for example because the machine had no memory left.
    """
    if processes == 1 or len(asked) == 1:
        for index, part in asked:
            yield certify(index, part)
        return
    tasks: dict[tuple[Hashable, int], list[Asked]] = {}
    for index, part in asked:
        tasks.setdefault((kind(index), part), []).append((index, part))
    # The children are forked, so they have what the pairs share, and what earlier rounds left, without preparing it.
    with ProcessPoolExecutor(min(processes, len(tasks)), multiprocessing.get_context("fork"), _adopt, (certify, os.getpid())) as executor:
        try:
            found: dict[Asked, PairResult] = {}
            done = zip(tasks.values(), executor.map(_run, tasks.values()), strict=True)
            for one in asked:
                while one not in found:
                    found |= zip(*next(done), strict=True)
                yield found.pop(one)
        except BrokenProcessPool as error:
            problem, hint = "a process that certified pairs died", "look whether the machine ran out of memory; fewer cores need less of it"
            raise CirisError("worker_lost", problem, hint=hint) from error
        finally:
            executor.shutdown(cancel_futures=True)


_adopted: list[CertifyPart] = []
"""This holds the function of the parent of this process, so that it need not travel to it."""


def _adopt(certify: CertifyPart, parent: int) -> None:
    die_with_parent(parent=parent)  # the children hold one another's pipes open, so none of these would end
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # a terminal interrupts children too, and they have nothing to say about it
    _adopted.append(certify)


def _run(asked: list[Asked]) -> list[PairResult]:
    return [_adopted[0](*one) for one in asked]
