"""Writes the table of docs/scenes.md of what is read of MJCF: ``python -m tests.certifier.scene.mjcf_table``."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from certifier.scene.formats.mjcf_names import ELEMENTS, Known

DOC = Path(__file__).parents[3] / "docs" / "scenes.md"
HEAD = "| element of MJCF | read | makes no difference here | refused |\n|---|---|---|---|\n"


def table() -> str:
    """Returns the table in Markdown."""
    return HEAD + "".join(f"| `<{name}>` | {_read(known)} | {_unused(known)} | {_refused(known)} |\n" for name, known in ELEMENTS.items())


def write() -> None:
    text = DOC.read_text()
    DOC.write_text(re.sub(re.escape(HEAD) + r"(\|.*\n)*", lambda _: table(), text))


def _read(known: Known) -> str:
    return _listed(known.read, (f"<{name}>" for name in known.elements))


def _unused(known: Known) -> str:
    return _listed(known.unused, (f"<{name}>" for name in known.skipped))


def _refused(known: Known) -> str:
    reasons = {**known.refused, **{f"<{name}>": why for name, why in known.refused_elements.items()}}
    reasons |= {f"<{name}>": why for name, why in known.partly.items()}
    by_reason: dict[str, list[str]] = {}
    for name, why in reasons.items():
        by_reason.setdefault(why, []).append(f"`{name}`")
    return "; ".join(f"{', '.join(names)}: {why}" for why, names in by_reason.items())


def _listed(attributes: Iterable[str], elements: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in (*sorted(attributes), *sorted(elements)))


if __name__ == "__main__":
    write()
