"""Identity providers for tests: a real one in a process of its own, and one that lies as a test tells it to."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

import httpx2
from joserfc import jwt
from joserfc.jwk import RSAKey

from certifier.orphans import die_with_parent

CLIENT_ID, CLIENT_SECRET = "ciris", "the secret of the client"


class RealProvider:
    """oidc-provider-mock: whoever asks gets in as whomever they name."""

    def __init__(self, url: str) -> None:
        self.url = url

    def knows(self, subject: str, **claims: Any) -> None:
        """Says from now on these things of a person."""
        httpx2.put(f"{self.url}/users/{subject}", json=claims).raise_for_status()

    def lets_in(self, address: str, subject: str) -> str:
        """Signs a person in at an address to which the service sent the browser, and returns the address to which it sends it back."""
        answer = httpx2.post(address, data={"sub": subject})
        assert answer.status_code == 302, answer.text
        return answer.headers["location"]


@contextmanager
def real_provider() -> Iterator[RealProvider]:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    command = [sys.executable, "-m", "oidc_provider_mock", "--port", str(port)]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL, preexec_fn=die_with_parent) as process:
        url, end = f"http://127.0.0.1:{port}", time.monotonic() + 20
        while True:
            try:
                httpx2.get(f"{url}/.well-known/openid-configuration").raise_for_status()
                break
            except httpx2.TransportError:
                assert process.poll() is None
                assert time.monotonic() < end
                time.sleep(0.05)
        yield RealProvider(url)
        process.terminate()


@dataclass
class Liar:
    """A provider that says what the test has put into its attributes.

    Attributes:
        token: an ID token to send in place of one made of ``claims``.
        said: replaces parts of what the provider says of itself.
        status: of the token endpoint's answers.
        delay: seconds before any answer.
        forms: what the token endpoint was sent.
        asked: the paths that were asked for.
    """

    url: str = ""
    key: RSAKey = field(default_factory=lambda: RSAKey.generate_key(2048, auto_kid=True))
    claims: dict[str, Any] = field(default_factory=dict)
    token: str | None = None
    said: dict[str, Any] = field(default_factory=dict)
    keys: list[Any] | None = None
    userinfo: dict[str, Any] = field(default_factory=dict)
    status: int = 200
    delay: float = 0.0
    forms: list[dict[str, str]] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)

    def answer(self, path: str) -> tuple[int, Any]:
        match path:
            case "/.well-known/openid-configuration":
                names = ("authorization_endpoint", "token_endpoint", "jwks_uri", "userinfo_endpoint")
                return 200, {"issuer": self.url, **{name: f"{self.url}/{name}" for name in names}, **self.said}
            case "/jwks_uri":
                return 200, {"keys": [self.key.as_dict(private=False)] if self.keys is None else self.keys}
            case "/userinfo_endpoint":
                return 200, self.userinfo
            case "/token_endpoint":
                if self.status != 200:
                    return self.status, {"error": "invalid_grant", "error_description": "<b>used</b>"}
                return 200, {"access_token": "x", "id_token": self.token or self.signed(self.claims)}
        return 404, {}

    def signed(self, claims: dict[str, Any], key: RSAKey | None = None) -> str:
        key = key or self.key
        return jwt.encode({"alg": "RS256", "kid": key.kid}, claims, key)

    def knows(self, nonce: str, /, **claims: Any) -> None:
        """Makes a true token of these claims the next one."""
        now = int(time.time())
        true = {"iss": self.url, "aud": CLIENT_ID, "sub": "1234", "nonce": nonce, "iat": now, "exp": now + 300}
        self.claims = {name: value for name, value in {**true, **claims}.items() if value is not None}


@contextmanager
def lying_provider() -> Iterator[Liar]:
    liar = Liar()

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self._answer()

        def do_POST(self) -> None:
            sent = parse_qs(self.rfile.read(int(self.headers.get("Content-Length", 0))).decode())
            liar.forms.append({name: values[0] for name, values in sent.items()} | {"login": self.headers.get("Authorization", "")})
            self._answer()

        def _answer(self) -> None:
            liar.asked.append(urlsplit(self.path).path)
            time.sleep(liar.delay)
            status, document = liar.answer(liar.asked[-1])
            self.send_response(status)
            self.end_headers()
            self.wfile.write(document if isinstance(document, bytes) else json.dumps(document).encode())

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    liar.url = f"http://127.0.0.1:{server.server_port}"
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    yield liar
    server.shutdown()
    server.server_close()
    thread.join()
