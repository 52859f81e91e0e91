"""Sessions, and signing in at an identity provider: at a real one, and at one that lies."""

from __future__ import annotations

import base64
import hashlib
import hmac
import json
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from urllib.parse import parse_qs, urlsplit

import httpx2
import pytest
from fastapi.testclient import TestClient
from joserfc import jwt
from joserfc.jwk import OctKey, RSAKey
from sqlalchemy import select, update

from api import oidc
from api.access import AGAIN_SECONDS, COOKIE, KEYS_SECONDS
from api.app import create_app
from api.guard import SIGN_INS_PER_SECOND
from api.limits import BURST_SECONDS
from certifier.errors import CirisError
from certifier.model import Scene
from db import audit, grants, keys, projects
from db.grants import Kind
from db.keys import Scope
from db.models import DEFAULT_PROJECT, SessionRow
from db.session import Database
from db.settings import Settings, chosen
from db.types import utcnow
from tests.api.conftest import BASE_URL
from tests.api.test_access import a_key, bearer, readings
from tests.api.test_jobs import GROW
from tests.identity import CLIENT_ID, CLIENT_SECRET, Liar, RealProvider, lying_provider, real_provider
from tests.services import Queue
from tests.workers.service import eventually

HTML = {"Accept": "text/html"}
ALICE = {"email": "Alice@example.org", "email_verified": True, "groups": ["robotics", "welders"]}


@pytest.fixture(scope="module")
def provider() -> Iterator[RealProvider]:
    with real_provider() as provider:
        provider.knows("alice-1", **ALICE)
        yield provider


@pytest.fixture
def liar() -> Iterator[Liar]:
    with lying_provider() as liar:
        yield liar


def a_service(database: Database, queue: Queue, environment: pytest.MonkeyPatch, issuer: str) -> TestClient:
    queue.flush()
    environment.setenv("CIRIS_REDIS_URL", queue.url)
    environment.setenv("CIRIS_OIDC_ISSUER", issuer)
    environment.setenv("CIRIS_OIDC_CLIENT_ID", CLIENT_ID)
    environment.setenv("CIRIS_OIDC_CLIENT_SECRET", CLIENT_SECRET)
    return TestClient(create_app(database), base_url=BASE_URL, headers=HTML, follow_redirects=False)


@pytest.fixture
def service(database: Database, queue: Queue, environment: pytest.MonkeyPatch, provider: RealProvider) -> Iterator[TestClient]:
    """A service whose people sign in at the real provider."""
    with a_service(database, queue, environment, provider.url) as client:
        yield client


@pytest.fixture
def fooled(database: Database, queue: Queue, environment: pytest.MonkeyPatch, liar: Liar) -> Iterator[TestClient]:
    """A service whose people sign in at the provider that lies."""
    with a_service(database, queue, environment, liar.url) as client:
        yield client


def grant(database: Database, project: str, kind: Kind, name: str, scope: Scope) -> None:
    with database.write() as session:
        if project not in {row.name for row in projects.all_of(session)}:
            projects.add(session, project)
        grants.add(session, project, kind, name, scope)


def withdraw(database: Database, project: str, kind: Kind, name: str) -> None:
    with database.write() as session:
        grants.revoke(session, project, kind, name)


def path_of(address: str) -> str:
    parts = urlsplit(address)
    return f"{parts.path}?{parts.query}"


def with_cookie(client: TestClient, name: str, value: str) -> httpx2.Response:
    """The answer to a request that has this cookie alone."""
    client.cookies.clear()
    client.cookies.set(name, value)
    return client.get("/v1/jobs")


