"""``python -m tests.ciris.twin`` writes ``ciris/synchronous`` from ``ciris/asynchronous``: the same methods, without async and await."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCE, TWIN = ROOT / "ciris" / "asynchronous", ROOT / "ciris" / "synchronous"
RULES = [
    (r"\basync (def|for|with)\b", r"\1"),
    (r"\(await (self\.\w+\((?:[^()]|\([^()]*\))*\))\)", r"\1"),
    (r"\bawait ", ""),
    (r"\bAsync([A-Z])", r"\1"),
    (r"\basyncio\b", "time"),
    (r"__a(enter|exit)__", r"__\1__"),
    (r"\ba(close|read|iter_lines)\b", r"\1"),
    (r"\bhandle_async_request\b", "handle_request"),
    (r" The module of this name in ``ciris.synchronous`` is made from this one\.", " It is made from the one in ``ciris.asynchronous``."),
    (r"\bciris\.asynchronous\.", "ciris.synchronous."),
]


def twin(source: str) -> str:
    """Returns the synchronous twin of an asynchronous module."""
    for pattern, replacement in RULES:
        source = re.sub(pattern, replacement, source)
    return formatted(source)


def formatted(source: str) -> str:
    """Returns a module formatted as the project's are."""
    for command in (["check", "--select", "I,UP", "--fix-only", "--quiet"], ["format"]):
        arguments = ["ruff", *command, "--stdin-filename", str(TWIN / "twin.py"), "-"]
        source = subprocess.run(arguments, input=source, capture_output=True, text=True, check=True, cwd=ROOT).stdout
    return source


def twins() -> dict[Path, str]:
    """Returns what has to be in ``ciris/synchronous``."""
    return {TWIN / path.name: twin(path.read_text()) for path in sorted(SOURCE.glob("*.py"))}


if __name__ == "__main__":
    for path, text in twins().items():
        path.write_text(text)
