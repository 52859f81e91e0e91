"""Counts and joint positions as sentences have them. Commands start without numpy, so nothing here needs it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def counted(count: int, of: str, many: str | None = None) -> str:
    """Returns a number with what it counts: ``1 region``, ``2 regions``.

    Args:
        many: the plural, where it does not only add an s.
    """
    return f"{count} {of if count == 1 else many or f'{of}s'}"


def unit_names(units: Iterable[str]) -> str:
    """Returns the units of a configuration, (n,), each of them once: ``rad``, ``m`` or ``rad and m``."""
    return " and ".join(sorted({*units}, reverse=True))


def joint_positions(q: Iterable[float], units: Iterable[str], digits: int = 6) -> str:
    """Returns a configuration, (n,), with its units (n,): as :func:`with_units`, to this number of significant digits."""
    return with_units([f"{x + 0.0:.{digits}g}" for x in q], [*units])


def with_units(texts: Sequence[str], units: Sequence[str]) -> str:
    """Returns joint positions, (n,) texts, with their units (n,): ``(0.4, 0.3) rad``, or ``(0.4 rad, 0.25 m)`` where they differ."""
    if len({*units}) == 1:
        return f"({', '.join(texts)}) {units[0]}"
    return f"({', '.join(f'{text} {unit}' for text, unit in zip(texts, units, strict=True))})"