def sign_in(client: TestClient, provider: RealProvider, subject: str = "alice-1", next: str = "/jobs") -> str:
    """Signs a person in, as far as the choice of a project, and returns where the last answer leads."""
    away = client.get("/login/oidc", params={"next": next})
    assert away.status_code == 303, away.text
    back = client.get(path_of(provider.lets_in(away.headers["location"], subject)))
    assert back.status_code == 200, back.text
    assert f"url=/login/project?next={next.replace('/', '%2F')}" in back.text.replace("next=/", "next=%2F")
    chosen = client.get(f"/login/project?next={next}")
    return chosen.headers.get("location", chosen.text)


def scope_of(client: TestClient) -> tuple[int, str | None, str | None]:
    """The status of a question about the own project, its name, and what the caller may do there."""
    answer = client.get("/v1/project")
    said = answer.json()
    return answer.status_code, said.get("name"), said.get("scope")


def test_a_person_signs_in_works_and_signs_out(service: TestClient, provider: RealProvider, database: Database, scene: Scene) -> None:
    grant(database, "welding", Kind.PERSON, "alice@example.org", Scope.SUBMIT)
    away = service.get("/jobs/x")
    assert (away.status_code, away.headers["location"]) == (303, "/login?next=/jobs/x")
    page = service.get(away.headers["location"])
    assert f"Sign in with {urlsplit(provider.url).netloc}</a>" in page.text
    assert 'href="/login/oidc?next=/jobs/x"' in page.text
    assert sign_in(service, provider) == "/jobs"
    assert scope_of(service) == (200, "welding", "submit")
    assert "alice@example.org · " in (page := service.get("/")).text
    assert "Sign out" in page.text
    token = service.cookies[COOKIE]
    assert service.post("/logout").status_code == 303
    time.sleep(KEYS_SECONDS)
    assert with_cookie(service, COOKIE, token).status_code == 401


def test_the_service_is_not_open_where_people_sign_in(service: TestClient, database: Database) -> None:
    assert service.get("/v1/jobs").status_code == 401
    keys.check_bind(Settings(host="0.0.0.0"))  # although nobody has made a key


def test_the_cookie_is_a_session_of_which_the_database_has_the_hash(client: TestClient, database: Database) -> None:
    key = a_key(database, Scope.READ)
    answer = client.post("/login", data={"key": key}, follow_redirects=False)
    token = client.cookies[COOKIE]
    _, key_id, secret = key.split("_", 2)  # the secret may have more of them
    assert secret not in str(answer.headers)
    assert len(base64.urlsafe_b64decode(token + "=")) == 32
    with database.read() as session:
        (row,) = session.scalars(select(SessionRow))
        assert token not in str(vars(row))
        assert (row.key_id, row.subject, row.grant_id) == (key_id, None, None)
        assert 11.9 < (row.expires_at - utcnow()) / timedelta(hours=1) <= 12.0
    assert client.get("/v1/jobs").status_code == 200
    for name in (COOKIE, "ciris_key"):
        assert with_cookie(client, name, key).status_code == 401, "no key is taken from a cookie"


def signed_in(client: TestClient, database: Database, **how: float) -> str:
    """Signs in with a new key, and returns its name."""
    name = f"key{time.monotonic_ns()}"
    with database.write() as session:
        key = keys.add(session, name, Scope.READ, **how)
    assert client.post("/login", data={"key": key}, follow_redirects=False).status_code == 303
    assert client.get("/v1/jobs").status_code == 200
    return name


def test_a_session_ends_with_its_key_and_in_time(client: TestClient, database: Database) -> None:
    name = signed_in(client, database)
    with database.write() as session:
        keys.revoke(session, name)
    eventually(lambda: client.get("/v1/jobs").status_code == 401, "the session ends with its key")
    signed_in(client, database, days=4.0 / 86400)
    time.sleep(4.2)
    assert client.get("/v1/jobs").status_code == 401
    signed_in(client, database)
    with database.write() as session:
        session.execute(update(SessionRow).values(expires_at=utcnow()))
    eventually(lambda: client.get("/v1/jobs").status_code == 401, "the session expires")
    assert client.get("/v1/jobs").json()["detail"].startswith("this session has ended")


