"""Joint positions and coordinates as users give them: how large they may be, and whole turns of them.

An angle of 1e16 radians is a double, but the next double is two radians away. No answer about it is worth anything. So every door
refuses numbers above MAGNITUDE, and below it whole turns are taken off to the last digit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from certifier.errors import RegionError

if TYPE_CHECKING:  # Commands that only need the bound start without numpy.
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

MAGNITUDE = 1e6
"""No joint position, in radians or metres, and no coordinate s of a configuration is larger than this."""
_TURN = (float.fromhex("0x1.921fb544p+2"), float.fromhex("0x1.0b4611a6p-32"), float.fromhex("0x1.3198a2e037073p-67"))
"""2 pi as a sum. The first two numbers have 33 bits at most, so their products with less than 2^20 turns are exact (Cody and Waite)."""


def check_magnitude(values: ArrayLike, field: str, most: float = MAGNITUDE, code: str = "number_too_large") -> None:
    """Refuses numbers, (...), that are not finite or too large for an answer about them.

    Args:
        field: where the user gave the numbers; the error adds the place among them, as in ``q[3][0]``.
        most: the largest magnitude, in the numbers' own unit.
        code: the error's code.

    Raises:
        RegionError: ``code``, with the first such number.
    """
    import numpy as np

    numbers = np.asarray(values, dtype=float)
    wrong = np.argwhere(~(np.abs(numbers) <= most))
    if len(wrong):
        place = "".join(f"[{i}]" for i in wrong[0])
        raise RegionError(code, f"{numbers[tuple(wrong[0])]} is no number of at most {most:g}", field=f"{field}{place}")


def without_turns(angles: NDArray[np.float64], turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns angles - 2 pi turns, (...), in radians, of angles up to MAGNITUDE; only the last digit of the result is rounded.

    Args:
        turns: (...), whole numbers. They leave less than MAGNITUDE of the angles.
    """
    first, second, third = _TURN
    return (angles - first * turns) - (second * turns + third * turns)
