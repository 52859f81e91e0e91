"""``python -m tests.docs.prose [FILE ...]`` lists words that readers have to read twice, with what to write instead (prose.toml)."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tests.rooms import ROOMS

ROOT = Path(__file__).parents[2]
PATTERNS = tomllib.loads(Path(__file__).with_name("prose.toml").read_text())["pattern"]
NOT_READ = {"docs/trials.md"}
"""A log, which readers do not need."""

_FOUND = [(re.compile(rf"(?<![\w-])(?:{pattern['find'].replace(' ', chr(92) + 's+')})\b", re.IGNORECASE), pattern) for pattern in PATTERNS]
_CODE = re.compile(r"```.*?^\s*```|^(?: {4}|\t)(?![-*\d]).*?$|`[^`\n]*`|\]\([^)\n]*\)", re.MULTILINE | re.DOTALL)
_COMMENT = re.compile(r"/\*.*?\*/|(?<![:\"'])//[^\n]*|\{#.*?#\}", re.DOTALL)


@dataclass(frozen=True)
class Finding:
    """Words at a line of a file, and what to write instead."""

    line: int
    words: str
    write: str


def findings(path: Path) -> list[Finding]:
    """Returns what is found in a file, in the order of its lines."""
    found = []
    for line, text in texts(path):
        for pattern, about in _FOUND:
            for match in pattern.finditer(text):
                found.append(Finding(line + text.count("\n", 0, match.start()), " ".join(match[0].split()), about["write"]))
    return sorted(found, key=lambda one: one.line)


def texts(path: Path) -> Iterator[tuple[int, str]]:
    """Yields what people read of a file: its prose, or the strings and docstrings of a program, each with its first line."""
    content = path.read_text()
    if path.suffix == ".py":
        for node in ast.walk(ast.parse(content)):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield node.lineno, node.value
    elif path.suffix == ".md":
        if path.name == "CHANGELOG.md":
            content = newest(content)
        yield 1, _CODE.sub(_blank, content)
    else:
        yield 1, _COMMENT.sub(_blank, content)


def newest(changelog: str) -> str:
    """Returns a changelog up to its second version."""
    return "\n## ".join(changelog.split("\n## ")[:2])


def _blank(match: re.Match[str]) -> str:
    return "." + "\n" * match[0].count("\n")


def files() -> list[Path]:
    """Returns the files that users and developers read."""
    prose = [*(ROOT / "docs").glob("*.md"), *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md"))]
    pages = [*(ROOT / "dashboard/templates").rglob("*.html"), *(ROOT / "dashboard/source").rglob("*.ts*")]
    programs = [path for package in (*ROOMS, "benchmarks") for path in (ROOT / package).rglob("*.py")]
    return sorted(path for path in (*prose, *pages, *programs) if path.relative_to(ROOT).as_posix() not in NOT_READ)


def said(paths: list[Path]) -> Iterator[str]:
    """Yields a line for each finding."""
    for path in paths:
        for one in findings(path):
            yield f"{path.relative_to(ROOT)}:{one.line}: {one.words}: write {one.write}"


if __name__ == "__main__":
    print("\n".join(said([ROOT / name for name in sys.argv[1:]] or files())))
