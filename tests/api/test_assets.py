"""For how long a browser may keep the dashboard's files."""

from __future__ import annotations

from pathlib import Path

from fastapi.testclient import TestClient

import dashboard
from api.pages.assets import ASKED, FOREVER

STATIC = Path(dashboard.__file__).parent / "static"


def test_what_has_a_digest_in_its_name_is_kept_and_everything_else_asked_for(client: TestClient) -> None:
    names = [path.relative_to(STATIC).as_posix() for path in STATIC.rglob("*") if path.is_file()]
    kept = {name: client.get(f"/static/{name}").headers["cache-control"] for name in names}
    assert {name for name, how in kept.items() if how == FOREVER} == {name for name in names if name.endswith(".js") and "-" in name}
    assert set(kept.values()) == {FOREVER, ASKED}


def test_what_has_not_changed_is_not_sent_again(client: TestClient) -> None:
    first = client.get("/static/built/main.js")
    again = client.get("/static/built/main.js", headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, again.content, again.headers["cache-control"]) == (304, b"", ASKED)


def test_what_is_not_there_is_not_kept(client: TestClient) -> None:
    answer = client.get("/static/built/main-AAAAAAAA.js")
    assert answer.status_code == 404
    assert "immutable" not in answer.headers.get("cache-control", "")
