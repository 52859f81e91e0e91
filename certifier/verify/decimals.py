"""Bounds are printed as decimals of a few digits on the safe side of a double, because a statement has to be true as it is read."""

from __future__ import annotations

import math
import sys
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal


def rounded_down(x: float, digits: int = 3, times: int = 1) -> str:
    """Returns the largest decimal of ``digits`` significant digits that is no more than x times ``times``; x must be finite."""
    return f"{Context(digits, ROUND_FLOOR).multiply(Decimal(x), Decimal(times)):g}"


def rounded_up(x: float, digits: int = 3, times: int = 1) -> str:
    """Returns the least decimal of ``digits`` significant digits that is no less than x times ``times``; x must be finite."""
    return f"{Context(digits, ROUND_CEILING).multiply(Decimal(x), Decimal(times)):g}"


def at_least_mm(metres: float) -> str:
    """Returns a lower bound, given in metres, as a text in millimetres that is rounded down."""
    return f"{_plain(rounded_down(metres, times=1000))} mm"


def at_least_degrees(radians: float) -> str:
    """Returns a lower bound, given in radians, as a text in degrees that is rounded down, whatever the conversion rounds."""
    return f"{rounded_down(math.degrees(radians) * (1 - 4 * sys.float_info.epsilon))}°"


def at_most_mm(metres: float) -> str:
    """Returns an upper bound, given in metres, as a text in millimetres that is rounded up."""
    return f"{_plain(rounded_up(metres, times=1000))} mm"


def _plain(decimal: str) -> str:
    """Returns a large decimal without an exponent, which nobody reads in a distance."""
    return f"{Decimal(decimal):f}" if "e+" in decimal else decimal


def exactly(x: float) -> str:
    """Returns the shortest decimal that is read back as this double."""
    return repr(float(x) + 0.0)  # no sign of a zero
