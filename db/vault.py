"""Secrets that the service must know again are encrypted with a key that is not in the database. So a backup alone does not give them away.

The key is the setting ``secret_key``. ``ciris up`` makes one and keeps it in a file of the data directory that only its user may read.
"""

from __future__ import annotations

import base64
import os
import secrets
from pathlib import Path

from cryptography.exceptions import InvalidTag
from cryptography.hazmat.primitives.ciphers.aead import AESGCM

from certifier.errors import CirisError
from db.settings import settings

_MARK = "v1."
_NONCE, _KEY = 12, 32
_HINT = "set CIRIS_SECRET_KEY to what `openssl rand -base64 32` prints, the same for the API and the control worker"


class Vault:
    """Encrypts with the first of its keys, and decrypts with whichever fits (AES-256-GCM).

    Args:
        keys: base64 of 32 bytes each, the newest first, with commas between. It may be empty: then nothing can be encrypted.

    Raises:
        CirisError: secret_key, when one is no key.
    """

    def __init__(self, keys: str) -> None:
        self._keys = [_key(text) for text in keys.split(",") if text.strip()]

    @property
    def usable(self) -> bool:
        """Says whether there is a key."""
        return bool(self._keys)

    def check(self) -> None:
        """Refuses to go on without a key.

        Raises:
            CirisError: no_secret_key.
        """
        if not self._keys:
            raise CirisError("no_secret_key", "this service has no key to keep secrets with", field="webhook.secret", hint=_HINT)

    def seal(self, secret: str, about: str) -> str:
        """Returns the secret encrypted. It can be decrypted only together with the same text ``about``.

        Raises:
            CirisError: no_secret_key.
        """
        self.check()
        nonce = secrets.token_bytes(_NONCE)
        return _MARK + base64.b64encode(nonce + AESGCM(self._keys[0]).encrypt(nonce, secret.encode(), about.encode())).decode()

    def open(self, sealed: str, about: str) -> str:
        """Returns the secret again. One that an earlier version has stored is not encrypted.

        Raises:
            CirisError: secret_lost, when no key fits.
        """
        if not is_sealed(sealed):
            return sealed
        data = base64.b64decode(sealed.removeprefix(_MARK))
        for key in self._keys:
            try:
                return AESGCM(key).decrypt(data[:_NONCE], data[_NONCE:], about.encode()).decode()
            except InvalidTag:
                continue
        raise CirisError("secret_lost", "no key fits a secret", field="CIRIS_SECRET_KEY", hint="add the key of before, after a comma")


def is_sealed(stored: str) -> bool:
    """Says whether what is stored is encrypted."""
    return stored.startswith(_MARK)


def vault() -> Vault:
    """Returns the vault of the settings.

    Raises:
        CirisError: secret_key.
    """
    return Vault(settings().secret_key)


def kept_key(path: Path) -> str:
    """Returns the key in this file, which it makes with a new key if there is none. Only the file's owner may read it.

    A disk without room leaves no file, or the empty one that an earlier version has left: no secret was ever encrypted with that.

    Raises:
        CirisError: no_room, when the key cannot be written.
    """
    if kept := path.read_text().strip() if path.exists() else "":
        return kept
    key, partial = base64.b64encode(secrets.token_bytes(_KEY)).decode(), path.with_name(f"{path.name}.partial")
    try:
        with open(os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w") as file:
            file.write(key + "\n")
            file.flush()
            os.fsync(file.fileno())
        partial.replace(path)
    except OSError as error:
        problem, hint = f"the key of secrets, {path}, cannot be written: {error.strerror}", "free some room there"
        raise CirisError("no_room", problem, field="--data", hint=hint) from None
    return key


def _key(text: str) -> bytes:
    try:
        key = base64.b64decode(text.strip().replace("-", "+").replace("_", "/"), validate=True)
    except ValueError:
        key = b""
    if len(key) != _KEY:
        raise CirisError("secret_key", "this is not the base64 of 32 bytes", field="CIRIS_SECRET_KEY", hint=_HINT)
    return key