def test_requests_of_a_session_do_not_read_the_database(client: TestClient, database: Database) -> None:
    signed_in(client, database)
    with readings(database, "FROM sessions") as seen:
        began = time.monotonic()
        for _ in range(50):
            assert client.get("/v1/project").status_code == 200
        assert len(seen) <= 2 + 2 * (time.monotonic() - began) / KEYS_SECONDS
    with readings(database, "FROM sessions") as seen:
        began = time.monotonic()
        assert {with_cookie(client, COOKIE, f"{i:043d}").status_code for i in range(50)} == {401}
        assert len(seen) <= 2 + 1.2 * (time.monotonic() - began) / AGAIN_SECONDS


def test_the_use_of_a_session_is_that_of_its_key(client: TestClient, database: Database) -> None:
    name = signed_in(client, database)

    def noted() -> bool:
        with database.read() as session:
            (row,) = session.scalars(select(SessionRow))
            return row.last_used_at is not None and next(key for key in keys.newest(session) if key.name == name).last_used_at is not None

    eventually(noted, "the use is noted")


def test_an_open_service_takes_no_notice_of_the_session_of_another_one(client: TestClient) -> None:
    assert with_cookie(client, COOKIE, 43 * "a").status_code == 200


def test_signing_in_again_ends_the_session_of_before(client: TestClient, database: Database) -> None:
    signed_in(client, database)
    signed_in(client, database)
    with database.read() as session:
        assert len(session.scalars(select(SessionRow)).all()) == 1


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "https://evil.example"},
        {"Origin": "null"},
        {"Sec-Fetch-Site": "cross-site"},
        {"Sec-Fetch-Site": "same-site", "Origin": "http://127.0.0.1:3000"},
        {"Sec-Fetch-Site": "same-site"},
    ],
)
def test_other_sites_change_nothing(client: TestClient, database: Database, headers: dict[str, str]) -> None:
    signed_in(client, database)
    for method, path in (
        ("POST", "/v1/jobs"),
        ("DELETE", "/v1/keys/x"),
        ("POST", "/logout"),
        ("POST", "/login"),
        ("POST", "/login/project"),
    ):
        answer = client.request(method, path, headers=headers)
        assert (answer.status_code, answer.json()["code"]) == (403, "cross_site"), path
    assert client.get("/v1/jobs").status_code == 200
    own = {"Origin": BASE_URL, "Sec-Fetch-Site": "same-origin"}
    assert client.post("/logout", headers=own, follow_redirects=False).status_code == 303


def test_cookies_say_that_other_sites_may_not_send_them(service: TestClient, provider: RealProvider, database: Database) -> None:
    grant(database, "welding", Kind.PERSON, "alice@example.org", Scope.READ)
    away = service.get("/login/oidc")
    attempt = away.headers["set-cookie"].lower()
    assert ("httponly" in attempt, "samesite=lax" in attempt, "path=/login/oidc" in attempt) == (True, True, True)
    back = service.get(path_of(provider.lets_in(away.headers["location"], "alice-1")))
    for answer in (back, service.get("/login/project")):
        cookie = answer.headers["set-cookie"].lower().split(", ciris_sign_in")[0]
        assert (COOKIE in cookie, "httponly" in cookie, "samesite=strict" in cookie) == (True, True, True)


