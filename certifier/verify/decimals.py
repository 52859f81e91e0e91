"""Bounds in print: decimals of a few digits on the safe side of a double, as a statement has to be true as it is read."""

from __future__ import annotations

from decimal import ROUND_CEILING, ROUND_FLOOR, Context


def rounded_down(x: float, digits: int = 3) -> str:
    """The largest decimal of so many significant digits that is no more than x, a finite number."""
    return f"{Context(digits, ROUND_FLOOR).create_decimal_from_float(x):g}"


def rounded_up(x: float, digits: int = 3) -> str:
    """The least decimal of so many significant digits that is no less than x, a finite number."""
    return f"{Context(digits, ROUND_CEILING).create_decimal_from_float(x):g}"


def exactly(x: float) -> str:
    """The shortest decimal that is read back as this double."""
    return repr(float(x))
