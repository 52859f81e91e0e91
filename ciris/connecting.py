"""These functions connect to the service that is meant, as the `ciris` command does."""

from __future__ import annotations

from ciris.asynchronous.client import TIMEOUT_S, AsyncClient
from ciris.asynchronous.service import AsyncService
from ciris.find import api_key, checked_key, service_url
from ciris.synchronous.client import Client
from ciris.synchronous.service import Service


def connect(url: str | None = None, key: str | None = None, timeout: float = TIMEOUT_S) -> Service:
    """Returns the service. Nothing is asked of it yet.

    Args:
        url: its address; default: CIRIS_URL, or the service that `ciris up` runs on this machine.
        key: an API key; default: CIRIS_API_KEY, or the content of the file that CIRIS_API_KEY_FILE names.
        timeout: seconds that a question may take. A wait for a job may take as long as the job.

    Raises:
        CirisError: no_service, url, api_key, argument.
    """
    return Service(Client(service_url(url), checked_key(key, "key") if key else api_key(), timeout))


def connect_async(url: str | None = None, key: str | None = None, timeout: float = TIMEOUT_S) -> AsyncService:
    """Returns the service with methods that are awaited. The arguments and errors are those of :func:`connect`."""
    return AsyncService(AsyncClient(service_url(url), checked_key(key, "key") if key else api_key(), timeout))
