"""This extension has the directive ``openapi``: the routes of the service, as its OpenAPI document describes them.

The document itself lies beside the page, as openapi.json.
"""

import json
import os
import tempfile
from pathlib import Path
from typing import Any

from docutils.nodes import Node
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

METHODS = ("get", "post", "put", "patch", "delete")


def described() -> dict[str, Any]:
    """Returns the OpenAPI document of a service that has stored nothing."""
    with tempfile.TemporaryDirectory() as directory:
        os.environ["CIRIS_DATA_DIR"] = directory
        from api.app import create_app

        return create_app().openapi()


class OpenApi(SphinxDirective):
    """Describes every route, by its tag."""

    def run(self) -> list[Node]:
        document = described()
        sections: dict[str, list[str]] = {}
        for path, methods in document["paths"].items():
            for method in METHODS:
                if method in methods:
                    tag = methods[method].get("tags", ["service"])[0]
                    sections.setdefault(tag, []).append(route(method, path, methods[method], document))
        text = "\n\n".join(f"## {tag.capitalize()}\n\n" + "\n\n".join(routes) for tag, routes in sections.items())
        return self.parse_text_to_nodes(text, allow_section_headings=True)


def route(method: str, path: str, operation: dict[str, Any], document: dict[str, Any]) -> str:
    """Returns the text about one route: what it does, its parameters, its body, its answer and its errors."""
    parts = [f"### {method.upper()} `{path}`", operation.get("description", operation.get("summary", ""))]
    parameters = [(one["name"], one["in"], one.get("description", "")) for one in operation.get("parameters", ())]
    if parameters:
        parts.append(table(("parameter", "in", "what it is"), [(f"`{name}`", place, text) for name, place, text in parameters]))
    for content in operation.get("requestBody", {}).get("content", {}).values():
        parts.append(fields("The body", content["schema"], document))
    for status, answer in operation["responses"].items():
        if status.startswith("2"):
            for content in answer.get("content", {}).values():
                parts.append(fields(f"The answer ({status})", content.get("schema", {}), document))
    errors = [f"{status} ({answer['description']})" for status, answer in operation["responses"].items() if status >= "4"]
    return "\n\n".join([*parts, f"Errors: {'; '.join(errors)}"] if errors else parts)


def fields(title: str, schema: dict[str, Any], document: dict[str, Any]) -> str:
    """Returns a table of a schema's fields, or of those of each alternative."""
    alternatives = [resolved(one, document) for one in schema.get("oneOf") or schema.get("anyOf") or [schema]]
    parts = []
    for one in alternatives:
        rows = [(f"`{name}`", kind(about), about.get("description", "")) for name, about in one.get("properties", {}).items()]
        name = f"{title}: {one['title']}" if "title" in one else title
        parts.append(f"{name}\n\n{table(('field', 'type', 'what it is'), rows)}" if rows else f"{name}: {kind(one)}")
    return "\n\n".join(parts)


def resolved(schema: dict[str, Any], document: dict[str, Any]) -> dict[str, Any]:
    name = schema.get("$ref", "").rpartition("/")[2]
    return document["components"]["schemas"][name] if name else schema


def kind(schema: dict[str, Any]) -> str:
    """Returns a schema's type in short, such as ``number``, ``list of Region`` or ``string or null``."""
    if "$ref" in schema:
        return str(schema["$ref"].rpartition("/")[2])
    if alternatives := schema.get("anyOf") or schema.get("oneOf"):
        return " or ".join(dict.fromkeys(map(kind, alternatives)))
    if schema.get("type") == "array":
        return f"list of {kind(schema.get('items', {}))}"
    return str(schema.get("type", "any"))


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = [head, ("---",) * len(head), *(tuple(" ".join(cell.split()).replace("|", "\\|") for cell in row) for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _place(app: Sphinx, problem: Exception | None) -> None:
    if problem is None:
        (Path(app.outdir) / "docs/reference/openapi.json").write_text(json.dumps(described(), indent=1) + "\n")


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("openapi", OpenApi)
    app.connect("build-finished", _place)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
