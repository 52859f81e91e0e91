"""A person signs in with an API key. The browser keeps it in a cookie that scripts cannot read and other sites cannot send."""

from __future__ import annotations

import re
from http import HTTPStatus
from typing import Annotated

from fastapi import APIRouter, Form, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse

from api.access import COOKIE, WholeDb
from api.pages.rendering import page
from db import keys

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)


@router.get("/login")
def login_page(request: Request, next: str = "/") -> Response:
    return page(request, "login.html", {"next": next, "wrong": False})


@router.post("/login")
def sign_in(request: Request, db: WholeDb, key: Annotated[str, Form()], next: Annotated[str, Form()] = "/") -> Response:
    with db.read() as session:
        valid = keys.check(session, key.strip()) is not None
    if not valid:
        return page(request, "login.html", {"next": next, "wrong": True}, HTTPStatus.UNAUTHORIZED)
    response = RedirectResponse(_local(next), HTTPStatus.SEE_OTHER)
    response.set_cookie(COOKIE, key.strip(), httponly=True, samesite="strict", secure=request.url.scheme == "https")
    return response


@router.post("/logout")
def sign_out() -> Response:
    response = RedirectResponse("/login", HTTPStatus.SEE_OTHER)
    response.delete_cookie(COOKIE, httponly=True, samesite="strict")
    return response


def _local(path: str) -> str:
    """Returns the path, or ``/`` when the path could lead to another site."""
    return path if re.fullmatch(r"/([\w.-]+(/[\w.-]+)*)?(\?[\w.,=&%+:-]*)?", path, re.ASCII) else "/"
