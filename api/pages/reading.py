"""The documentation, where the service runs from a checkout that has it: every page of docs/ as text, with links among them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from http import HTTPStatus

from fastapi import APIRouter, Request, Response
from markupsafe import Markup, escape
from starlette.exceptions import HTTPException

from api.pages.rendering import DOCS, docs, page

router = APIRouter()

_HEADING = re.compile(r"(#{1,4}) (.+)")
_LINK = re.compile(r"(?<!!)\[([^\]]+)\]\((\w+)\.md(?:#[\w-]*)?\)")


@router.get("/docs/{name}")
def doc_page(request: Request, name: str) -> Response:
    if name not in docs():
        raise HTTPException(HTTPStatus.NOT_FOUND, f"there is no page docs/{name}.md here")
    text = (DOCS / f"{name}.md").read_text()
    return page(request, "reading.html", {"name": name, "blocks": list(_blocks(text)), "names": docs()})


def _blocks(text: str) -> Iterator[tuple[int, Markup]]:
    """Divides Markdown into headings, each with its level, and the text between them, with level 0."""
    between: list[str] = []
    fenced = False
    for line in text.splitlines():
        fenced ^= line.startswith("```")
        heading = None if fenced else _HEADING.fullmatch(line)
        if heading is None:
            between.append(line)
            continue
        yield 0, _linked("\n".join(between).strip("\n"))
        between = []
        yield len(heading[1]), _linked(heading[2])
    yield 0, _linked("\n".join(between).strip("\n"))


def _linked(text: str) -> Markup:
    """Escapes a text, and makes links to other pages of it."""
    found, end = Markup(), 0
    for link in _LINK.finditer(text):
        found += escape(text[end : link.start()]) + Markup('<a href="/docs/{}">{}</a>').format(link[2], link[1])
        end = link.end()
    return found + escape(text[end:])
