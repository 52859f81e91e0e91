"""Finds the ``ciris`` commands that texts name: documents, pages, messages, docstrings, templates, scripts."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
ROOMS = ("api", "benchmarks", "certifier", "ciris", "client", "dashboard", "db", "planner", "workers", "examples")
HOLE = "HOLE"
"""Stands for what is filled in."""

_CALLED = re.compile(r"(?<![\w./@<-])(?<!namespace )(?<!generic )(?<!way )(?:\.venv/bin/)?(?:ciris|python -m client\.cli) (?=\S)")
_END = re.compile(r"\s{2,}|[|;<>)]|&&|(?:^|\s)#|\s\\?$|,\s")
"""Where a command of a block of code ends: before a remark, another command or where its output goes."""
_PROSE_END = re.compile(r"[`|;<>),:]|&&|\.(?:\s|$)|\s(?:and|or|then|in|of|as|to)\s")
_OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")
_OPTIONS = re.compile(r"\s(?=\[|-)")
_SUBSTITUTED = re.compile(r"\s\"?\$\(.*")
_SPAN = re.compile(r"``?([^`]+?)``?(?!`)", re.DOTALL)


@dataclass(frozen=True)
class Mention:
    """A command that a text names.

    Attributes:
        where: file and line.
        words: what follows ``ciris``.
        whole: the text shows the command as one types it, with all that it needs.
        exact: nothing but the command is in ``words``; otherwise words of the sentence may follow it.
        otherwise: what the text may name instead: a command of its own, and not another one of the group before; may be empty.
    """

    where: str
    words: str
    whole: bool = False
    exact: bool = True
    otherwise: str = ""


def mentions() -> list[Mention]:
    """Returns every mention in the repository's documents, sources, pages, scripts and deployments."""
    found: list[Mention] = []
    made = ROOT / "docs" / "commands.md"  # from the parser itself
    for path in [*ROOT.glob("*.md"), *(set(ROOT.glob("docs/*.md")) - {made}), *ROOT.glob("examples/**/*.md"), *ROOT.glob("deploy/**/*.md")]:
        if path.name != "CHANGELOG.md":
            found += of_markdown(_name(path), path.read_text())
    for room in ROOMS:
        for path in sorted((ROOT / room).rglob("*.py")):
            found += of_python(_name(path), path.read_text())
    pages = [*ROOT.glob("dashboard/templates/*.html"), *ROOT.glob("dashboard/source/**/*.ts*")]
    scripts = [ROOT / name for name in ("start", "check", "requirements/install", "requirements/refresh", ".ci/run")]
    deployed = [ROOT / "Dockerfile", ROOT / "docker-compose.yml", *ROOT.glob("deploy/**/*.y*ml"), *ROOT.glob("examples/**/*.y*ml")]
    for path in (*pages, *scripts, *deployed):
        found += of_text(_name(path), path.read_text())
    return found


def options() -> list[tuple[str, str]]:
    """Returns the options that strings of the sources and spans of the documents name, with where they do.

    Those of other programs are left out: Celery's, and those of the programs in benchmarks/ and examples/.
    """
    found = []
    for room in set(ROOMS) - {"benchmarks", "examples"}:
        for path in sorted((ROOT / room).rglob("*.py")):
            strings = [
                node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Constant) and isinstance(node.value, str)
            ]
            if _name(path) != "workers/__main__.py":
                found += [(f"{_name(path)}:{node.lineno}", option) for node in strings for option in _OPTION.findall(node.value)]
    for path in [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *ROOT.glob("docs/*.md")]:
        spans = (span for line in path.read_text().splitlines() if not line.startswith("    ") for span in _SPAN.findall(line))
        found += [(_name(path), option) for span in spans if span.startswith(("--", "[--")) for option in _OPTION.findall(span)]
    return found


