"""What goes wrong between the client and the service becomes a CirisError here."""

from __future__ import annotations

import re
from contextlib import suppress
from typing import Any
from urllib.parse import quote

import httpx2

from certifier.errors import CirisError
from ciris.documents import Document, named

DESCRIBED, WHICH = "/openapi.json", "is that the address of a ciris service of this version?"
HELP = {"invalid_request": "help() of the method in Python, or --help of the command, says what it takes"}
"""What is said instead of where the API is described, which is for those who write requests themselves."""
LONGEST = 200
"""No name and no id has more characters."""
BUSY = (502, 503, 504)
"""With these a proxy answers whose service does not, as while it starts again."""


def address(url: str) -> str:
    """Returns the address of a service without a slash at its end.

    Raises:
        CirisError: url.
    """
    hint = "write it as http://HOST:PORT"
    try:
        parsed = httpx2.URL(url)
    except (TypeError, ValueError, httpx2.InvalidURL):
        raise CirisError("url", f"{url!r} is no address", hint=hint) from None
    if parsed.scheme not in ("http", "https") or not parsed.host or re.search(r"\s", url) or (parsed.port or 0) > 65535:
        raise CirisError("url", f"{url!r} is no address of a service", hint=hint)
    return url.rstrip("/")


def unreachable(url: str, error: Exception) -> CirisError:
    """Returns the error that says that nobody answers at ``url``."""
    if isinstance(error, httpx2.TimeoutException):
        return CirisError(
            "timeout", f"the service at {url} has not answered in time", hint="ask for less, or connect with a longer timeout"
        )
    if isinstance(error, httpx2.DecodingError):
        return CirisError("not_ciris", f"{url} answered with what cannot be decoded", hint="is that the address of a ciris service?")
    reason = re.sub(r"^\[.*?\] ", "", str(error)) or type(error).__name__  # without the errno, which helps nobody
    return CirisError("unreachable", f"the service at {url} does not answer: {reason}", hint="is `ciris up` running there?")


def problem(response: httpx2.Response) -> CirisError:
    """Returns the error that the service, or a proxy before it, has answered with."""
    if response.headers.get("content-type", "").startswith("application/problem+json"):
        with suppress(ValueError, KeyError, TypeError):
            problem = response.json()
            hint = HELP.get(problem["code"], WHICH) if DESCRIBED in (problem["hint"] or "") else problem["hint"] or ""
            return CirisError(problem["code"], problem["detail"], field=problem["field"], hint=hint)
    url, status = response.url, response.status_code
    if status in BUSY:
        return CirisError("unreachable", f"{url} answered {status}: who answers there cannot reach the service now", hint="try again soon")
    if status == httpx2.codes.TOO_MANY_REQUESTS:
        return CirisError("too_many_requests", f"{url} answered that it was asked too often", hint="ask less often, or try again later")
    if response.is_redirect:
        return CirisError("not_ciris", f"{url} sends you on to {response.headers['location']}", hint="give the address that it leads to")
    return CirisError("not_ciris", f"{url} answered {status}", hint="is that the address of a ciris service?")


class Answer(Document):
    """An answer of the service. Looking for a missing entry at its top raises an error that says that something else has answered."""

    def __missing__(self, name: str) -> Any:
        raise CirisError("not_ciris", f"the answer lacks {name}", hint="is it a ciris service of this version that answers?")


def content(response: httpx2.Response) -> Any:
    """Returns the JSON object that the service has answered with.

    Raises:
        CirisError: not_ciris, where it is none.
    """
    try:
        return Answer(response.json())
    except (ValueError, TypeError):
        message = f"{response.url} answered {response.status_code} with something that is not a JSON object"
        raise CirisError("not_ciris", message, hint="is that the address of a ciris service?") from None


def segment(name: str) -> str:
    """Returns a name or an id as one segment of a URL's path.

    Raises:
        CirisError: not_found for what no name can be; argument for what is no text.
    """
    name = named(name, "name", "a name or an id")
    if not name.strip(".") or "/" in name or len(name) > LONGEST or not name.isprintable():
        shown = name if len(name) <= LONGEST else f"{name[:LONGEST]}..."
        hint = "`ls` of `ciris scene`, `job` and `region`, or `scenes()`, `jobs()` and `regions()` in Python, list them"
        raise CirisError("not_found", f"{shown!r} is no name and no id", hint=hint)
    return quote(name, safe="")
