"""People sign in at an OpenID Connect provider: the authorization code flow with PKCE, state and nonce.

The provider may be slow, away or wrong. Nobody but the person who signs in waits for it, and what it says is read to a limit and
believed only over TLS. A token counts when its signature is of one of the provider's keys, and issuer, audience, times and nonce are right.
"""

from __future__ import annotations

import asyncio
import base64
import hashlib
import json
import logging
import secrets
import time
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlencode, urlsplit

import httpx2
from joserfc import jwt
from joserfc.errors import InvalidKeyIdError, JoseError
from joserfc.jwk import KeySet

from certifier.errors import CirisError
from db.grants import MOST_LETTERS, Person
from db.settings import Settings, trustworthy

log = logging.getLogger(__name__)

ALGORITHMS = ("RS256", "RS384", "RS512", "PS256", "PS384", "PS512", "ES256", "ES384", "ES512", "Ed25519", "EdDSA")
"""Tokens may be signed so: with a key of which the provider shows the public part only."""
SECONDS = 5.0
"""The provider has this long for each of its answers."""
KEPT_SECONDS = 3600.0
"""What the provider says of itself is asked for again after this many seconds."""
AGAIN_SECONDS = 5.0
"""It is asked again at most once in this many seconds: after it failed, and when a token names a key that it had not."""
MOST_BYTES = 2**20
MOST_GROUPS = 1000
LEEWAY_SECONDS = 60
"""The provider's clock and this one may differ by this much."""
CALLBACK = "/login/oidc/callback"


class ProviderUnavailable(CirisError):
    """The provider does not answer, or answers what cannot be used."""

    def __init__(self, host: str, why: str) -> None:
        problem = f"the identity provider {host} cannot be used: {why}"
        hint = "try again in a while, or sign in with an API key at /login"
        super().__init__("provider_unavailable", problem, field="CIRIS_OIDC_ISSUER", hint=hint)


class SignInRefused(CirisError):
    """What came back from the provider lets nobody in."""

    def __init__(self, why: str) -> None:
        super().__init__("sign_in_refused", f"nobody was signed in: {why}", field="url", hint="begin again at /login")


@dataclass(frozen=True)
class Attempt:
    """One attempt of a browser to sign in. All that is secret about it follows from ``secret``, which the browser keeps in a cookie.

    Attributes:
        callback: the address to which the provider sends the browser back.
    """

    secret: str
    callback: str

    @property
    def state(self) -> str:
        return self._derived("state")

    @property
    def nonce(self) -> str:
        return self._derived("nonce")

    @property
    def verifier(self) -> str:
        return self._derived("verifier")

    def _derived(self, use: str) -> str:
        return _base64(hashlib.sha256(f"{use} {self.secret}".encode()).digest())

    @staticmethod
    def new_secret() -> str:
        return secrets.token_urlsafe(32)


@dataclass(frozen=True)
class _Provided:
    """What the provider says of itself: its addresses, and its keys."""

    endpoints: dict[str, Any]
    keys: KeySet
    read_at: float