def test_a_person_chooses_among_projects_and_changes_over(service: TestClient, provider: RealProvider, database: Database) -> None:
    grant(database, "welding", Kind.GROUP, "robotics", Scope.SUBMIT)
    grant(database, "welding", Kind.GROUP, "welders", Scope.READ)
    grant(database, "paint", Kind.PERSON, "alice@example.org", Scope.ADMIN)
    grant(database, "other", Kind.GROUP, "others", Scope.ADMIN)
    grant(database, "other", Kind.PERSON, "bob@example.org", Scope.ADMIN)
    page = sign_in(service, provider)
    assert [f">{choice}</button>" in page for choice in ("paint (admin)", "welding (submit)", "other (admin)")] == [True, True, False]
    assert scope_of(service)[0] == 401, "nothing is shown before a project is chosen"
    assert service.get("/").headers["location"] == "/login?next=/"
    assert service.get("/login?next=/").headers["location"] == "/login/project?next=/"
    assert service.post("/login/project", data={"project": "other"}).headers["location"] == "/login/project?next=/"
    assert scope_of(service)[0] == 401
    for project, scope in (("welding", "submit"), ("paint", "admin")):
        before = service.cookies[COOKIE]
        answer = service.post("/login/project", data={"project": project, "next": "/regions"})
        assert answer.headers["location"] == "/regions"
        assert scope_of(service) == (200, project, scope), "at once"
        assert service.cookies[COOKIE] != before
    assert 'aria-current="true">paint (admin)' in service.get("/login/project").text
    with database.read() as session:
        assert len(session.scalars(select(SessionRow)).all()) == 1


def test_who_has_no_grant_is_told_whom_to_ask(service: TestClient, provider: RealProvider, database: Database) -> None:
    grant(database, "welding", Kind.PERSON, "alice@example.org", Scope.READ)
    provider.knows("mallory", email="alice@example.org", email_verified=False, groups="robotics")
    provider.knows("alice@example.org", groups=[1, {"robotics": 1}])
    for subject in ("mallory", "alice@example.org"):
        page = sign_in(service, provider, subject)
        assert "no project of this service lets you in" in page
        # A grant to the other one would let in whoever has that address.
        assert ("ciris project grant PROJECT --person mallory" in page) == (subject == "mallory")
        assert "--person alice@example.org" not in page
        assert service.get("/login/project").status_code == 403
        assert scope_of(service)[0] == 401
    grant(database, "welding", Kind.PERSON, "mallory", Scope.READ)
    assert sign_in(service, provider, "mallory") == "/jobs"


def test_a_withdrawn_grant_ends_its_sessions_rights_within_seconds(service: TestClient, provider: RealProvider, database: Database) -> None:
    grant(database, "welding", Kind.GROUP, "robotics", Scope.SUBMIT)
    grant(database, "welding", Kind.PERSON, "alice@example.org", Scope.READ)
    sign_in(service, provider)
    assert scope_of(service) == (200, "welding", "submit")
    grant(database, "welding", Kind.GROUP, "robotics", Scope.ADMIN)
    time.sleep(KEYS_SECONDS)
    assert scope_of(service) == (200, "welding", "admin")
    withdraw(database, "welding", Kind.GROUP, "robotics")
    time.sleep(KEYS_SECONDS)
    assert scope_of(service)[0] == 401
    assert service.get(service.get(service.get("/regions").headers["location"]).headers["location"]).headers["location"] == "/regions"
    assert scope_of(service) == (200, "welding", "read"), "by the other grant"
    withdraw(database, "welding", Kind.PERSON, "alice@example.org")
    time.sleep(KEYS_SECONDS)
    assert scope_of(service)[0] == 401
    assert "lets you in" in service.get("/login/project").text


def test_the_audit_log_names_the_person(service: TestClient, provider: RealProvider, database: Database, scene: Scene) -> None:
    grant(database, DEFAULT_PROJECT, Kind.PERSON, "alice@example.org", Scope.ADMIN)
    sign_in(service, provider)
    assert service.delete(f"/v1/scenes/{scene.hash[:16]}?dependents=delete").status_code == 204
    with database.read() as session:
        assert audit.page(session).rows[0].who == "alice@example.org (OIDC, subject alice-1)"


def test_a_person_may_make_the_first_key(service: TestClient, provider: RealProvider, database: Database) -> None:
    grant(database, "welding", Kind.PERSON, "alice@example.org", Scope.ADMIN)
    sign_in(service, provider)
    assert 'id="make-key"' in service.get("/project").text
    key = service.post("/v1/keys", json={"name": "planner", "scope": "read"}).json()["key"]
    assert service.get("/v1/project", headers=bearer(key)).json()["name"] == "welding"


