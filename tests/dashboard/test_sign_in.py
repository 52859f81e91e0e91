"""People sign in at an identity provider, choose a project, work and sign out, in a real browser."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

import pytest
from fastapi.testclient import TestClient

from certifier.model import Scene
from db import grants, keys, projects
from db.grants import Kind
from db.keys import Scope
from db.models import DEFAULT_PROJECT
from db.session import Database
from tests.api.conftest import served
from tests.dashboard.test_browser import PHONE
from tests.identity import CLIENT_ID, CLIENT_SECRET, RealProvider, real_provider


@pytest.fixture
def provider(environment: pytest.MonkeyPatch) -> Iterator[RealProvider]:
    with real_provider() as provider:
        provider.knows("alice-1", email="alice@example.org", email_verified=True, groups=["robotics"])
        environment.setenv("CIRIS_OIDC_ISSUER", provider.url)
        environment.setenv("CIRIS_OIDC_CLIENT_ID", CLIENT_ID)
        environment.setenv("CIRIS_OIDC_CLIENT_SECRET", CLIENT_SECRET)
        yield provider


@pytest.fixture
def url(provider: RealProvider, database: Database, client: TestClient) -> Iterator[str]:
    """A service with two projects that let Alice in."""
    with database.write() as session:
        projects.add(session, "welding")
        grants.add(session, DEFAULT_PROJECT, Kind.GROUP, "robotics", Scope.SUBMIT)
        grants.add(session, "welding", Kind.PERSON, "alice@example.org", Scope.READ)
    with served(database) as url:
        yield url


@pytest.fixture(params=[{}])
def visitor(browser: Any, url: str, request: pytest.FixtureRequest) -> Iterator[Any]:
    """A page that may complain of nothing, closed before the service is.

    The provider's own pages ask another machine for a style sheet, and get an empty one.
    """
    context = browser.new_context(**request.param)
    context.route("https://cdn.jsdelivr.net/**", lambda route: route.fulfill(content_type="text/css", body=""))
    page, complaints = context.new_page(), []
    page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    yield page
    context.close()
    assert [text for text in complaints if "status of 40" not in text] == []


def sign_in(page: Any, provider: RealProvider) -> None:
    page.get_by_role("link", name=f"Sign in with {urlsplit(provider.url).netloc}").click()
    page.locator("input[name=sub]").fill("alice-1")
    page.locator("button[type=submit], input[type=submit]").first.click()


def test_a_person_signs_in_chooses_works_changes_over_and_signs_out(
    visitor: Any, url: str, provider: RealProvider, database: Database, scene: Scene
) -> None:
    page = visitor
    page.goto(f"{url}/new?scene=slider")
    page.wait_for_url(f"{url}/login?next=**")
    sign_in(page, provider)
    page.get_by_role("heading", name="Choose a project").wait_for()
    assert page.url.startswith(url)
    page.get_by_role("button", name="default (submit)").click()
    page.wait_for_url(f"{url}/new?scene=slider**")
    page.get_by_text("alice@example.org · default · submit").wait_for()
    page.get_by_role("button", name="Start the job").click()
    page.wait_for_url(lambda address: "/jobs/" in address)
    page.locator(".badge.queued").first.wait_for()
    assert page.evaluate("document.cookie") == ""

    page.get_by_role("link", name="default", exact=True).click()
    page.get_by_role("button", name="welding (read)").click()
    page.get_by_text("alice@example.org · welding · read").wait_for()
    page.goto(f"{url}/scenes")
    assert page.get_by_role("link", name="slider").count() == 0

    page.get_by_role("button", name="Sign out").click()
    page.wait_for_url(f"{url}/login")
    page.goto(f"{url}/jobs/x")
    page.wait_for_url(f"{url}/login?next=/jobs/x")


def test_another_site_reaches_nothing_with_the_cookie(
    visitor: Any, url: str, provider: RealProvider, database: Database, scene: Scene
) -> None:
    """The provider is called by the name ``localhost``, which makes it another site for cookies."""
    page, context = visitor, visitor.context
    page.goto(f"{url}/login")
    sign_in(page, provider)
    page.get_by_role("button", name="default (submit)").click()
    page.get_by_text("alice@example.org · default · submit").wait_for()
    cookies = {cookie["name"]: cookie for cookie in context.cookies()}
    assert {name: (cookie["sameSite"], cookie["httpOnly"]) for name, cookie in cookies.items()} == {"ciris_session": ("Strict", True)}
    for method, path, status in (("POST", "/logout", 403), ("GET", "/jobs", 303)):
        page.goto(provider.url.replace("127.0.0.1", "localhost"))
        with page.expect_navigation(), page.expect_response(f"{url}{path}*") as response:
            page.evaluate(
                "([action, method]) => { const form = document.documentElement.appendChild(document.createElement('form'));"
                " Object.assign(form, {action, method}); form.submit(); }",
                [f"{url}{path}", method],
            )
        assert response.value.status == status
    page.goto(url)
    page.get_by_text("alice@example.org · default · submit").wait_for()


def test_who_signs_in_with_a_key_sees_whose_it_is(page: Any, url: str, database: Database) -> None:
    with database.write() as session:
        key = keys.add(session, "reader", Scope.READ, "welding")
    page.goto(f"{url}/login")
    page.get_by_label("API key").fill(key)
    page.get_by_role("button", name="Sign in", exact=True).click()
    page.get_by_text("reader · welding · read").wait_for()


@pytest.mark.parametrize("visitor", [PHONE], indirect=True)
def test_the_pages_for_signing_in_have_no_barrier_and_fit_a_phone(
    visitor: Any, url: str, provider: RealProvider, database: Database, barriers: Any
) -> None:
    page = visitor

    def fits() -> None:
        assert barriers(page) == []
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")

    page.goto(f"{url}/login")
    fits()
    sign_in(page, provider)
    page.get_by_role("heading", name="Choose a project").wait_for()
    fits()
    page.get_by_role("button", name="welding (read)").click()
    page.get_by_role("heading", name="Jobs").wait_for()
    fits()
    with database.write() as session:
        grants.revoke(session, DEFAULT_PROJECT, Kind.GROUP, "robotics")
        grants.revoke(session, "welding", Kind.PERSON, "alice@example.org")
    page.goto(f"{url}/login")
    page.get_by_role("heading", name="No project for you yet").wait_for()
    fits()
