"""The padding that a request adds around every body."""

from __future__ import annotations

from certifier.errors import RegionError
from certifier.proof import limits


def padding_of(value: float) -> float:
    """Returns the padding of a request, in metres.

    Raises:
        RegionError: ``padding``, for what is no distance.
    """
    if not 0 <= value <= limits.MAGNITUDE:
        raise RegionError("padding", f"must be from 0 to {limits.MAGNITUDE:g} metres, not {value!r}", field="padding")
    return float(value)