def test_idempotency_keys_of_people_are_their_own(service: TestClient, provider: RealProvider, database: Database, scene: Scene) -> None:
    ids = []
    provider.knows("bob", email="bob@example.org", email_verified="true")
    for subject, name in (("alice-1", "alice@example.org"), ("bob", "bob@example.org")):
        grant(database, DEFAULT_PROJECT, Kind.PERSON, name, Scope.SUBMIT)
        sign_in(service, provider, subject)
        ids += [service.post("/v1/jobs", json=GROW, headers={"Idempotency-Key": "1"}).json()["id"] for _ in range(2)]
        service.cookies.clear()
    assert (ids[0] == ids[1], ids[2] == ids[3], ids[0] == ids[2]) == (True, True, False)


def test_a_scope_that_is_missing_is_said_to_people_too(service: TestClient, provider: RealProvider, database: Database) -> None:
    grant(database, "welding", Kind.PERSON, "alice@example.org", Scope.READ)
    sign_in(service, provider)
    refused = service.post("/v1/jobs", json=GROW)
    assert (refused.status_code, refused.json()["code"]) == (403, "scope_missing")
    assert "ciris project grant welding --person alice@example.org --scope submit" in refused.json()["hint"]


def test_a_callback_counts_once_and_only_in_the_browser_that_began(service: TestClient, provider: RealProvider, database: Database) -> None:
    away = service.get("/login/oidc")
    back = path_of(provider.lets_in(away.headers["location"], "alice-1"))
    attempt = dict(service.cookies)
    service.cookies.clear()
    for forged in (back, "/login/oidc/callback", "/login/oidc/callback?code=x&state=", back.replace("state=", "state=x")):
        answer = service.get(forged)
        assert (answer.status_code, "nobody was signed in: this browser did not begin" in answer.text) == (403, True)
    service.cookies.update(attempt)
    assert service.get(back.replace("state=", "state=x")).status_code == 403
    assert service.get(back).status_code == 200
    assert service.get(back).status_code == 403, "the browser has forgotten the attempt"
    service.cookies.update(attempt)
    replayed = service.get(back)
    assert (replayed.status_code, "does not take the code" in replayed.text) == (403, True)


def test_who_is_refused_at_the_provider_reads_why(service: TestClient) -> None:
    away = service.get("/login/oidc")
    state = parse_qs(urlsplit(away.headers["location"]).query)["state"][0]
    answer = service.get("/login/oidc/callback", params={"state": state, "error": "access_denied<script>"})
    assert (answer.status_code, "&#39;access_denied&lt;script&gt;&#39;" in answer.text) == (403, True)


@pytest.mark.parametrize(
    "path", ["//evil.example", "https://evil.example", "/\\evil.example", "/a\nb", '/"><script>', "javascript:alert(1)"]
)
def test_signing_in_at_the_provider_leads_nowhere_else(service: TestClient, provider: RealProvider, database: Database, path: str) -> None:
    grant(database, "welding", Kind.PERSON, "alice@example.org", Scope.READ)
    assert "evil" not in (page := service.get("/login", params={"next": path}).text)
    assert "<script>" not in page
    away = service.get("/login/oidc", params={"next": path})
    back = service.get(path_of(provider.lets_in(away.headers["location"], "alice-1")))
    assert "url=/login/project?next=/" in back.text
    assert "evil" not in back.text
    assert service.get("/login/project", params={"next": path}).headers["location"] == "/"
    assert service.post("/login/project", data={"project": "welding", "next": path}).headers["location"] == "/"


def attempt(fooled: TestClient) -> dict[str, str]:
    """Begins to sign in at the provider that lies, and returns what it was sent."""
    away = fooled.get("/login/oidc")
    assert away.status_code == 303, away.text
    return {name: values[0] for name, values in parse_qs(urlsplit(away.headers["location"]).query).items()}


