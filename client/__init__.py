"""This package holds the `ciris` command line and a small Python client for the service."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from client.http import Client

__all__ = ["Client"]


def __getattr__(name: str) -> Any:
    """Imports ``Client`` when it is asked for, because ``ciris verify`` must run where httpx2 is not installed."""
    if name == "Client":
        from client.http import Client

        return Client
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
