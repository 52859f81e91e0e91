"""``python -m api``: the HTTP service on the settings' host and port, on a migrated database."""

from __future__ import annotations

import sys

import uvicorn

from api.guard import LOOPBACK_NAMES
from db.settings import settings

SHUTDOWN_SECONDS = 2
"""How long open streams may hold up the end."""


def main() -> None:
    """Serves until a signal ends it; refuses an address that others can reach unless the settings allow it."""
    host, port = settings().host, settings().port
    if host not in LOOPBACK_NAMES and not settings().allow_remote:
        problem = f"others can reach {host}, and this service asks nobody for a key"
        print(f"error: CIRIS_HOST: {problem} (CIRIS_ALLOW_REMOTE=1 allows it)", file=sys.stderr)
        sys.exit(2)
    uvicorn.run("api.app:create_app", factory=True, host=host, port=port, timeout_graceful_shutdown=SHUTDOWN_SECONDS, log_level="info")


if __name__ == "__main__":
    main()
