"""The `ciris` command line and a small Python client for the service."""

from client.http import Client

__all__ = ["Client"]