def come_back(fooled: TestClient, sent: dict[str, str]) -> tuple[int, str]:
    answer = fooled.get("/login/oidc/callback", params={"code": "c", "state": sent["state"]})
    assert (answer.status_code == 200) == (COOKIE in fooled.cookies)
    return answer.status_code, answer.text


def test_a_true_token_lets_in_with_the_secret_of_the_challenge(fooled: TestClient, liar: Liar) -> None:
    liar.said["scopes_supported"] = ["openid", "groups"]
    sent = attempt(fooled)
    assert (sent["response_type"], sent["client_id"], sent["scope"]) == ("code", CLIENT_ID, "openid email profile groups")
    assert sent["redirect_uri"] == f"{BASE_URL}/login/oidc/callback"
    liar.knows(sent["nonce"])
    assert come_back(fooled, sent)[0] == 200
    (form,) = liar.forms
    assert base64.b64decode(form["login"].split()[1]).decode() == "ciris:the+secret+of+the+client"
    assert form["redirect_uri"] == sent["redirect_uri"]
    challenge = oidc._base64(hashlib.sha256(form["code_verifier"].encode()).digest())
    assert (sent["code_challenge"], sent["code_challenge_method"]) == (challenge, "S256")
    assert len({sent["state"], sent["nonce"], form["code_verifier"]}) == 3


@pytest.mark.parametrize(
    "claims",
    [
        {"nonce": "another"},
        {"nonce": None},
        {"exp": -600},
        {"exp": None},
        {"iat": 6000},
        {"aud": "another"},
        {"aud": None},
        {"aud": []},
        {"aud": [CLIENT_ID, "another"], "azp": "another"},
        {"aud": [CLIENT_ID, "another"]},
        {"iss": "https://evil.example"},
        {"iss": None},
        {"sub": None},
        {"sub": ""},
        {"sub": 5},
        {"sub": "x" * 256},
        {"sub": "a\nb"},
    ],
    ids=str,
)
def test_a_token_with_wrong_claims_lets_nobody_in(fooled: TestClient, liar: Liar, claims: dict[str, object]) -> None:
    """Times are seconds from now on: workers that run the tests side by side have to name them alike."""
    sent = attempt(fooled)
    now = time.time()
    times = {name: now + value for name, value in claims.items() if name in ("exp", "iat") and isinstance(value, int)}
    liar.knows(sent["nonce"], **(claims | {name: int(value) for name, value in times.items()}))
    status, text = come_back(fooled, sent)
    assert (status, "nobody was signed in" in text) == (403, True)


def forged(liar: Liar, how: str) -> str:
    """A token with the right claims and a wrong signature."""
    part = {"header": {"alg": "none", "kid": liar.key.kid}, "claims": liar.claims}
    parts = [oidc._base64(json.dumps(part[name]).encode()) for name in ("header", "claims")]
    true = liar.signed(liar.claims)
    match how:
        case "none":
            return ".".join([*parts, ""])
        case "none with a signature":
            return ".".join([*parts, true.split(".")[2]])
        case "another's key":
            return liar.signed(liar.claims, RSAKey.generate_key(2048, {"kid": liar.key.kid}))
        case "the public key as a secret":
            head = oidc._base64(json.dumps({"alg": "HS256", "kid": liar.key.kid}).encode())
            digest = hmac.digest(liar.key.as_pem(private=False), f"{head}.{parts[1]}".encode(), "sha256")
            return f"{head}.{parts[1]}.{oidc._base64(digest)}"
        case "the client's secret":
            return jwt.encode({"alg": "HS256"}, liar.claims, OctKey.import_key(CLIENT_SECRET), ["HS256"])
        case "changed claims":
            return ".".join([true.split(".")[0], oidc._base64(json.dumps(liar.claims | {"sub": "root"}).encode()), true.split(".")[2]])
        case "a key that comes along":
            key = RSAKey.generate_key(2048, auto_kid=True)
            return jwt.encode({"alg": "RS256", "jwk": key.as_dict(private=False)}, liar.claims, key)
    return how


