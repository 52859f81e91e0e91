"""``python -m tests.dashboard.schema`` writes dashboard/source/common/schema.d.ts: the types of the answers that the dashboard uses.

The npm package openapi-typescript makes them. npx fetches it with the TypeScript 5 that it needs, because TypeScript 7 has no API for it.
"""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from fastapi import FastAPI

from api.app import create_app
from db.session import Database

DASHBOARD = Path(__file__).parents[2] / "dashboard"
SCHEMA = DASHBOARD / "source/common/schema.d.ts"
GENERATE = ("npx", "--yes", "--package=openapi-typescript@7.13.0", "--package=typescript@5.9.3", "openapi-typescript")
LIKE = ("--root-types", "--root-types-no-schema-prefix", "--root-types-keep-casing")


def document(app: FastAPI) -> dict[str, Any]:
    """Returns an OpenAPI document of the schemas that the dashboard's sources import, and of those that they refer to."""
    # Of two models with the same name, that of answers is called NAME-Output, which is no name of a type.
    schemas = json.loads(json.dumps(app.openapi()["components"]["schemas"]).replace('-Output"', '"'))
    sources = "".join(path.read_text() for path in sorted(DASHBOARD.glob("source/**/*.ts*")))
    imported = ",".join(re.findall(r'import type \{([^}]*)\} from "[./\w]*/schema"', sources))
    kept, waiting = {}, [part.split()[0] for part in imported.split(",") if part.strip()]
    while waiting:
        name = waiting.pop()
        if name not in kept:
            kept[name] = _bare(schemas[name])
            kept[name]["required"] = [*kept[name].get("properties", ())]  # An answer has all of its fields.
            waiting += re.findall(r'"#/components/schemas/(\w+)"', json.dumps(kept[name]))
    info = {"title": "ciris", "version": "1"}
    return {"openapi": "3.1.0", "info": info, "paths": {}, "components": {"schemas": dict(sorted(kept.items()))}}


def _bare(part: Any) -> Any:
    """Returns a part of a schema without its texts."""
    if isinstance(part, list):
        return [_bare(item) for item in part]
    if not isinstance(part, dict):
        return part
    return {key: _bare(value) for key, value in part.items() if key not in ("title", "description", "examples") or isinstance(value, dict)}


def head(described: dict[str, Any], types: str) -> str:
    """Returns the first line of the file with these types of a document."""
    digest = hashlib.sha256(json.dumps(described, sort_keys=True).encode() + types.encode()).hexdigest()
    return f"// Written by: python -m tests.dashboard.schema. Digest: {digest}\n"


def main() -> None:
    with tempfile.TemporaryDirectory() as directory:
        described = document(create_app(Database(f"sqlite:///{directory}/ciris.db")))
        source, made = Path(directory) / "openapi.json", Path(directory) / "schema.d.ts"
        source.write_text(json.dumps(described))
        subprocess.run([*GENERATE, str(source), "--output", str(made), *LIKE], check=True)
        types = made.read_text()
    SCHEMA.write_text(head(described, types) + types)


if __name__ == "__main__":
    main()
