"""The static files of the dashboard, and for how long a browser may keep them."""

from __future__ import annotations

import re
from http import HTTPStatus

from fastapi.staticfiles import StaticFiles
from starlette.responses import Response
from starlette.types import Scope

FOREVER, ASKED = "public, max-age=31536000, immutable", "no-cache"
"""A name with a digest never means another file. About any other one the browser asks each time, and gets 304 where it has the file."""
_DIGEST = re.compile(r"built/.+-[A-Z0-9]{8}\.js")


class Assets(StaticFiles):
    """Serves the files. Without the header, a browser might keep a script of an earlier version that asks for files that are gone."""

    async def get_response(self, path: str, scope: Scope) -> Response:
        response = await super().get_response(path, scope)
        if response.status_code in (HTTPStatus.OK, HTTPStatus.NOT_MODIFIED):
            response.headers["Cache-Control"] = FOREVER if _DIGEST.fullmatch(path) else ASKED
        return response
