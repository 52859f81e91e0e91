"""``python -m tests.ciris.options`` writes ``ciris/options.py`` from the tables of options (certifier.options)."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from certifier.options import Option, Takes
from client.options import CERTIFY, COVER, GROW, JOB, MAP, RECERTIFY, Part
from tests.ciris.twin import ROOT, formatted

MODULE = ROOT / "ciris" / "options.py"
HEAD = '''"""Options of jobs. This module is made from the tables of options: ``python -m tests.ciris.options``.

The service has a default for each. A mapping says of each option in which field of the request it is, and what it takes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, TypeAlias, TypedDict

from numpy.typing import ArrayLike

Fields: TypeAlias = "Mapping[str, tuple[str, str | Fields]]"
'''
KINDS = {"job": JOB, "grow": GROW, "cover": COVER, "map": MAP, "certify": CERTIFY, "recertify": RECERTIFY}
TYPES = {
    Takes.WHOLE: "int",
    Takes.REAL: "float",
    Takes.FLAG: "bool",
    Takes.POINT: "ArrayLike",
    Takes.POINTS: "ArrayLike",
    Takes.PATHS: "Sequence[ArrayLike]",
    Takes.LABELS: "Mapping[str, str]",
}
SHAPES = {Takes.POINT: "(n,). ", Takes.POINTS: "(n,) or (k, n). ", Takes.PATHS: "(k, n) each. "}


def module(kinds: Mapping[str, tuple[Part, ...]] = KINDS) -> str:
    """Returns the text of the module."""
    return formatted("\n".join([HEAD, *(line for kind, parts in kinds.items() for line in _kind(kind, parts))]))


def _kind(kind: str, parts: Sequence[Part]) -> Iterator[str]:
    own = [part for part in parts if kind == "job" or part not in JOB]
    for part in own:
        for one in part.options:
            if one.takes is Takes.GROUP:
                yield from _typed(_type(one), "TypedDict", one.text, [part.group(one)])
    if kind == "job":
        yield from _typed("JobOptions", "TypedDict", "Options of all jobs.", own)
    else:
        yield from _typed(f"{kind.capitalize()}Options", "JobOptions", f"Options of jobs of the kind `{kind}`.", own)
    yield f"{kind.upper()}: Fields = {_fields(own, '' if kind == 'job' else '**JOB, ')}"


def _typed(name: str, base: str, about: str, parts: Sequence[Part]) -> Iterator[str]:
    yield f"class {name}({base}, total=False):"
    yield _quoted(about.replace("`", "``"))
    for part in parts:
        for one in part.options:
            yield f"    {one.python}: {_type(one)}"
            yield _quoted(f"{SHAPES.get(one.takes, '')}{one.explained}".replace("`", "``"))


def _type(one: Option) -> str:
    if one.takes is Takes.CHOICE:
        return f"Literal[{', '.join(map(repr, one.choices))}]"
    return one.cls.__name__ if one.takes is Takes.GROUP and one.cls else TYPES[one.takes]


def _quoted(text: str) -> str:
    lines = textwrap.wrap(text, 130)
    return f'    """{lines[0]}"""' if len(lines) == 1 else "\n    ".join([f'    """{lines[0]}', *lines[1:], '"""'])


def _fields(parts: Sequence[Part], above: str = "") -> str:
    found = (f"{one.python!r}: ({part.field(one)!r}, {_takes(one, part)})" for part in parts for one in part.options)
    return f"{{{above}{', '.join(found)}}}"


def _takes(one: Option, part: Part) -> str:
    return _fields([replace(part.group(one), place="")]) if one.takes is Takes.GROUP else repr(str(one.takes))


if __name__ == "__main__":
    MODULE.write_text(module())
