"""Every error is an RFC 9457 problem: it says what is wrong (``code``), where (``field``) and what to do (``hint``)."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import partial
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel, ConfigDict, Field
from starlette.exceptions import HTTPException

from certifier.errors import CirisError, shortened
from certifier.options import in_group
from db.disk import lacks_room
from db.session import UNAVAILABLE
from jobs.patterns import SAID
from jobs.registry import KINDS

MEDIA_TYPE = "application/problem+json"

_STATUS_OF_CODE = {
    **dict.fromkeys(
        (
            "scene_not_found",
            "job_not_found",
            "region_not_found",
            "proof_not_found",
            "webhook_not_found",
            "cover_not_found",
            "map_not_found",
            "motion_not_found",
            "pair_not_found",
            "cells_not_found",
            "key_not_found",
            "project_not_found",
            "worker_not_found",
        ),
        HTTPStatus.NOT_FOUND,
    ),
    "idempotency_conflict": HTTPStatus.CONFLICT,
    "job_not_retryable": HTTPStatus.CONFLICT,
    **dict.fromkeys(
        ("first_key", "has_dependents", "not_ended", "webhook_waits", "worker_draining", "scene_unchanged", "scene_without_regions"),
        HTTPStatus.CONFLICT,
    ),
    **dict.fromkeys(("storage_quota", "time_quota", "too_many_keys", "workers_shared", "other_projects"), HTTPStatus.FORBIDDEN),
    "ambiguous_id": HTTPStatus.CONFLICT,
    "too_large": HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
    "content_encoding": HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
    "bundle_too_large": HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
    **dict.fromkeys(("child_timeout", "child_memory", "child_died"), HTTPStatus.SERVICE_UNAVAILABLE),
    "cross_site": HTTPStatus.FORBIDDEN,
    "sign_in_refused": HTTPStatus.FORBIDDEN,
    "provider_unavailable": HTTPStatus.SERVICE_UNAVAILABLE,
    "unknown_host": HTTPStatus.MISDIRECTED_REQUEST,
    "key_needed": HTTPStatus.UNAUTHORIZED,
    "scope_missing": HTTPStatus.FORBIDDEN,
    "too_many_requests": HTTPStatus.TOO_MANY_REQUESTS,
    "quota_exceeded": HTTPStatus.TOO_MANY_REQUESTS,
    **dict.fromkeys(("busy", "no_room", "database_unavailable", "database_version"), HTTPStatus.SERVICE_UNAVAILABLE),
    **dict.fromkeys(("bad_request", "malformed_json"), HTTPStatus.BAD_REQUEST),
    "too_slow": HTTPStatus.REQUEST_TIMEOUT,
    "not_found": HTTPStatus.NOT_FOUND,
    "method_not_allowed": HTTPStatus.METHOD_NOT_ALLOWED,
    "internal": HTTPStatus.INTERNAL_SERVER_ERROR,
}

RETRY_SECONDS = 5

MOST_ERRORS = 100

OF_THE_FRAMEWORK = {
    HTTPStatus.NOT_FOUND: "not_found",
    HTTPStatus.METHOD_NOT_ALLOWED: "method_not_allowed",
    HTTPStatus.REQUEST_ENTITY_TOO_LARGE: "too_large",
}
"""The codes of errors that the framework makes. Any other is ``bad_request``, or ``internal``."""

_DESCRIBED = "/openapi.json describes every request"
_PLACES = {HTTPStatus.NOT_FOUND: "url", HTTPStatus.METHOD_NOT_ALLOWED: "method", HTTPStatus.REQUEST_ENTITY_TOO_LARGE: "body"}
"""Where the errors of the framework are."""


class FieldProblem(BaseModel):
    """Names one field of the request that is wrong, and says why."""

    field: str = Field(description="The field, as in `seed.q[1]`.")
    message: str = Field(description="What is wrong with it.")


class Problem(BaseModel):
    """Describes an error (RFC 9457). Programs read `code`, which is stable; people read `detail`."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "type": "urn:ciris:problem:seed_outside_limits",
                    "title": "Unprocessable Content",
                    "status": 422,
                    "detail": "joint arm/elbow is at 9 rad, not between its limits -2 and 2 rad",
                    "code": "seed_outside_limits",
                    "field": "seed.q[1]",
                    "hint": "move it between them",
                    "errors": [],
                }
            ]
        }
    )

    type: str = Field(description="`urn:ciris:problem:` and the code.")
    title: str = Field(description="The phrase of the HTTP status.")
    status: int = Field(description="The HTTP status.")
    detail: str = Field(description="What is wrong, in words.")
    code: str = Field(description="What is wrong, for programs. Codes are stable.")
    field: str | None = Field(None, description="Where it is wrong: a field, a header or `url`; null where the whole request is meant.")
    hint: str = Field("", description="What to do about it.")
    errors: list[FieldProblem] = Field([], description=f"The fields that are wrong, at most {MOST_ERRORS}; of a list, the first item.")


Render = Callable[[Request, Problem], Response]


def status_of(code: str) -> HTTPStatus:
    """Returns the status of an error with this code."""
    return _STATUS_OF_CODE.get(code, HTTPStatus.UNPROCESSABLE_ENTITY)


def problem_of(error: CirisError, status: HTTPStatus | None = None, errors: Sequence[FieldProblem] = ()) -> Problem:
    """Turns an error into a problem. The status is the given one, or else that of the error's code."""
    status = status_of(error.code) if status is None else status
    return Problem(
        type=f"urn:ciris:problem:{error.code}",
        title=status.phrase,
        status=status,
        detail=error.message,
        code=error.code,
        field=error.field,
        hint=error.hint,
        errors=list(errors),
    )


