"""docs/commands.md says what the parser of the command says."""

from __future__ import annotations

from tests.docs.commands import PAGE, page


def test_the_page_of_commands_is_current() -> None:
    assert PAGE.read_text() == page(), "run python -m tests.docs.commands"