@pytest.mark.parametrize(
    "how",
    [
        "none",
        "none with a signature",
        "another's key",
        "the public key as a secret",
        "the client's secret",
        "changed claims",
        "a key that comes along",
        "a.b",
        "...",
    ],
)
def test_a_forged_token_lets_nobody_in(fooled: TestClient, liar: Liar, how: str) -> None:
    sent = attempt(fooled)
    liar.knows(sent["nonce"])
    liar.token = forged(liar, how)
    status, text = come_back(fooled, sent)
    assert (status, "token cannot be believed" in text) == (403, True)


def test_a_new_key_of_the_provider_is_asked_for(fooled: TestClient, liar: Liar, monkeypatch: pytest.MonkeyPatch) -> None:
    sent = attempt(fooled)
    liar.key = RSAKey.generate_key(2048, auto_kid=True)
    liar.knows(sent["nonce"])
    assert come_back(fooled, sent)[0] == 403, "it was asked a moment ago"
    monkeypatch.setattr(oidc, "AGAIN_SECONDS", 0.0)
    assert come_back(fooled, sent)[0] == 200
    assert liar.asked.count("/jwks_uri") == 2


def test_what_the_token_does_not_say_is_asked_for(fooled: TestClient, liar: Liar, database: Database) -> None:
    for sub, expected in (("1234", "alice@example.org"), ("4321", None)):
        sent = attempt(fooled)
        liar.knows(sent["nonce"])
        liar.userinfo = {"sub": sub, **ALICE}
        assert come_back(fooled, sent)[0] == 200
        with database.read() as session:
            assert [row.email for row in session.scalars(select(SessionRow))] == [expected]


@pytest.mark.parametrize(
    ("token", "userinfo"),
    [
        ({"email": "alice@example.org"}, {"email": "mallory@example.org", "email_verified": True}),
        ({"email_verified": True}, {"email": "alice@example.org"}),
        ({"email": "alice@example.org", "email_verified": False}, {"email": "alice@example.org", "email_verified": True}),
        ({"email": "\u212aate@example.org", "email_verified": True}, {}),
    ],
    ids=["address of the token", "address of userinfo", "the token says no", "a letter that is K only in capitals"],
)
def test_an_address_counts_where_the_same_document_says_that_it_is_verified(
    fooled: TestClient, liar: Liar, database: Database, token: dict[str, object], userinfo: dict[str, object]
) -> None:
    sent = attempt(fooled)
    liar.knows(sent["nonce"], **token)
    liar.userinfo = {"sub": liar.claims["sub"], **userinfo}
    assert come_back(fooled, sent)[0] == 200
    with database.read() as session:
        (email,) = session.scalars(select(SessionRow.email))
    assert email in (None, "mallory@example.org")


def of_provider(fooled: TestClient) -> tuple[int, str]:
    answer = fooled.get("/login/oidc")
    assert ("<h1>" in answer.text, answer.headers.get("retry-after")) == (True, "5")
    return answer.status_code, answer.text


@pytest.mark.parametrize(
    ("said", "why"),
    [
        ({"issuer": "https://evil.example"}, "calls itself"),
        ({"jwks_uri": "http://keys.example"}, "its jwks_uri is no https address"),
        ({"authorization_endpoint": None}, "its authorization_endpoint is no https address"),
        ({"padding": 2**20 * "x"}, "its answer is too long"),
    ],
)
def test_a_provider_that_cannot_be_used_is_said_so_on_a_page(fooled: TestClient, liar: Liar, said: dict[str, str], why: str) -> None:
    liar.said = said
    status, text = of_provider(fooled)
    assert (status, why in text) == (503, True)


