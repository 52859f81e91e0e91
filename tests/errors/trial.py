"""Provocations: what users do that is refused, and what it needs to be done here."""

from __future__ import annotations

import io
import json
import re
import traceback
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from api.app import create_app
from certifier.errors import CirisError
from certifier.model import Scene
from certifier.scene import load_bundle, pack_bundle
from certifier.scene.parse import parse
from db.session import Database
from tests.certifier.scene.workshop import write
from tests.errors.sites import ROOT, Site, sites


def _read(path: Path) -> Scene:
    return Scene.from_document(parse({"path": str(path)}))


@cache
def _operations() -> dict[str, Any]:
    paths: dict[str, Any] = create_app(Database("sqlite://")).openapi()["paths"]
    return paths


def _check_documented(method: str, path: str, problem: dict[str, Any]) -> None:
    """Fails where the OpenAPI document does not say that the operation may answer like this."""
    paths = _operations()
    plain = path.partition("?")[0]
    routes = [route for route in paths if re.fullmatch(re.sub(r"\{\w+\}", "[^/]+", route), plain) and method.lower() in paths[route]]
    if not routes:
        return
    responses = paths[min(routes, key=lambda route: route.count("{"))][method.lower()]["responses"]
    said = responses.get(str(problem["status"]), {}).get("description", "")
    assert f"`{problem['code']}`" in said or "another code" in said, f"{method} {path} may answer {problem['status']} {problem['code']}"


@dataclass(frozen=True)
class Trial:
    """Provokes errors as users do: with files in a directory, with commands and with requests.

    Attributes:
        made: the errors that were made in this process, each with the modules and lines on the stack.
    """

    directory: Path
    request: pytest.FixtureRequest
    made: list[tuple[CirisError, set[tuple[str, int]]]] = field(default_factory=list)

    def refusal(self, act: Act) -> tuple[CirisError, list[Site]]:
        """Returns the error that an act raises, and the places that made it.

        An error of a child process has no stack here; it is of the places whose words are most like it.
        """
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(CirisError, "__init__", self._noting(CirisError.__init__))
            with pytest.raises(CirisError) as raised:
                act(self)
        error = raised.value
        same = [(made, stack) for made, stack in self.made if made.code == error.code and made.message in error.message]
        here = [site for made, stack in same for site in sites() if (site.module, site.line) in stack and site.makes(made)]
        alike = [site for site in sites() if site.words and site.makes(error)]
        return error, here or [site for site in alike if site.words == max(site.words for site in alike)]

    def _noting(self, init: Callable[..., None]) -> Callable[..., None]:
        def noted(error: CirisError, *said: Any, **more: Any) -> None:
            init(error, *said, **more)
            frames = ((Path(frame.f_code.co_filename), line) for frame, line in traceback.walk_stack(None))
            stack = {(path.relative_to(ROOT).as_posix(), line) for path, line in frames if path.is_relative_to(ROOT)}
            self.made.append((error, stack))

        return noted

    def need(self, fixture: str) -> Any:
        """Returns what a fixture gives."""
        return self.request.getfixturevalue(fixture)

    def write(self, **files: str | bytes) -> Path:
        """Writes files, ``__`` standing for a dot, and returns the path of the first."""
        paths = [self.directory / name.replace("__", ".") for name in files]
        for path, content in zip(paths, files.values(), strict=True):
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return paths[0]

    def load(self, text: str | bytes) -> Scene:
        """Loads a scene file with this text, in this process."""
        return _read(self.write(scene__yaml=text))

    def scene(self, *scene: str, **parts: Any) -> Scene:
        """Loads the workshop's scene with parts replaced, in this process."""
        return _read(write(self.directory, *scene, **parts))

    def pack(self, **parts: Any) -> bytes:
        """Packs the workshop's scene with parts replaced."""
        return pack_bundle(write(self.directory, **parts))

    def unpack(self, *files: tuple[str | zipfile.ZipInfo, str]) -> Scene:
        """Loads a bundle of these files."""
        data = io.BytesIO()
        with zipfile.ZipFile(data, "w") as archive:
            for name, content in files:
                archive.writestr(name, content)
        return load_bundle(data.getvalue()).scene

    def stranger(self, **files: str | bytes) -> Scene:
        """Loads a bundle of the workshop's scene, with these files beside it."""
        path = write(self.directory)
        self.write(**files)
        data = io.BytesIO()
        with zipfile.ZipFile(data, "w") as archive:
            archive.writestr("bundle.json", json.dumps({"scene": path.name}))
            for file in self.directory.iterdir():
                archive.writestr(file.name, file.read_bytes())
        return load_bundle(data.getvalue()).scene

    def ask(self, method: str, path: str, **options: Any) -> None:
        """Sends a request and raises the problem that it is answered with."""
        problem = self.need("client").request(method, path, **options).json()
        _check_documented(method, path, problem)
        raise CirisError(problem["code"], problem["detail"], field=problem["field"], hint=problem["hint"])

    def say(self, *arguments: object, **variables: str) -> str:
        """Runs a command that fails, and returns its last line."""
        done = self.need("ciris")(*arguments, **variables)
        assert done.status in (1, 2)
        return done.stderr.splitlines()[-1]

    def ciris(self, *arguments: object, **variables: str) -> None:
        """Runs a command that fails, and raises the error that it says."""
        line = self.say(*arguments, **variables)
        raise next(error for error, _ in reversed(self.made) if line == f"error: {error}")


Act = Callable[[Trial], object]
Table = dict[tuple[str, str], list[Act]]
"""Maps a code and a field, empty where an error names none, to what users do that is refused like this."""


@dataclass(frozen=True)
class Provocation:
    """What a user does that is refused.

    Attributes:
        code: the code of the error.
        field: the field that the error names; empty where it names none.
        act: makes the error happen.
    """

    code: str
    field: str
    act: Act

    def __str__(self) -> str:
        code = self.act.__code__
        return f"{Path(code.co_filename).stem}:{code.co_firstlineno}:{self.code}"
