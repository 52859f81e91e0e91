"""What is served is what the sources say: somebody who changes dashboard/source/ has to build it."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from api.app import create_app
from db.session import Database
from tests.dashboard.schema import DASHBOARD, SCHEMA, document, head

BUILT = DASHBOARD / "static/built"
REBUILD = "build the dashboard again: cd dashboard && npm ci && npm run build"


def test_the_built_files_are_of_these_sources() -> None:
    names = ["build.mjs", "package.json", "package-lock.json", "tsconfig.json"]
    names += [str(path.relative_to(DASHBOARD)) for path in (DASHBOARD / "source").rglob("*") if path.is_file()]
    digest = hashlib.sha256()
    for name in sorted(names):
        digest.update(name.encode() + b"\0" + (DASHBOARD / name).read_bytes() + b"\0")
    assert (BUILT / "sources.sha256").read_text().strip() == digest.hexdigest(), REBUILD


def test_the_types_are_of_this_api(tmp_path: Path) -> None:
    first, _, types = SCHEMA.read_text().partition("\n")
    described = document(create_app(Database(f"sqlite:///{tmp_path / 'ciris.db'}")))
    assert head(described, types) == f"{first}\n", "write the types again: python -m tests.dashboard.schema"


def test_no_built_file_is_left_over_or_missing() -> None:
    built = {path.name for path in BUILT.glob("*.js")}
    wanted, waiting = set(), ["main.js"]
    while waiting:
        name = waiting.pop()
        if name not in wanted:
            wanted.add(name)
            waiting += re.findall(r'["`]\./([\w.-]+\.js)["`]', (BUILT / name).read_text())
    assert built == wanted, REBUILD


def test_the_licences_of_what_is_built_in_are_there() -> None:
    text = (BUILT / "licences.txt").read_text()
    assert all(re.search(rf"^{name} \d", text, re.MULTILINE) for name in ("preact", "three"))
    assert text.count("MIT") >= 2 or text.count("Permission is hereby granted") >= 2
