"""``python -m tests.docs.commands`` writes docs/commands.md from the parser of the ``ciris`` command."""

from __future__ import annotations

import argparse
import re
import textwrap
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from client.arguments import EPILOG, parser

PAGE = Path(__file__).parents[2] / "docs" / "commands.md"
GROUPS = {
    "The service": ("up", "doctor", "db", "key", "project", "worker"),
    "Scenes": ("scene",),
    "Regions": ("grow", "map", "free-set", "cover", "recertify", "certify", "region"),
    "Jobs": ("job",),
    "Motions and planning": ("plan", "path", "certify-path", "contains", "nearest", "graph"),
    "Proofs and measurements": ("verify", "clearance", "bench"),
}
MANY = 4
"""Arguments that this number of commands have in the same words are described once."""
LEAD = """\
# Commands

This page lists every command and option of `ciris`. `ciris COMMAND --help` prints the same. Do not
edit this page by hand: `python -m tests.docs.commands` makes it from the parser of the command.
"""


def page() -> str:
    """Returns the text of docs/commands.md."""
    top = parser()
    verbs = dict(commands(top))
    grouped = [verb for group in GROUPS.values() for verb in group]
    if sorted(grouped) != sorted(verbs):
        raise SystemExit(f"GROUPS of {Path(__file__).name} and the commands differ: {sorted({*grouped} ^ {*verbs})}")
    shared = common([command for verb in grouped for _, command in leaves(*verbs[verb])])
    parts = [LEAD, index(top)]
    for title, members in GROUPS.items():
        parts.append(f"## {title}\n")
        for verb in members:
            parts += [section(command, about, shared) for about, command in leaves(*verbs[verb])]
    rows = [f"| `{name}` | {escaped(text)} |" for name, text in shared.items()]
    parts.append("\n".join(["## Arguments of many commands\n", "| argument | what it is |", "|---|---|", *rows, ""]))
    parts.append(f"## Exit status and output\n\n{paragraphs(EPILOG)}")
    return "\n".join(parts)


def index(top: argparse.ArgumentParser) -> str:
    """Returns a table of all commands."""
    verbs = dict(commands(top))
    found = [one for group in GROUPS.values() for verb in group for one in leaves(*verbs[verb])]
    rows = [f"| [`{command.prog}`](#{command.prog.replace(' ', '-')}) | {escaped(about)} |" for about, command in found]
    return "\n".join(["| command | what it does |", "|---|---|", *rows, ""])


def common(among: list[argparse.ArgumentParser]) -> dict[str, str]:
    """Returns the arguments that MANY commands have in the same words: as they are typed, with their help texts."""
    found = Counter((written(action), help_of(action)) for command in among for action in command._actions if action.dest != "help")
    return dict(argument for argument, count in found.items() if count >= MANY)


def commands(of: argparse.ArgumentParser) -> Iterator[tuple[str, tuple[str, argparse.ArgumentParser]]]:
    """Yields the name, the help text and the parser of each command below a parser."""
    for action in of._actions:
        if isinstance(action, argparse._SubParsersAction):
            words = {choice.dest: choice.help or "" for choice in action._choices_actions}
            for name, command in action.choices.items():
                yield name, (words[name], command)


def leaves(about: str, command: argparse.ArgumentParser) -> list[tuple[str, argparse.ArgumentParser]]:
    """Returns the command with its help text, or those below it where it has some."""
    return [words for _, words in commands(command)] or [(about, command)]


def leaf(top: argparse.ArgumentParser, *names: str) -> argparse.ArgumentParser:
    for name in names:
        _, top = dict(commands(top))[name]
    return top


def section(command: argparse.ArgumentParser, about: str, shared: dict[str, str]) -> str:
    """Returns what the page says about one command. Of the ``shared`` arguments it has the names."""
    arguments = [action for action in command._actions if action.dest != "help"]
    positional = [action for action in arguments if not action.option_strings]
    options = [action for action in arguments if action.option_strings]
    own = [action for action in (*positional, *options) if shared.get(written(action)) != help_of(action)]
    others = [f"`{written(action).split()[0]}`" for action in (*positional, *options) if action not in own]
    needed = [*map(written, positional), *(written(option) for option in options if option.required)]
    rest = ["[OPTIONS]"] if any(not option.required for option in options) else []
    lines = [f"### `{command.prog}`\n", f"    {' '.join([command.prog, *needed, *rest])}\n", f"{sentence(about)}\n"]
    if command.epilog:
        lines.append(paragraphs(re.sub(r"(Example: )(ciris .*?)(\. |$)", r"\1`\2`\3", command.epilog)))
    if own:
        lines += ["| argument | what it is |", "|---|---|"]
        lines += [f"| `{escaped(written(action))}` | {escaped(help_of(action))} |" for action in own]
        lines.append("")
    if others:
        lines.append(paragraphs(f"{'Also' if own else 'It takes'} [{', '.join(others)}](#arguments-of-many-commands)"))
    return "\n".join(lines)


def written(action: argparse.Action) -> str:
    """Returns an argument as it is typed, such as ``--scope {read,submit,admin}``, ``[REGION]`` or ``SCENE``."""
    value = f"{{{','.join(map(str, action.choices))}}}" if action.choices else action.metavar or action.dest.upper()
    if not action.option_strings:
        return {argparse.REMAINDER: "...", "?": f"[{value}]"}.get(str(action.nargs), str(value))
    return " ".join([action.option_strings[-1], *([str(value)] if action.nargs != 0 else [])])


def help_of(action: argparse.Action) -> str:
    """Returns the help text of an argument.

    Raises:
        SystemExit: it has none.
    """
    if not action.help:
        raise SystemExit(f"{action.dest}: write a help text in client/arguments")
    return action.help.replace("%%", "%")


def paragraphs(text: str) -> str:
    """Returns a text as sentences, in lines as long as those of the other pages."""
    return "\n\n".join(textwrap.fill(sentence(part), 100) for part in text.split("\n\n")) + "\n"


def sentence(words: str) -> str:
    return f"{words[0].upper()}{words[1:].rstrip('.')}."


def escaped(cell: str) -> str:
    return cell.replace("|", "\\|")


if __name__ == "__main__":
    PAGE.write_text(page())
