"""Named configurations: what their names may be, and which joint positions a text of names stands for.

A named configuration says where some joints are. Several names, with commas between them, say it for more joints. No joint gets a position
that nobody has said: ``q_star`` in the list gives those of q* to the joints that the other names leave open.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from certifier.errors import RegionError, close_matches
from certifier.names import is_name

Configurations = Mapping[str, Mapping[str, float]]
"""The positions of joints by their full names, radians or metres, by the name of the configuration."""
Q_STAR = "q_star"
"""This name stands for q* of the joints that the other names leave open. No configuration may have it."""
SAME = 1e-9
"""Two names agree about a joint if their positions differ by at most this, in radians or metres."""
_HINT = "`ciris scene show` and `scene check` list the named configurations"


def is_configuration_name(text: object) -> bool:
    """Returns whether a configuration may have this name: as :func:`certifier.names.is_name`, without commas, and neither a number nor
    ``q_star``."""
    return is_name(text) and "," not in str(text) and text != Q_STAR and not is_number(str(text))


def is_number(text: str) -> bool:
    """Returns whether the text is a number as data files write it, in ASCII and without ``_``; NaN and infinity count."""
    if not text.isascii() or "_" in text:
        return False
    try:
        float(text)
    except ValueError:
        return False
    return True


def is_known(text: str, configurations: Configurations) -> bool:
    """Returns whether each name of a text stands for a configuration, or may stand for several."""
    return all(name == Q_STAR or _fitting(name, configurations) for name in _names(text))


def positions(
    text: str, configurations: Configurations, joints: Sequence[str], q_star: Sequence[float], field: str | None = None
) -> list[float]:
    """Returns the positions, (n,) in radians or metres, that a text of names such as ``left_home,right_home`` stands for.

    A name is that of a configuration, or its last parts, such as ``home`` for ``arm/manipulator/home``, where no other ends like this.

    Args:
        joints: full names of the n joints, in position order.
        q_star: (n,) their q*.
        field: where the user gave the text, for errors.

    Raises:
        RegionError: ``unknown_configuration``; ``configuration`` where names disagree about a joint, or leave one open.
    """
    found: dict[str, tuple[float, str]] = {}
    for name in _names(text):
        for joint, value in {} if name == Q_STAR else configurations[_full(name, configurations, field)].items():
            before, other = found.setdefault(joint, (value, name))
            if abs(before - value) > SAME:
                message = f"{other!r} has joint {joint} at {before:.9g}, and {name!r} at {value:.9g}"
                raise RegionError("configuration", message, field=field, hint="leave one of the names out")
    if Q_STAR in _names(text):
        found |= {joint: (centre, Q_STAR) for joint, centre in zip(joints, q_star, strict=True) if joint not in found}
    if missing := [joint for joint in joints if joint not in found]:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        message = f"{text[:200]!r} does not say where {', '.join(missing[:3])}{more} {'are' if missing[1:] else 'is'}"
        hint = f"join names by commas, as in home,open; {text.strip()[:200]},{Q_STAR} takes q* for these"
        raise RegionError("configuration", message, field=field, hint=hint)
    return [found[joint][0] for joint in joints]


def _names(text: str) -> list[str]:
    return [part.strip() for part in text.split(",")]


def _fitting(name: str, configurations: Configurations) -> list[str]:
    return [name] if name in configurations else [full for full in configurations if full.endswith(f"/{name}") and name]


def _full(name: str, configurations: Configurations, field: str | None) -> str:
    """Returns the full name of a configuration.

    Raises:
        RegionError: ``unknown_configuration``.
    """
    fitting = _fitting(name, configurations)
    if len(fitting) == 1:
        return fitting[0]
    if fitting:
        message = f"{name!r} may be {' or '.join(fitting[:5])}"
        raise RegionError("unknown_configuration", message, field=field, hint="write more of the name")
    hint = close_matches(name, list(configurations)) or (_HINT if configurations else "give joint positions; the scene names none")
    raise RegionError("unknown_configuration", f"the scene has no configuration {name[:200]!r}", field=field, hint=hint)