@pytest.mark.parametrize("keys_", [[], [{"kty": "RSA"}], ["x"]], ids=str)
def test_a_provider_without_keys_is_said_so(fooled: TestClient, liar: Liar, keys_: list[object]) -> None:
    liar.keys = keys_
    status, text = of_provider(fooled)
    assert (status, "its keys cannot be read" in text) == (503, True)


def test_a_provider_that_fails_between_is_said_so(fooled: TestClient, liar: Liar) -> None:
    sent = attempt(fooled)
    liar.status = 500
    status, text = come_back(fooled, sent)
    assert (status, "invalid_grant &lt;b&gt;used" in text) == (403, True)


def test_a_slow_provider_holds_nobody_else(fooled: TestClient, liar: Liar, database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(oidc, "SECONDS", 5.0)
    key = a_key(database, Scope.READ)
    assert fooled.get("/v1/project", headers=bearer(key)).status_code == 200
    liar.delay = 6.0
    with ThreadPoolExecutor(60) as threads:
        began = time.monotonic()
        waiting = [threads.submit(of_provider, fooled) for _ in range(50)]
        time.sleep(0.3)
        for _ in range(5):
            asked = time.monotonic()
            assert fooled.get("/v1/project", headers=bearer(key)).status_code == 200
            assert time.monotonic() - asked < 4.0
        assert {future.result()[0] for future in waiting} == {503}
        assert time.monotonic() - began < 15.0
    assert len(liar.asked) == 1, "it was asked once for all of them"


def test_nobody_has_the_service_ask_the_provider_without_end(fooled: TestClient, liar: Liar) -> None:
    liar.status, sent = 400, attempt(fooled)
    cookies, began = dict(fooled.cookies), time.monotonic()
    answers = []
    for _ in range(40):
        fooled.cookies.update(cookies)
        answers.append(fooled.get("/login/oidc/callback", params={"code": "c", "state": sent["state"]}))
    allowed = SIGN_INS_PER_SECOND * (BURST_SECONDS + time.monotonic() - began)
    assert {answer.status_code for answer in answers} == {403, 429}
    assert len(liar.forms) <= allowed + 1
    assert {answer.headers["retry-after"] for answer in answers if answer.status_code == 429} == {"1"}
    assert fooled.get("/login").status_code == 200, "other pages are answered"


def test_a_provider_that_is_away_is_said_so(database: Database, queue: Queue, environment: pytest.MonkeyPatch) -> None:
    with a_service(database, queue, environment, "http://127.0.0.1:9") as client:
        status, text = of_provider(client)
        assert (status, "it does not answer" in text) == (503, True)
        assert client.get("/login").status_code == 200


def test_without_a_provider_there_is_none(client: TestClient) -> None:
    assert client.get("/login/oidc").json()["code"] == "not_found"
    assert "Sign in with" not in client.get("/login").text


@pytest.mark.parametrize(
    ("variables", "wrong"),
    [
        ({"CIRIS_OIDC_ISSUER": "http://login.example", "CIRIS_OIDC_CLIENT_ID": "x"}, "CIRIS_OIDC_ISSUER"),
        ({"CIRIS_OIDC_ISSUER": "login.example", "CIRIS_OIDC_CLIENT_ID": "x"}, "CIRIS_OIDC_ISSUER"),
        ({"CIRIS_OIDC_ISSUER": "https://login.example"}, "CIRIS_OIDC_CLIENT_ID"),
        ({"CIRIS_SESSION_HOURS": "0"}, "CIRIS_SESSION_HOURS"),
    ],
)
def test_settings_that_cannot_be_used_are_refused(environment: pytest.MonkeyPatch, variables: dict[str, str], wrong: str) -> None:
    for name, value in variables.items():
        environment.setenv(name, value)
    with pytest.raises(CirisError) as refused:
        chosen()
    assert (refused.value.code, refused.value.field) == ("setting", wrong)
