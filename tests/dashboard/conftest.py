"""The service's fixtures."""

from tests.api.conftest import certified, client, database, environment, region, scene, url

__all__ = ["certified", "client", "database", "environment", "region", "scene", "url"]
