"""A parameter that a route of the interface does not have is refused: a misspelt filter would list everything."""

from __future__ import annotations

from fastapi import Depends, Request
from fastapi.dependencies.utils import get_flat_params
from fastapi.params import Query

from certifier.errors import CirisError, close_matches

PREFIX = "/v1/"
"""Addresses that begin so are the interface's. Those who ask for the others, such as monitoring, may add parameters of their own."""


async def _known(request: Request) -> None:
    """Refuses parameters of the address that its route does not have.

    Raises:
        CirisError: invalid_request.
    """
    if not request.query_params or not request.url.path.startswith(PREFIX):
        return
    known = [field.alias for field in get_flat_params(request.scope["route"].dependant) if isinstance(field.field_info, Query)]
    for name in request.query_params:
        if name not in known:
            hint = close_matches(name, known) or (
                f"leave it out; there are {', '.join(known)}" if known else "leave it out; there are none"
            )
            raise CirisError("invalid_request", f"there is no parameter {name!r} here", field=name, hint=hint)


KNOWN = Depends(_known)
