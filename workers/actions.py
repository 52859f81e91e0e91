"""The action that asked for an iteration is made again from the iteration's row."""

from __future__ import annotations

from certifier.growth.actions import Certify
from certifier.model import Polytope
from certifier.polytopes.proved import ProvedBox
from db.models import IterationRow


def certify_action(iteration: IterationRow, pairs: list[int]) -> Certify:
    """Returns the action that asked for an iteration.

    Args:
        pairs: the pairs to certify, which have rows of their own.
    """
    arrays = iteration.arrays
    return Certify(
        iteration=iteration.index,
        label=iteration.label,
        polytope=Polytope(arrays["C"], arrays["d"]),
        center=arrays.get("center"),
        pairs=pairs,
        reuse={int(pair): source for pair, source in iteration.reuse.items()},
        hard=iteration.hard,
        failures=iteration.failures,
        cells=iteration.cells,
        box=ProvedBox(*(arrays[name] for name in ("mid", "half", "Y_lower", "Y_upper"))) if "mid" in arrays else None,
        begun=iteration.begun,
        parts={int(pair): count for pair, count in iteration.parts.items()},
        ending=iteration.ending,
        together={int(pair): tuple(others) for pair, others in iteration.together.items()},
    )
