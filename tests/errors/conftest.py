"""The fixtures with which errors are provoked: the service, and the command."""

from tests.client.conftest import certified, ciris, client, database, environment, region, scene, url, worker

__all__ = ["certified", "ciris", "client", "database", "environment", "region", "scene", "url", "worker"]
