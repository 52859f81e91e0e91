"""These functions connect to the service that is meant, as the `ciris` command does."""

from __future__ import annotations

from ciris.asynchronous.client import AsyncClient
from ciris.asynchronous.service import AsyncService
from ciris.find import api_key, service_url
from ciris.synchronous.client import Client
from ciris.synchronous.service import Service


def connect(url: str | None = None, key: str | None = None) -> Service:
    """Returns the service. Nothing is asked of it yet.

    Args:
        url: its address; default: CIRIS_URL, or the service that `ciris up` runs on this machine.
        key: an API key; default: CIRIS_API_KEY, or the content of the file that CIRIS_API_KEY_FILE names.

    Raises:
        CirisError: no_service, api_key.
    """
    return Service(Client(service_url(url), key or api_key()))


def connect_async(url: str | None = None, key: str | None = None) -> AsyncService:
    """Returns the service with methods that are awaited. The arguments and errors are those of :func:`connect`."""
    return AsyncService(AsyncClient(service_url(url), key or api_key()))
