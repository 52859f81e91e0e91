"""A parameter that a route of the interface does not have is refused: a misspelt filter would list everything. So is one that is given
twice where the route takes one value: the last one would win without a word.
"""

from __future__ import annotations

from fastapi import Depends, Request
from fastapi._compat import field_annotation_is_sequence
from fastapi.dependencies.utils import get_flat_params
from fastapi.params import Query

from certifier.errors import CirisError, close_matches

PREFIX = "/v1/"
"""Addresses that begin so are the interface's. Those who ask for the others, such as monitoring, may add parameters of their own."""


async def _known(request: Request) -> None:
    """Refuses parameters of the address that its route does not have, or has once.

    Raises:
        CirisError: invalid_request.
    """
    if not request.query_params or not request.url.path.startswith(PREFIX):
        return
    fields = [field for field in get_flat_params(request.scope["route"].dependant) if isinstance(field.field_info, Query)]
    known = [field.alias for field in fields]
    several = {field.alias for field in fields if field_annotation_is_sequence(field.field_info.annotation)}
    for name in request.query_params:
        if name not in known:
            hint = close_matches(name, known) or (
                f"leave it out; there are {', '.join(known)}" if known else "leave it out; there are none"
            )
            raise CirisError("invalid_request", f"there is no parameter {name!r} here", field=name, hint=hint)
        if name not in several and len(request.query_params.getlist(name)) > 1:
            raise CirisError("invalid_request", "is given more than once", field=name, hint="it has one value; leave the others out")


KNOWN = Depends(_known)