def of_markdown(name: str, text: str) -> Iterator[Mention]:
    """Yields the commands of spans and of blocks of code, indented or fenced."""
    prose: list[str] = []
    fenced = None
    lines = text.splitlines()
    for number, line in enumerate(lines, 1):
        if line.lstrip().startswith("```"):
            fenced = None if fenced is not None else line.strip().removeprefix("```")
            prose.append("")
        elif fenced is not None or line.startswith("    "):
            prose.append("")
            if fenced in (None, "", "sh", "bash", "console", "shell"):
                while line.endswith("\\"):
                    line = line[:-1] + lines[number].strip()
                    number += 1
                for call in _CALLED.finditer(line):
                    remark = re.search(r"\S\s{2,}\S", line[: call.start()]) is not None
                    words = _END.split(_SUBSTITUTED.sub(f" {HOLE}", line[call.end() :]), maxsplit=1)[0]
                    yield Mention(f"{name}:{number}", words, whole=not remark, exact=not remark)
        else:
            prose.append(line)
    yield from _rows(name, lines)
    joined = "\n".join(prose)
    yield from _spans(name, joined)
    yield from _sentences(name, _SPAN.sub(lambda span: re.sub(r"[^\n]", " ", span.group()), joined))


def of_python(name: str, text: str) -> Iterator[Mention]:
    """Yields the commands in the strings of a module; what an f-string fills in is a hole."""
    inside: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.JoinedStr):
            inside |= {id(piece) for piece in node.values}
            said = "".join(str(piece.value) if isinstance(piece, ast.Constant) else HOLE for piece in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in inside:
            said = node.value
        else:
            continue
        yield from of_text(f"{name}:{node.lineno}", said)


def of_text(where: str, text: str) -> Iterator[Mention]:
    """Yields the commands of any other text: in spans of code or in elements of it, and in sentences."""
    text = re.sub(r"\$?\{\{?[^{}]*\}\}?", HOLE, text)
    elements = re.compile(r"<code>([^<]+)</code>")
    for element in elements.finditer(text):
        yield from _called(where, element.group(1), exact=True)
    text = elements.sub(" ", text)
    yield from _spans(where, text)
    yield from _sentences(where, _SPAN.sub(" ", text))


def _rows(name: str, lines: list[str]) -> Iterator[Mention]:
    """Yields what the first cells of a table's rows name besides: other commands of a group, and more options of the row before."""
    command = ""
    for number, line in enumerate(lines, 1):
        cell = re.split(r"(?<!\\)\|", line)[1].strip() if line.startswith("|") and line.count("|") > 2 else ""
        command = command if cell.startswith("...") else ""
        spans = _SPAN.findall(cell)
        for span in spans:
            if span.startswith("ciris "):
                command = span.removeprefix("ciris ")
            elif command and span.startswith(("--", "[--")):
                yield Mention(f"{name}:{number}", f"{_OPTIONS.split(command)[0]} {span}")
            elif command and re.match(r"[a-z]+( |$)", span):
                yield Mention(f"{name}:{number}", f"{command.split()[0]} {span}", otherwise=span)


def _spans(where: str, text: str) -> Iterator[Mention]:
    for span in _SPAN.finditer(text):
        yield from _called(f"{where}:{text.count(chr(10), 0, span.start()) + 1}" if ":" not in where else where, span.group(1), exact=True)


def _called(where: str, code: str, exact: bool) -> Iterator[Mention]:
    code = " ".join(code.split())
    call = _CALLED.match(code)
    if call:
        yield Mention(where, _END.split(re.sub(r"(?<=\w)\\?\|(?=\w)", "/", code[call.end() :]), maxsplit=1)[0], exact=exact)


def _sentences(where: str, text: str) -> Iterator[Mention]:
    for call in _CALLED.finditer(text):
        rest = _PROSE_END.split(" ".join(text[call.end() :].split())[:200], maxsplit=1)[0]
        yield Mention(f"{where}:{text.count(chr(10), 0, call.start()) + 1}" if ":" not in where else where, rest, exact=False)


def _name(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()
