"""Every ``ciris`` command that a document, a page, a message or a docstring names exists, with its subcommand and its options."""

from __future__ import annotations

import argparse
import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import replace

import pytest

from benchmarks import __main__ as benchmarks
from client.arguments import parser
from tests.client.mentions import HOLE, Mention, mentions, of_markdown, of_python, of_text, options

PARSER: argparse.ArgumentParser = parser()
BENCHMARKS = benchmarks._parser()
OTHERS = {"--once": "of ./start", "--background": "of `python -m workers`"}
"""Options of other programs that messages name, and whose they are."""
PROSE = frozenset(
    (
        "adds",
        "and",
        "answers",
        "calls",
        "can",
        "certifies",
        "ciris",
        "client",
        "computes",
        "does",
        "drafts",
        "finds",
        "from",
        "grows",
        "has",
        "in",
        "is",
        "knows",
        "looks",
        "makes",
        "on",
        "proposes",
        "proves",
        "reads",
        "refuses",
        "reports",
        "says",
        "service",
        "service?",
        "should",
        "takes",
        "this",
        "would",
        "writes",
    )
)
"""What sentences say after the program's name that is no command."""
SHOWN = re.compile(r"[A-Z_]+(?:\.\w+)?|\.\.\.")
"""A word that stands for something, as in ``ciris job COMMAND``."""


def wrong(mention: Mention) -> str | None:
    """Returns what of a command does not exist, or is missing where the command is shown as a whole; None where all is well."""
    text = mention.words.replace("[", " ").replace("]", " ").replace("\\", "")
    try:
        words = [word for word in shlex.split(text) if word != "..."]
    except ValueError:
        words = text.split()
    if not mention.exact and (not words or words[0] in PROSE):
        return None
    parser = PARSER
    while (group := _group(parser)) is not None and words and not words[0].startswith("-"):
        names = words.pop(0).split("/")
        if len(names) == 1 and (SHOWN.fullmatch(names[0]) or HOLE in names[0]):
            return None
        unknown = [name for name in names if name not in group.choices]
        if unknown:
            return f"there is no command {unknown[0]!r} among {', '.join(group.choices)}"
        parser = group.choices[names[0]]
    if parser.prog.endswith(" bench") and words:
        return _of_arguments(BENCHMARKS, words, mention) if words[0].islower() else None
    return _of_arguments(parser, words, mention)


def _of_arguments(parser: argparse.ArgumentParser, words: Sequence[str], mention: Mention) -> str | None:
    if (group := _group(parser)) is not None and words and not words[0].startswith("-"):
        names = words[0].split("/")
        unknown = [name for name in names if name not in group.choices]
        return f"there is no benchmark {unknown[0]!r}" if unknown else _of_arguments(group.choices[names[0]], words[1:], mention)
    left = iter(words)
    positionals = [action for action in parser._actions if not action.option_strings and not isinstance(action, argparse._SubParsersAction)]
    needed = {action.dest for action in parser._actions if action.required and not isinstance(action, argparse._SubParsersAction)}
    for word in left:
        option, equals, value = word.partition("=")
        if re.match(r"--?[a-zA-Z]", word):
            action = parser._option_string_actions.get(option)
            if action is None:
                return f"there is no option {option}"
            needed.discard(action.dest)
            given = value if equals else next(left, None) if action.nargs is None else None
        elif positionals:
            action, given = positionals[0], word
            needed.discard(action.dest)
            if action.nargs not in ("*", "+", argparse.REMAINDER):
                positionals.pop(0)
        elif mention.exact:
            return f"there is no place for {word!r}"
        else:
            return None
        if action.choices and given is not None and not SHOWN.fullmatch(given) and HOLE not in given:
            other = [one for one in re.split(r"[/|]", given) if one not in map(str, action.choices)]
            if other and mention.exact:
                return f"{action.dest} cannot be {other[0]!r}"
    return f"{', '.join(sorted(needed))} is missing" if mention.whole and needed else None


def _group(parser: argparse.ArgumentParser) -> argparse._SubParsersAction[argparse.ArgumentParser] | None:
    return next((action for action in parser._actions if isinstance(action, argparse._SubParsersAction)), None)


def refused_of(mention: Mention) -> str | None:
    problem = wrong(mention)
    return None if mention.otherwise and wrong(replace(mention, words=mention.otherwise)) is None else problem


def refused(found: Iterator[Mention] | list[Mention]) -> list[str]:
    return [f"{mention.where}: ciris {mention.words}: {problem}" for mention in found if (problem := refused_of(mention))]


def _options(parser: argparse.ArgumentParser) -> set[str]:
    group = _group(parser)
    return set(parser._option_string_actions).union(*(_options(one) for one in group.choices.values()) if group else ())


def test_every_option_that_a_message_or_a_document_names_exists() -> None:
    known = _options(PARSER) | _options(BENCHMARKS)
    found = options()
    assert len(found) > 100
    assert not [f"{where}: {option}" for where, option in found if option not in known and option not in OTHERS]


def test_every_command_that_is_named_exists() -> None:
    found = mentions()
    assert len(found) > 300
    assert not refused(found)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("wait with `ciris job watch 1f9b2a7c`", "no command 'watch'"),
        ("with `ciris grow SCENE --seed 3`", "no option --seed"),
        ("with ``ciris verfy FILE``", "no command 'verfy'"),
        ("then ciris scene chek {out}, then go", "no command 'chek'"),
        ("then ciris veryfy it", "no command 'veryfy'"),
        ("check it: ciris verify {path} --jsn)", "no option --jsn"),
        ("<code>ciris key add NAME --scop read</code>", "no option --scop"),
        ("<code>ciris key add NAME --scope write</code>", "cannot be 'write'"),
        ("`ciris region show ONE TWO`", "no place for 'TWO'"),
        ("`ciris bench growht`", "no benchmark 'growht'"),
        ("`ciris bench growth --agianst drake`", "no option --agianst"),
    ],
)
def test_a_command_that_does_not_exist_is_found(text: str, problem: str) -> None:
    for found in (of_text("a text", text), of_python("a.py", f"def f(out, path): return f{text!r}")):
        (said,) = refused(found)
        assert problem in said


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("First\n\n    ciris scene ad scene.yaml    adds it", "no command 'ad'"),
        ("First\n\n    .venv/bin/ciris grow --watch", "scene is missing"),
        ("```\n$ ciris plan S --from 0,0 \\\n    --too 1,1\n```", "no option --too"),
        ("```sh\nciris ls | ciris region ls\n```", "no command 'ls'"),
        ("| command | what |\n|---|---|\n| `ciris job ls`, `watch ID` | x |\n", "no command 'watch'"),
        ("| command | what |\n|---|---|\n| `ciris cover SCENE` | x |\n| ... `[--covrage 1]` | y |\n", "no option --covrage"),
        ("Read `ciris\njob watch` of it.", "no command 'watch'"),
    ],
)
def test_a_command_of_a_document_that_does_not_exist_is_found(text: str, problem: str) -> None:
    (said,) = refused(list(of_markdown("a.md", text)))
    assert problem in said


def test_what_is_no_command_is_left_alone() -> None:
    text = "ciris is a program, and ciris makes regions. `ciris job COMMAND`, `ciris grow ... --watch`, `import ciris`"
    assert not refused(list(of_markdown("a.md", text)))
