"""This module finds the service (by the address given, or as the embedded stack of the data directory) and the API key."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

from certifier.errors import CirisError, unreadable


def data_dir() -> Path:
    """Returns the data directory of ``ciris up`` on this machine: CIRIS_DATA_DIR, or the user's data directory."""
    given = os.environ.get("CIRIS_DATA_DIR")
    if given:
        return Path(given).expanduser()
    home = os.environ.get("XDG_DATA_HOME")
    return (Path(home) if home else Path.home() / ".local" / "share") / "ciris"


STACK = "stack.json"
"""In this file of its data directory a stack writes down its address."""


def running_stack(data: Path) -> str | None:
    """Returns the URL that the stack of this data directory wrote down; None when no stack runs there.

    Raises:
        CirisError: no_service, where the file is damaged.
    """
    try:
        return str(json.loads((data / STACK).read_text())["url"])
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError):
        message = f"{data / STACK} does not say where the service is"
        raise CirisError("no_service", message, hint="start it again with `ciris up`, or name its address") from None


NO_SERVICE = "start one with `ciris up`, or name one: --url, CIRIS_URL, or url of ciris.connect; --local and scene check need none"


def service_url(given: str | None) -> str:
    """Returns the service's URL: ``given``, or CIRIS_URL, or that of the running stack.

    Raises:
        CirisError: no_service.
    """
    url = given or os.environ.get("CIRIS_URL") or running_stack(data_dir())
    if url is None:
        raise CirisError("no_service", "no service is running here", hint=NO_SERVICE)
    return url


def api_key() -> str | None:
    """Returns the API key: CIRIS_API_KEY, or the content of the file that CIRIS_API_KEY_FILE names; None where neither is set.

    Raises:
        CirisError: api_key, for something that cannot be a key.
    """
    name = "CIRIS_API_KEY" if os.environ.get("CIRIS_API_KEY") else "CIRIS_API_KEY_FILE"
    value = os.environ.get(name)
    if not value:
        return None
    try:
        key = Path(value).expanduser().read_text(errors="replace") if name.endswith("FILE") else value
    except OSError as error:
        raise CirisError(
            "api_key", f"{value}: {unreadable(error)}", field="CIRIS_API_KEY_FILE", hint="name the file that holds the key"
        ) from None
    return checked_key(key, name)


def checked_key(key: str, field: str) -> str:
    """Returns an API key without the space around it. No message shows it.

    Raises:
        CirisError: api_key, for something that cannot be a key.
    """
    if not isinstance(key, str) or not re.fullmatch(r"[\x21-\x7e]+", key.strip()):
        raise CirisError("api_key", "this is not an API key", field=field, hint="it is one word, as `ciris key add` prints it")
    return key.strip()
