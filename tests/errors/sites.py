"""Reads from the source every place that makes an error, with what it says as templates: ``{name}`` stands for what is filled in."""

from __future__ import annotations

import ast
import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from certifier.errors import CirisError
from tests.rooms import ROOMS

ROOT = Path(__file__).parents[2]
ERRORS = ("CirisError", "SceneError", "RegionError", "ProofError")
MAKERS = {
    ("certifier/document.py", "refuse"): 0,
    ("certifier/proof", "refuse"): 0,
    ("certifier/scene/directives.py", "_refuse"): 2,
    ("certifier/scene/file.py", "_wrong"): 1,
    ("certifier/scene/formats", "refuse"): 1,
    ("certifier/scene/expansion.py", "_refuse"): 1,
    ("certifier/scene/meshes", "refuse"): 1,
    ("certifier/scene/meshes/dae.py", "_refuse"): 1,
    ("certifier/scene/strict.py", "_refuse"): 2,
    ("certifier/seeding/options.py", "_refuse"): 1,
}
"""Functions that make an error of a message that their callers give: where they are, and which argument it is. Their callers count."""
OPAQUE = "..."
HOLE = re.compile(r"\{[\w.]+\}")


@dataclass(frozen=True, order=True)
class Site:
    """A place that makes an error. What only its callers know is None."""

    module: str
    line: int
    function: str
    message: str
    code: str | None = None
    where: str | None = None
    hint: str | None = None

    @property
    def words(self) -> int:
        """The length of what the message and the hint always say."""
        return len(HOLE.sub("", self.message + (self.hint or "")))

    def makes(self, error: CirisError) -> bool:
        """Says whether an error reads as those of this place do; what stands before the message names a file and a line."""
        pairs = ((self.code, error.code), (self.where, error.field or ""), (self.hint, error.hint))
        rest = all(template is None or _pattern(template).fullmatch(text) for template, text in pairs)
        return rest and _pattern(self.message, "(.* )?").fullmatch(error.message) is not None


@cache
def _pattern(template: str, before: str = "") -> re.Pattern[str]:
    return re.compile(before + ".*".join(map(re.escape, HOLE.split(template))), re.DOTALL)


@cache
def sites() -> tuple[Site, ...]:
    """Returns every site of the program."""
    found: list[Site] = []
    for room in ROOMS:
        for path in sorted((ROOT / room).rglob("*.py")):
            module = path.relative_to(ROOT).as_posix()
            makers = {name: index for (place, name), index in MAKERS.items() if module.startswith(place)}
            tree = ast.parse(path.read_text())
            found += _sites(module, tree, makers, _assigned(tree), "")
    return tuple(found)


def _sites(module: str, node: ast.AST, makers: dict[str, int], names: dict[str, list[ast.expr]], around: str) -> Iterator[Site]:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from _sites(module, child, makers, {**names, **_assigned(child)}, child.name)
            continue
        if isinstance(child, ast.Call):
            yield from _said(module, child, makers, names, around)
        yield from _sites(module, child, makers, names, around)


def _assigned(function: ast.AST) -> dict[str, list[ast.expr]]:
    """Returns what a function, or a module outside of functions, assigns to plain names."""
    found: dict[str, list[ast.expr]] = {}
    for node in function.body if isinstance(function, ast.Module) else ast.walk(function):
        if isinstance(node, ast.Assign):
            for target in node.targets:
                both = isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
                pairs = zip(target.elts, node.value.elts, strict=False) if both else [(target, node.value)]
                for name, value in pairs:
                    if isinstance(name, ast.Name):
                        found.setdefault(name.id, []).append(value)
    return found


def _said(module: str, call: ast.Call, makers: dict[str, int], names: dict[str, list[ast.expr]], around: str) -> Iterator[Site]:
    called = call.func.id if isinstance(call.func, ast.Name) else call.func.attr if isinstance(call.func, ast.Attribute) else ""
    keywords = {keyword.arg: keyword.value for keyword in call.keywords}
    by_super = called == "__init__" and len(call.args) == 2 and isinstance(call.args[0], ast.Constant)
    if (called in ERRORS or by_super) and around not in makers:
        code, message = call.args
        parts = [code, keywords.get("field", ast.Constant("")), keywords.get("hint", ast.Constant(""))]
        for texts in itertools.product(_texts(message, names), *(_texts(part, names) for part in parts)):
            yield Site(module, call.lineno, around, texts[0], *(None if text == f"{{{OPAQUE}}}" else text for text in texts[1:]))
    elif called in makers and len(call.args) > makers[called]:
        hints = _texts(keywords["hint"], names) if "hint" in keywords else [None]
        for message_text, hint in itertools.product(_texts(call.args[makers[called]], names), hints):
            yield Site(module, call.lineno, around, message_text, hint=None if hint == f"{{{OPAQUE}}}" else hint)


def _texts(value: ast.expr, names: dict[str, list[ast.expr]]) -> list[str]:
    """Returns what an expression may be as a text."""
    match value:
        case ast.Constant(value=None):
            return [""]
        case ast.Constant():
            return [str(value.value)]
        case ast.JoinedStr():
            return ["".join(_piece(piece) for piece in value.values)]
        case ast.IfExp():
            return [*_texts(value.body, names), *_texts(value.orelse, names)]
        case ast.BoolOp():
            return [text for option in value.values for text in _texts(option, names) if text]
        case ast.BinOp(op=ast.Add()):
            return [a + b for a in _texts(value.left, names) for b in _texts(value.right, names)]
        case ast.Name() if names.get(value.id):
            before = [assigned for assigned in names[value.id] if assigned.lineno <= value.lineno]
            return _texts(max(before, key=lambda a: a.lineno), {**names, value.id: []}) if before else [f"{{{OPAQUE}}}"]
        case _:
            return [f"{{{OPAQUE}}}"]


def _piece(piece: ast.expr) -> str:
    if isinstance(piece, ast.Constant):
        return str(piece.value)
    assert isinstance(piece, ast.FormattedValue)
    inner = piece.value
    name = inner.id if isinstance(inner, ast.Name) else inner.attr if isinstance(inner, ast.Attribute) else OPAQUE
    return f"{{{name}}}"