def as_json(problem: Problem) -> Response:
    """Returns a problem as a JSON response for programs."""
    return JSONResponse(problem.model_dump(), problem.status, media_type=MEDIA_TYPE)


def install(app: FastAPI, render: Render) -> None:
    """Makes the application answer every error that leaves a route with a problem, which ``render`` presents."""
    for kind in _EXPLANATIONS:
        app.add_exception_handler(kind, partial(respond, render))


def respond(render: Render, request: Request, error: Exception) -> Response:
    """Returns the response for an error, presented by ``render``, with the headers that the error asks for."""
    explain = next(_EXPLANATIONS[kind] for kind in type(error).__mro__ if kind in _EXPLANATIONS)
    response = render(request, explain(error))
    response.headers.update(getattr(error, "headers", None) or {})
    if response.status_code == HTTPStatus.SERVICE_UNAVAILABLE:
        response.headers["Retry-After"] = str(RETRY_SECONDS)
    return response


def _validation(error: RequestValidationError) -> Problem:
    every = error.errors()
    for one in every:
        raised = one.get("ctx", {}).get("error")
        if isinstance(raised, Exception):
            raised.__traceback__ = None  # its frames hold the body and this error, which holds it
    found = every[:MOST_ERRORS]
    places = [_field((*e["loc"], "kind") if e["type"] in _TAGS else e["loc"]) for e in found]
    problems = [FieldProblem(field=shortened(at), message=shortened(_sentence(e))) for at, e in zip(places, found, strict=True)]
    if isinstance(error.body, bytes):
        hint = "send `Content-Type: application/json`"
        return problem_of(CirisError("invalid_request", "the body is not said to be JSON", field="Content-Type", hint=hint))
    # Of the types that a field may have, the one that was meant is the one of which most was right.
    first = max(range(len(found)), key=lambda i: (found[i]["loc"][:2] == found[0]["loc"][:2], len(found[i]["loc"]), -i))
    meant = CirisError("invalid_request", problems[first].message, field=problems[first].field or "body", hint=_DESCRIBED)
    return problem_of(meant, errors=problems)


def _http(error: HTTPException) -> Problem:
    if isinstance(error.__cause__, CirisError):
        return problem_of(error.__cause__)
    status = HTTPStatus(error.status_code)
    code = OF_THE_FRAMEWORK.get(status, "internal" if status >= HTTPStatus.INTERNAL_SERVER_ERROR else "bad_request")
    return problem_of(CirisError(code, error.detail, field=_PLACES.get(status), hint=_DESCRIBED), status)


def _unavailable(error: Exception) -> Problem:
    if lacks_room(error):
        hint = "free some room on it; what was stored is safe, and /readyz says more"
        return problem_of(CirisError("no_room", "the database's disk is full, or cannot be written", hint=hint))
    hint = "try again; what was committed is safe"
    return problem_of(CirisError("database_unavailable", "the database cannot be reached", hint=hint))


def _unexpected(_error: Exception) -> Problem:
    hint = "the service's log has the details"
    return problem_of(CirisError("internal", "something went wrong in the service", hint=hint))


_EXPLANATIONS: dict[type, Callable[[Any], Problem]] = {
    CirisError: problem_of,
    RequestValidationError: _validation,
    HTTPException: _http,
    **dict.fromkeys(UNAVAILABLE, _unavailable),
    Exception: _unexpected,
}


_TYPE = re.compile(r"(constrained-)?(list|str|int|float|bool|dict|tuple)(\[.*\])?$")


_TAGS = {"union_tag_not_found", "union_tag_invalid"}
"""A request whose `kind` is missing or unknown; jobs alone have kinds."""


def _field(loc: Sequence[str | int]) -> str:
    """Returns the name of a field as the client wrote it: ``("body", "grow", "seed", "q", 3)`` -> ``"seed.q[3]"``.

    Where a field may be of several types, pydantic names the one it has tried, as in ``("body", "start", "list[float]", 0)``.
    """
    parts = [part for part in loc[1:] if isinstance(part, int) or not _TYPE.match(part)]
    at = _kind_at(parts)
    if loc[0] == "body" and at is not None:
        del parts[at]
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in parts).removeprefix(".")


def _elsewhere(*path: str | int) -> str:
    """Returns where to give an option that is a member of a group; "" for another field."""
    at = _kind_at(path)
    if at is None or len(path) != at + 3:
        return ""
    kind, place, name = (str(part) for part in path[at:])
    _, cls = KINDS[kind].forms.get(place, ("", None))
    found = "" if cls is None else in_group(cls, name)
    return f": give {place}.{found}" if found else ""


def _kind_at(path: Sequence[str | int]) -> int | None:
    """Returns where pydantic names the kind of a job in a path, alone or in ``jobs`` of a batch; None where it does not."""
    at = 2 if len(path) > 2 and path[0] == "jobs" and isinstance(path[1], int) else 0
    return at if len(path) > at and path[at] in KINDS else None


def _sentence(error: dict[str, Any]) -> str:
    if error["type"] == "extra_forbidden":
        return f"there is no such field{_elsewhere(*error['loc'][1:])}"
    if error["type"] == "string_pattern_mismatch":
        return SAID[error["ctx"]["pattern"]]
    if error["type"] in _TAGS:
        return f"it must be one of {', '.join(KINDS)}"
    message = str(error["msg"]).removeprefix("Value error, ").replace(" after validation", "")
    return message[:1].lower() + message[1:]