class Provider:
    """The identity provider of the settings."""

    def __init__(self, settings: Settings) -> None:
        self.host = urlsplit(settings.oidc_issuer).netloc
        self._issuer, self._client_id = settings.oidc_issuer, settings.oidc_client_id
        self._client_secret, self._groups_claim = settings.oidc_client_secret, settings.oidc_groups_claim
        self._provided: _Provided | None = None
        self._failure: tuple[float, ProviderUnavailable] | None = None
        self._asking = asyncio.Lock()
        self._tls = httpx2.create_ssl_context()  # which takes a third of a second

    async def address(self, attempt: Attempt) -> str:
        """Returns the address at the provider where the browser signs in.

        Raises:
            ProviderUnavailable: it cannot be asked where that is.
        """
        provided = await self._ask()
        offered = provided.endpoints.get("scopes_supported")
        scopes = ["openid", "email", "profile", *(["groups"] if isinstance(offered, list) and "groups" in offered else [])]
        query = {
            "response_type": "code",
            "client_id": self._client_id,
            "redirect_uri": attempt.callback,
            "scope": " ".join(scopes),
            "state": attempt.state,
            "nonce": attempt.nonce,
            "code_challenge": _base64(hashlib.sha256(attempt.verifier.encode()).digest()),
            "code_challenge_method": "S256",
        }
        address = self._endpoint(provided, "authorization_endpoint")
        return f"{address}{'&' if urlsplit(address).query else '?'}{urlencode(query)}"

    async def person(self, attempt: Attempt, code: str) -> Person:
        """Returns the person for whom the provider made the code.

        Raises:
            ProviderUnavailable: it cannot be asked.
            SignInRefused: it does not take the code, or its token cannot be believed.
        """
        provided = await self._ask()
        form = {
            "grant_type": "authorization_code",
            "code": code,
            "redirect_uri": attempt.callback,
            "client_id": self._client_id,
            "code_verifier": attempt.verifier,
        }
        methods = provided.endpoints.get("token_endpoint_auth_methods_supported") or ["client_secret_basic"]
        basic = bool(self._client_secret) and "client_secret_basic" in methods
        if self._client_secret and not basic:
            form["client_secret"] = self._client_secret
        login = httpx2.BasicAuth(_quoted(self._client_id), _quoted(self._client_secret)) if basic else None
        status, answer = await self._fetch("POST", self._endpoint(provided, "token_endpoint"), data=form, auth=login)
        if status != httpx2.codes.OK:
            said = " ".join(str(answer[name])[:200] for name in ("error", "error_description") if name in answer)
            raise SignInRefused(f"the identity provider does not take the code ({status} {said})")
        token = answer.get("id_token")
        if not isinstance(token, str):
            raise SignInRefused("the identity provider sent no ID token")
        claims = await self._believed(token, attempt)
        if not {"email", "email_verified", self._groups_claim} <= claims.keys() and "userinfo_endpoint" in provided.endpoints:
            info = await self._userinfo(provided, answer.get("access_token"), claims["sub"])
            of_address = claims if {"email", "email_verified"} <= claims.keys() else info  # both are of one document
            claims = info | claims | {name: of_address.get(name) for name in ("email", "email_verified")}
        return self._described(claims)

    async def _believed(self, token: str, attempt: Attempt) -> dict[str, Any]:
        """Returns the claims of an ID token, once they are checked. A key that the provider has lately begun to use is asked for.

        Raises:
            SignInRefused: the token cannot be believed.
        """
        try:
            try:
                decoded = jwt.decode(token, (await self._ask()).keys, list(ALGORITHMS))
            except InvalidKeyIdError:
                decoded = jwt.decode(token, (await self._ask(newer=True)).keys, list(ALGORITHMS))
            _rules(self._issuer, self._client_id, attempt.nonce).validate(decoded.claims)
        except (JoseError, ValueError, TypeError) as error:
            raise SignInRefused(f"the identity provider's token cannot be believed ({error})") from None
        claims = dict(decoded.claims)
        if isinstance(claims["aud"], list) and len(claims["aud"]) > 1 and claims.get("azp") != self._client_id:
            raise SignInRefused("the identity provider made its token for another service")
        if not isinstance(claims["sub"], str) or not _is_name(claims["sub"]):
            raise SignInRefused("the identity provider's token names nobody")
        return claims

    async def _userinfo(self, provided: _Provided, access_token: object, subject: str) -> dict[str, Any]:
        """Returns what the provider says of a person where the token does not say it; nothing where it refuses."""
        headers = {"Authorization": f"Bearer {access_token}"}
        status, answer = await self._fetch("GET", self._endpoint(provided, "userinfo_endpoint"), headers=headers)
        return answer if status == httpx2.codes.OK and answer.get("sub") == subject else {}

    def _described(self, claims: dict[str, Any]) -> Person:
        email, verified, groups = claims.get("email"), claims.get("email_verified"), claims.get(self._groups_claim)
        usable = verified in (True, "true") and isinstance(email, str) and "@" in email and email.isascii() and _is_name(email)
        named = [group for group in groups if isinstance(group, str) and _is_name(group)][:MOST_GROUPS] if isinstance(groups, list) else []
        return Person(claims["sub"], str(email).lower() if usable else None, tuple(named))

    async def _ask(self, *, newer: bool = False) -> _Provided:
        """Returns what the provider says of itself, which is kept for a while.

        Args:
            newer: it has changed since; so it is asked again, unless that was just done.
        """
        async with self._asking:
            now, kept = time.monotonic(), AGAIN_SECONDS if newer else KEPT_SECONDS
            if self._provided is not None and now - self._provided.read_at < kept:
                return self._provided
            if self._failure is not None and now - self._failure[0] < AGAIN_SECONDS:
                raise self._failure[1]
            try:
                self._provided = await self._read(now)
            except ProviderUnavailable as error:
                log.warning("%s", error.message)
                self._failure = time.monotonic(), error
                raise
            return self._provided

    async def _read(self, now: float) -> _Provided:
        status, endpoints = await self._fetch("GET", f"{self._issuer.rstrip('/')}/.well-known/openid-configuration")
        if status != httpx2.codes.OK:
            raise ProviderUnavailable(self.host, f"it has no /.well-known/openid-configuration ({status})")
        if endpoints.get("issuer") != self._issuer:
            says = str(endpoints.get("issuer"))[:200]
            raise ProviderUnavailable(self.host, f"it calls itself {says!r}, and the setting calls it {self._issuer!r}")
        provided = _Provided(endpoints, KeySet([]), now)
        _, document = await self._fetch("GET", self._endpoint(provided, "jwks_uri"))
        try:
            return _Provided(endpoints, KeySet.import_key_set({"keys": document["keys"]}), now)
        except (JoseError, KeyError, ValueError, TypeError) as error:
            raise ProviderUnavailable(self.host, f"its keys cannot be read ({error})") from None

    def _endpoint(self, provided: _Provided, name: str) -> str:
        """Returns one of the provider's addresses.

        Raises:
            ProviderUnavailable: it has none, or one without TLS.
        """
        address = provided.endpoints.get(name)
        if not isinstance(address, str) or not trustworthy(address):
            raise ProviderUnavailable(self.host, f"its {name} is no https address")
        return address

    async def _fetch(self, method: str, url: str, **options: Any) -> tuple[int, dict[str, Any]]:
        """Returns the status of an answer and the JSON object in it; an empty one where the status is of an error and the body is no JSON.

        Raises:
            ProviderUnavailable: there is no such answer.
        """
        try:
            async with (
                asyncio.timeout(SECONDS),
                httpx2.AsyncClient(timeout=SECONDS, verify=self._tls) as client,
                client.stream(method, url, **options) as response,
            ):
                body = bytearray()
                async for part in response.aiter_bytes():
                    body += part
                    if len(body) > MOST_BYTES:
                        raise ProviderUnavailable(self.host, "its answer is too long")
        except (TimeoutError, httpx2.HTTPError, httpx2.InvalidURL) as error:
            raise ProviderUnavailable(self.host, f"it does not answer ({type(error).__name__})") from None
        try:
            document = json.loads(body)
        except (ValueError, RecursionError):
            document = None
        if isinstance(document, dict):
            return response.status_code, document
        if response.is_success:
            raise ProviderUnavailable(self.host, "its answer is no JSON object")
        return response.status_code, {}


def provider_of(settings: Settings) -> Provider | None:
    """Returns the identity provider; None where the settings name none."""
    return Provider(settings) if settings.oidc_issuer else None


def _rules(issuer: str, client_id: str, nonce: str) -> jwt.JWTClaimsRegistry:
    """Returns what the claims of an ID token have to be (OpenID Connect Core 1.0, 3.1.3.7)."""
    return jwt.JWTClaimsRegistry(
        leeway=LEEWAY_SECONDS,
        iss={"essential": True, "value": issuer},
        sub={"essential": True},
        aud={"essential": True, "value": client_id},
        exp={"essential": True},
        iat={"essential": True},
        nonce={"essential": True, "value": nonce},
    )


def _is_name(text: str) -> bool:
    return 0 < len(text) <= MOST_LETTERS and text.isprintable()


def _base64(data: bytes) -> str:
    return base64.urlsafe_b64encode(data).rstrip(b"=").decode()


def _quoted(text: str) -> str:
    """Returns a name or secret as it stands in Basic authentication (RFC 6749, 2.3.1)."""
    return urlencode({"": text})[1:]
