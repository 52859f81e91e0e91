"""People sign in here, with an API key or at the identity provider, choose their project, and sign out.

The browser keeps the token of its session in a cookie that scripts cannot read and other sites cannot send. When the provider sends the
browser back, that request comes from another site. So it is answered with a page of this one, which goes on by itself.
"""

from __future__ import annotations

import hmac
import re
import shlex
from http import HTTPStatus
from typing import Annotated, Any
from urllib.parse import quote

from fastapi import APIRouter, Depends, Form, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import HTMLResponse, RedirectResponse

from api.access import COOKIE, WholeDb, session_of
from api.oidc import CALLBACK, Attempt, Provider, SignInRefused
from api.pages.rendering import page
from api.writing import writing
from certifier.errors import CirisError
from db import grants, keys, sessions
from db.grants import Person
from db.keys import Key
from db.session import Database
from db.sessions import SignedIn

ATTEMPT, ATTEMPT_SECONDS = "ciris_sign_in", 600
"""While somebody signs in at the provider, a cookie knows of it, for this many seconds at most."""

router = APIRouter(include_in_schema=False, default_response_class=HTMLResponse)


async def _provider(request: Request) -> Provider:
    """Returns the identity provider.

    Raises:
        CirisError: not_found.
    """
    provider: Provider | None = request.app.state.provider
    if provider is None:
        raise CirisError("not_found", "this service has no identity provider", field="url", hint="sign in with an API key at /login")
    return provider


@router.get("/login")
async def login_page(request: Request, db: WholeDb, next: str = "/") -> Response:
    found = await run_in_threadpool(_signed_in, db, request)
    if found is not None and found.person is not None:
        return RedirectResponse(_choice(next), HTTPStatus.SEE_OTHER)
    return _login(request, next)


@router.post("/login")
async def sign_in(request: Request, db: WholeDb, key: Annotated[str, Form()], next: Annotated[str, Form()] = "/") -> Response:
    found = await run_in_threadpool(_key, db, key.strip())
    if found is None:
        return _login(request, next, wrong=True)
    response = RedirectResponse(_local(next), HTTPStatus.SEE_OTHER)
    _keep(request, response, await _begin(db, found, session_of(request.headers)))
    return response


@router.get("/login/oidc")
async def begin_at_provider(request: Request, provider: Annotated[Provider, Depends(_provider)], next: str = "/") -> Response:
    attempt = Attempt(Attempt.new_secret(), _callback(request))
    response = RedirectResponse(await provider.address(attempt), HTTPStatus.SEE_OTHER)
    _set(request, response, ATTEMPT, f"{attempt.secret} {_local(next)}", samesite="lax", max_age=ATTEMPT_SECONDS, path="/login/oidc")
    return response


@router.get(CALLBACK)
async def come_back(
    request: Request, provider: Annotated[Provider, Depends(_provider)], db: WholeDb, code: str = "", state: str = "", error: str = ""
) -> Response:
    secret, _, next = request.cookies.get(ATTEMPT, "").partition(" ")
    attempt = Attempt(secret, _callback(request))
    if not secret or not hmac.compare_digest(attempt.state.encode(), state.encode()):
        raise SignInRefused("this browser did not begin to sign in, or took too long, or has signed in already")
    if error or not code:
        raise SignInRefused(f"the identity provider says {error[:200] or 'nothing'!r}")
    token = await _begin(db, await provider.person(attempt, code), session_of(request.headers))
    response = page(request, "signed_in.html", {"on": _choice(next)})
    _keep(request, response, token)
    response.delete_cookie(ATTEMPT, path="/login/oidc", httponly=True, samesite="lax")
    return response


@router.get("/login/project")
async def project_page(request: Request, db: WholeDb, next: str = "/") -> Response:
    found = await run_in_threadpool(_signed_in, db, request)
    if found is None or found.person is None:
        return RedirectResponse(f"/login?next={quote(_local(next))}", HTTPStatus.SEE_OTHER)
    choices = await run_in_threadpool(_choices, db, found.person)
    if len(choices) == 1 and found.project is None:
        return await _into(request, db, next, choices[0][0])
    chosen = found.project and found.project[0]
    context = {"person": found.person, "choices": choices, "chosen": chosen, "next": _local(next), "grant": _grant(found.person)}
    return page(request, "choose_project.html", context, HTTPStatus.OK if choices else HTTPStatus.FORBIDDEN)


