"""The files of docs/scenes.md are written as they stand there, and its commands grow regions of them."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from tests.client.conftest import ROOT, Ciris

DOCUMENT = (ROOT / "docs" / "scenes.md").read_text()
FILES = dict(re.findall(r"^```(?:xml|yaml)\n((?:<!--|#) (?P<name>\S+\.\w+)[^\n]*\n.*?)^```$", DOCUMENT, re.MULTILINE | re.DOTALL))
GROWN = re.findall(r"^    ciris (grow \S+\.yaml --q .*)$", DOCUMENT, re.MULTILINE)


def test_every_documented_scene_is_grown() -> None:
    assert sorted(command.split()[1] for command in GROWN) == sorted(name for name in FILES.values() if name.endswith(".yaml"))


def is_long(command: str) -> bool:
    return "two_arms" in command or "mobile" in command


@pytest.mark.parametrize("command", [pytest.param(text, marks=pytest.mark.slow) if is_long(text) else text for text in GROWN])
def test_a_documented_scene_has_a_verified_region(command: str, ciris: Ciris, tmp_path: Path) -> None:
    for text, name in FILES.items():
        (tmp_path / name).write_text(text)
    grow, scene, *options = shlex.split(command)
    checked = ciris("scene", "check", scene, *options[:2])
    assert checked.status == 0, checked.stdout
    assert "overlap" not in checked.stdout
    done = ciris(grow, scene, *options, "--out", tmp_path / "region.proof")
    assert done.status == 0, done.stderr
    assert ciris("verify", tmp_path / "region.proof").status == 0
