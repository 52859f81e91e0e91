"""The service's fixtures, a real browser, and axe, which looks for what keeps people out."""

from __future__ import annotations

import os
import socket
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.api.conftest import busy, certified, client, database, environment, planar, planar_region, region, running, scene, url, worker

__all__ = [
    "barriers",
    "browser",
    "busy",
    "certified",
    "client",
    "database",
    "environment",
    "page",
    "planar",
    "planar_region",
    "region",
    "running",
    "scene",
    "url",
    "worker",
]

INSTALLED = Path(sys.prefix) / "browser"


@pytest.fixture(scope="module")
def outside() -> Iterator[tuple[str, list[str]]]:
    """A proxy for all that is not on this machine: its address, and the first line of whatever asks it. It lets nothing through."""
    asked: list[str] = []
    with socket.create_server(("127.0.0.1", 0)) as listening:

        def refuse() -> None:
            while True:
                try:
                    connection, _ = listening.accept()
                except OSError:
                    return
                with connection:
                    asked.append(connection.recv(4096).partition(b"\r\n")[0].decode(errors="replace"))

        thread = threading.Thread(target=refuse)
        thread.start()
        yield f"http://127.0.0.1:{listening.getsockname()[1]}", asked
        listening.shutdown(socket.SHUT_RDWR)
        thread.join()


@pytest.fixture(scope="module")
def browser(outside: tuple[str, list[str]]) -> Iterator[Any]:
    """The Chromium that ``requirements/install test`` installs, the same on every machine, or the one that CHROMIUM_BIN names.

    Whatever it asks of another machine, in whichever page, worker or socket, goes to a proxy that lets nothing through, and fails the test.
    """
    from playwright.sync_api import sync_playwright

    installed = INSTALLED / "chromium"
    chromium = os.environ.get("CHROMIUM_BIN", installed)
    if chromium == installed and not installed.exists():
        pytest.skip(f"no Chromium at {installed}: requirements/install test says why; CHROMIUM_BIN may name another one")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, proxy={"server": outside[0], "bypass": "127.0.0.1"})
        yield browser
        browser.close()
    assert outside[1] == [], "the browser asks nobody but this machine"


@pytest.fixture
def complaints() -> list[str]:
    """What the page complains of; a test that expects a complaint takes it out."""
    return []


@pytest.fixture
def page(browser: Any, url: str, complaints: list[str], outside: tuple[str, list[str]]) -> Iterator[Any]:
    """A page that must not complain, nor ask anybody but the service; closed before the service is."""
    context = browser.new_context()
    page = context.new_page()
    page.on("console", lambda message: complaints.append(message.text) if message.type == "error" else None)
    page.on("pageerror", lambda error: complaints.append(str(error)))
    here = ("http://127.0.0.1:", "ws://127.0.0.1:", "blob:")
    page.on("websocket", lambda websocket: None if websocket.url.startswith(here) else complaints.append(websocket.url))
    context.on("request", lambda request: None if request.url.startswith(here) else complaints.append(request.url))
    yield page
    context.close()
    assert complaints == []
    assert outside[1] == []


@pytest.fixture(scope="session")
def barriers() -> Callable[[Any], list[str]]:
    """Returns a function from a page to the rules of axe-core that it violates, each with the first place where it does."""
    script = (INSTALLED / "axe.min.js").read_text()

    def violations(page: Any) -> list[str]:
        # Inserted through the debugger, which the page's security policy does not bind.
        page.evaluate(script)
        found = page.evaluate("axe.run()")["violations"]
        return [f"{rule['id']}: {rule['nodes'][0]['html'][:200]}" for rule in found]

    return violations
