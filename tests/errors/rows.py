"""A row of the table of errors, and what its provocations need."""

from __future__ import annotations

import io
import json
import re
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from certifier.errors import CirisError
from certifier.model import Scene
from certifier.scene import load_bundle, load_scene, pack_bundle
from tests.certifier.scene.workshop import write
from tests.client.conftest import Ciris

HOLE = re.compile(r"\{[\w.]+\}")


def _check_documented(client: TestClient, method: str, path: str, problem: dict[str, Any]) -> None:
    """Fails where the OpenAPI document does not say that the operation may answer like this."""
    paths = client.app.openapi()["paths"]  # type: ignore[attr-defined]
    plain = path.partition("?")[0]
    routes = [route for route in paths if re.fullmatch(re.sub(r"\{\w+\}", "[^/]+", route), plain) and method.lower() in paths[route]]
    if not routes:
        return
    responses = paths[min(routes, key=lambda route: route.count("{"))][method.lower()]["responses"]
    said = responses.get(str(problem["status"]), {}).get("description", "")
    assert f"`{problem['code']}`" in said or "another code" in said, f"{method} {path} may answer {problem['status']} {problem['code']}"


@dataclass(frozen=True)
class Trial:
    """Provokes errors as users do: with files in a directory, with commands and with requests."""

    directory: Path
    request: pytest.FixtureRequest

    def write(self, **files: str | bytes) -> Path:
        """Writes files, ``__`` standing for a dot, and returns the path of the first."""
        paths = [self.directory / name.replace("__", ".") for name in files]
        for path, content in zip(paths, files.values(), strict=True):
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return paths[0]

    def load(self, text: str | bytes) -> Scene:
        """Loads a scene file with this text."""
        return load_scene(self.write(scene__yaml=text))

    def scene(self, *scene: str, **parts: Any) -> Scene:
        """Loads the workshop's scene with parts replaced."""
        return load_scene(write(self.directory, *scene, **parts))

    def pack(self, **parts: Any) -> bytes:
        """Packs the workshop's scene with parts replaced."""
        return pack_bundle(write(self.directory, **parts))

    def unpack(self, *files: tuple[str | zipfile.ZipInfo, str]) -> Scene:
        """Loads a bundle of these files."""
        data = io.BytesIO()
        with zipfile.ZipFile(data, "w") as archive:
            for name, content in files:
                archive.writestr(name, content)
        return load_bundle(data.getvalue())

    def stranger(self, **files: str | bytes) -> Scene:
        """Loads a bundle of the workshop's scene, with these files beside it."""
        path = write(self.directory)
        self.write(**files)
        data = io.BytesIO()
        with zipfile.ZipFile(data, "w") as archive:
            archive.writestr("bundle.json", json.dumps({"scene": path.name}))
            for file in self.directory.iterdir():
                archive.writestr(file.name, file.read_bytes())
        return load_bundle(data.getvalue())

    def ask(self, method: str, path: str, **options: Any) -> None:
        """Sends a request and raises the problem that it is answered with."""
        client: TestClient = self.request.getfixturevalue("client")
        problem = client.request(method, path, **options).json()
        _check_documented(client, method, path, problem)
        raise CirisError(problem["code"], problem["detail"], field=problem["field"], hint=problem["hint"])

    def ciris(self, *arguments: object, **variables: str) -> str:
        """Runs a command that fails, and returns what it says."""
        run: Ciris = self.request.getfixturevalue("ciris")
        done = run(*arguments, **variables)
        assert done.status in (1, 2)
        return done.stderr.splitlines()[-1].removeprefix("error: ")


Provoke = Callable[[Trial], object]


@dataclass(frozen=True)
class Row:
    """An error that can reach a user.

    Attributes:
        module: where it is made.
        code: its code.
        where: the field that it names; empty where the message names the file, the body or the thing.
        message: what is wrong; ``{name}`` stands for what is filled in, and what stands before the message names a file and a line.
        hint: what to do; empty where the message says what has to be.
        provoke: makes the error happen; or says in words what would.
    """

    module: str
    code: str
    where: str
    message: str
    hint: str
    provoke: Provoke | str

    def __str__(self) -> str:
        return f"{self.module}: {self.message}"

    def fits(self, error: CirisError) -> bool:
        """Says whether an error is this row's."""
        parts = ((self.where, error.field or ""), (self.hint, error.hint))
        whole = all(re.fullmatch(pattern(template), text, re.DOTALL) for template, text in parts)
        return self.code == error.code and whole and re.fullmatch(f"(.* )?{pattern(self.message)}", error.message, re.DOTALL) is not None

    def fits_line(self, line: str) -> bool:
        """Says whether a line on standard error is this row's."""
        said = str(CirisError(self.code, self.message, field=self.where or None, hint=self.hint))
        return re.fullmatch(f"(.*: )?{pattern(said)}", line) is not None


def pattern(template: str) -> str:
    return ".*".join(re.escape(part) for part in HOLE.split(template))


def rows(module: str, *errors: tuple[str, str, str, str, Provoke | str]) -> list[Row]:
    """Returns the rows of a module: code, where, message, hint, provocation."""
    return [Row(module, *error) for error in errors]
