"""A parameter that a route does not have is refused: a misspelt filter would list everything. So is one that is given twice where the
route takes one value: the last one would win without a word.
"""

from __future__ import annotations

from fastapi import Depends, Request
from fastapi._compat import field_annotation_is_sequence
from fastapi.dependencies.utils import get_flat_params
from fastapi.params import Cookie, Header, Path

from certifier.errors import CirisError, close_matches

PREFIX = "/v1/"
"""Addresses that begin so are the interface's. Those who ask for the others, such as monitoring, may add parameters of their own."""
ANGLES = "angles"
"""The address of any page may have this. The browser reads it: it says in which unit angles are shown."""


async def _known(request: Request) -> None:
    """Refuses parameters of an address of the interface that its route does not have, or has once.

    Raises:
        CirisError: invalid_request.
    """
    if request.url.path.startswith(PREFIX):
        _refuse_others(request)


async def _known_to_page(request: Request) -> None:
    """Refuses parameters of the address of a page that its route does not have.

    Raises:
        CirisError: invalid_request.
    """
    _refuse_others(request, ANGLES)


def _refuse_others(request: Request, *more: str) -> None:
    if not request.query_params:
        return
    # The fields of a model of parameters are of no kind.
    flat = get_flat_params(request.scope["route"].dependant)
    fields = [field for field in flat if not isinstance(field.field_info, Path | Header | Cookie)]
    known = [*(field.alias for field in fields), *more]
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
KNOWN_TO_PAGE = Depends(_known_to_page)
"""Is for pages whose parameters the server reads. Those of the other pages are read in the browser."""
