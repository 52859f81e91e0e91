"""What goes wrong between the client and the service becomes a CirisError here."""

from __future__ import annotations

import re
from urllib.parse import quote

import httpx2

from certifier.errors import CirisError


def unreachable(url: str, error: Exception) -> CirisError:
    """Returns the error that says that nobody answers at ``url``."""
    reason = re.sub(r"^\[.*?\] ", "", str(error))  # an errno, which helps nobody
    message = f"the service at {url} does not answer: {reason}"
    return CirisError("unreachable", message, hint="is `ciris up` running there?")


def problem(response: httpx2.Response) -> CirisError:
    """Returns the error that the service has answered with."""
    if response.headers.get("content-type", "").startswith("application/problem+json"):
        problem = response.json()
        return CirisError(problem["code"], problem["detail"], field=problem["field"], hint=problem["hint"])
    return CirisError("not_ciris", f"{response.url} answered {response.status_code}", hint="is that the address of a ciris service?")


def segment(name: str) -> str:
    """Returns a name or an id as one segment of a URL's path.

    Raises:
        CirisError: not_found for what no name can be.
    """
    if not name.strip(".") or "/" in name:
        raise CirisError("not_found", f"{name!r} is no name and no id", hint="`scene ls`, `job ls` and `region ls` of ciris list them")
    return quote(name, safe="")
