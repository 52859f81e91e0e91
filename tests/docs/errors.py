"""``python -m tests.docs.errors`` writes docs/errors.md from the source: every code that an error may have."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from api.problems import OF_THE_FRAMEWORK, status_of
from tests.errors.sites import sites

PAGE = Path(__file__).parents[2] / "docs" / "errors.md"
ROOMS = {
    "api": "the HTTP API",
    "ciris": "the Python client",
    "client": "the command `ciris`",
    "db": "what the service stores",
    "jobs": "the jobs",
    "planner": "covering and planning",
    "workers": "the workers",
    "certifier/scene": "reading a scene",
    "certifier/seeding": "seeding",
    "certifier/growth": "growing a region",
    "certifier/motion": "certifying a motion",
    "certifier/proof": "verifying a proof",
    "certifier/verify": "verifying a proof",
    "certifier": "the certifier",
}
GIVEN = {
    **dict.fromkeys(("bad_request", "internal", *OF_THE_FRAMEWORK.values()), "api"),
    "missing_option": "certifier/seeding",
    "motion_not_finite": "certifier/motion",
    "number_too_large": "certifier",
}
"""Maps codes that are not written where the error is made to the part of the program."""
NOT_HTTP = {ROOMS[room] for room in ("ciris", "client", "workers", "certifier/proof")}
"""Errors of these alone are no answers to requests."""
LEAD = """\
# Error codes

Every error has a code, for programs. Codes are stable; messages, fields and hints may change. When
the API answers a request with an error, the HTTP status is that of the table. A job that an error
ended has the code in `error`. Do not edit this page by hand: `python -m tests.docs.errors` makes it
from the source.

| code | HTTP status | it comes from |
|---|---|---|
"""


@cache
def codes() -> dict[str, list[str]]:
    """Maps every code to the parts of the program that it comes from. What ends a job as it is comes with the job's state in it."""
    found: dict[str, list[str]] = {code: [ROOMS[room]] for code, room in GIVEN.items()}
    for site in sites():
        for code in _written(site.code):
            part = next(name for room, name in ROOMS.items() if site.module.startswith(f"{room}/"))
            found.setdefault(code, []).append(part)
    return {code: list(dict.fromkeys(parts)) for code, parts in sorted(found.items())}


def _written(code: str | None) -> list[str]:
    if code is None:
        return []
    return [f"job_{state}" for state in ("cancelled", "failed")] if code == "job_{...}" else [code]


def page() -> str:
    """Returns the text of docs/errors.md."""
    return LEAD + "".join(f"| `{code}` | {_status(code)} | {', '.join(parts)} |\n" for code, parts in codes().items())


def _status(code: str) -> str:
    if set(codes()[code]) <= NOT_HTTP:
        return ""
    return str(status_of(code).value)


if __name__ == "__main__":
    PAGE.write_text(page())