@router.post("/login/project")
async def choose_project(request: Request, db: WholeDb, project: Annotated[str, Form()], next: Annotated[str, Form()] = "/") -> Response:
    return await _into(request, db, next, project)


@router.post("/logout")
async def sign_out(request: Request, db: WholeDb) -> Response:
    token = session_of(request.headers)
    if token is not None and await run_in_threadpool(_signed_in, db, request) is not None:
        await _end(db, token)
    response = RedirectResponse("/login", HTTPStatus.SEE_OTHER)
    response.delete_cookie(COOKIE, httponly=True, samesite="strict")
    return response


def _login(request: Request, next: str, *, wrong: bool = False) -> Response:
    provider: Provider | None = request.app.state.provider
    context = {"next": _local(next), "wrong": wrong, "provider": provider and provider.host}
    return page(request, "login.html", context, HTTPStatus.UNAUTHORIZED if wrong else HTTPStatus.OK)


async def _into(request: Request, db: Database, next: str, project: str) -> Response:
    """Makes a project the one that the session works in. Without a grant there, the page for choosing says which there are."""
    found = await run_in_threadpool(_signed_in, db, request)  # only who has signed in makes the database write
    token = None if found is None else await _choose(db, session_of(request.headers) or "", project)
    response = RedirectResponse(_choice(next) if token is None else _local(next), HTTPStatus.SEE_OTHER)
    if token is not None:
        _keep(request, response, token)
    return response


@writing
def _begin(db: Database, who: Key | Person, before: str | None) -> str:
    """Begins a session and ends the one of this token, which the browser had, and returns the new token.

    At the way back from the provider the browser does not send its token; that session ends when it expires.
    """
    with db.write() as session:
        if before is not None:
            sessions.end(session, before)
        return sessions.begin(session, who)


@writing
def _choose(db: Database, token: str, project: str) -> str | None:
    with db.write() as session:
        return sessions.choose(session, token, project)


@writing
def _end(db: Database, token: str) -> None:
    with db.write() as session:
        sessions.end(session, token)


def _key(db: Database, given: str) -> Key | None:
    with db.read() as session:
        return keys.check(session, given)


def _signed_in(db: Database, request: Request) -> SignedIn | None:
    """Returns the session of a request that nobody has been asked for; None where there is none."""
    token = session_of(request.headers)
    if token is None:
        return None
    with db.read() as session:
        return sessions.get(session, token)


def _choices(db: Database, person: Person) -> list[tuple[str, str]]:
    """Returns the projects that a person may choose from, each with the scope there."""
    with db.read() as session:
        return [(row.project, row.scope) for row in grants.of_person(session, person)]


def _grant(person: Person) -> str | None:
    """Returns the command that lets a person in; None where it would name an address that may be somebody else's."""
    if person.email is None and "@" in person.subject:
        return None
    return f"ciris project grant PROJECT --person {shlex.quote(person.name)} --scope read"


def _callback(request: Request) -> str:
    return str(request.url.replace(path=CALLBACK, query="", fragment=""))


def _choice(next: str) -> str:
    """Returns the address of the page for choosing a project, which goes on to another one."""
    return f"/login/project?next={quote(_local(next))}"


def _keep(request: Request, response: Response, token: str) -> None:
    _set(request, response, COOKIE, token, samesite="strict")


def _set(request: Request, response: Response, name: str, value: str, **options: Any) -> None:
    response.set_cookie(name, value, httponly=True, secure=request.url.scheme == "https", **options)


def _local(path: str) -> str:
    """Returns the path, or ``/`` when the path could lead to another site."""
    return path if re.fullmatch(r"/([\w.-]+(/[\w.-]+)*)?(\?[\w.,=&%+:-]*)?", path, re.ASCII) else "/"
