"""The service's fixtures, and the command as users run it: in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from certifier.model import Scene
from certifier.scene import load_scene
from client.cli import main
from tests.api.conftest import busy, certified, client, database, environment, region, scene, url, worker

__all__ = ["busy", "certified", "client", "database", "environment", "region", "scene", "url", "worker"]

ROOT = Path(__file__).parents[2]
PLANAR = ROOT / "examples" / "planar_2dof" / "scene.yaml"


@dataclass(frozen=True)
class Done:
    """What a command did; its output is bytes where it may be a file."""

    status: int
    raw: bytes
    stderr: str

    @property
    def stdout(self) -> str:
        return self.raw.decode()

    @property
    def json(self) -> Any:
        return json.loads(self.raw)

    @property
    def error(self) -> str:
        """The one line on standard error."""
        (line,) = self.stderr.splitlines()
        assert line.startswith("error: ")
        return line.removeprefix("error: ")


Ciris = Callable[..., Done]


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "client.cli", *map(str, arguments)]


def surroundings(**variables: str) -> dict[str, str]:
    """The environment of a command that finds no service but the one it is told."""
    clean = {name: value for name, value in os.environ.items() if not name.startswith(("CIRIS_", "XDG_"))}
    return {**clean, "PYTHONPATH": str(ROOT), **variables}


@pytest.fixture
def spawn(tmp_path: Path) -> Ciris:
    """Runs ``ciris ARGUMENTS`` as a process in ``tmp_path``; keywords are environment variables."""

    def run(*arguments: object, **variables: str) -> Done:
        environment = surroundings(CIRIS_DATA_DIR=str(tmp_path / "data"), **variables)
        done = subprocess.run(command(*arguments), cwd=tmp_path, env=environment, capture_output=True, timeout=120, check=False)
        return Done(done.returncode, done.stdout, done.stderr.decode())

    return run


@pytest.fixture
def ciris(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsysbinary: pytest.CaptureFixture[bytes]) -> Ciris:
    """The same as ``spawn`` in this process, which is quicker."""
    monkeypatch.chdir(tmp_path)
    for name in os.environ:
        if name.startswith(("CIRIS_", "XDG_")):
            monkeypatch.delenv(name)
    monkeypatch.setenv("CIRIS_DATA_DIR", str(tmp_path / "data"))

    def run(*arguments: object, **variables: str) -> Done:
        for name, value in variables.items():
            monkeypatch.setenv(name, value)
        capsysbinary.readouterr()
        try:
            status = main([str(argument) for argument in arguments])
        except SystemExit as end:
            status = int(end.code or 0)
        out, error = capsysbinary.readouterr()
        return Done(status, out, error.decode())

    return run


@pytest.fixture(scope="session")
def planar() -> Scene:
    return load_scene(PLANAR)


@pytest.fixture
def parsed_once(planar: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scene files of the planar arm are not parsed again; all others are."""

    def load(path: str) -> Scene:
        return planar if Path(path) == PLANAR else load_scene(path)

    monkeypatch.setattr("certifier.scene.load_scene", load)
