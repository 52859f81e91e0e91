"""The queue with a password and TLS, and PostgreSQL with TLS: who is not the server of the certificate is not spoken to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import redis
from kombu.exceptions import OperationalError as QueueError
from sqlalchemy import text
from sqlalchemy.exc import OperationalError

from certifier.model import Scene
from db import migrate
from db.session import Database
from db.states import JobState
from tests.services import Postgres, queue_server
from tests.tls import certificate, tls_before
from tests.workers.options import box_around
from tests.workers.service import ended, environment, running_service, submit
from workers.app import SOLVE, send_work, waiting

PASSWORD = "sesame"


def test_a_service_works_with_a_password_and_tls_on_both_links(planar: Scene, postgres: Postgres, tmp_path: Path) -> None:
    own = certificate(tmp_path / "own")
    with queue_server() as queue, tls_before(str(queue.socket), own) as queue_port, tls_before(postgres.port, own, postgresql=True) as port:
        redis.Redis(unix_socket_path=str(queue.socket)).config_set("requirepass", PASSWORD)
        url = postgres.new_database().replace(f"127.0.0.1:{postgres.port}", f"localhost:{port}")
        url += f"?sslmode=verify-full&sslrootcert={own.pem}"
        migrate.upgrade(url)
        broker = f"rediss://:{PASSWORD}@localhost:{queue_port}/0?ssl_ca_certs={own.pem}"
        with running_service(url, broker, tmp_path, CIRIS_SOLVE_PROCESSES="1") as service:
            assert ended(submit(planar, box_around(np.zeros(2), 0.1))).state == JobState.SUCCEEDED
            assert PASSWORD not in service.log()


@pytest.mark.parametrize(
    ("url", "why"),
    [
        ("rediss://:{password}@localhost:{port}/0", "certificate verify failed"),
        ("rediss://:{password}@localhost:{port}/0?ssl_ca_certs={other}", "certificate verify failed"),
        ("rediss://:{password}@127.0.0.1:{port}/0?ssl_ca_certs={own}", "not valid for '127.0.0.1'"),
        ("rediss://:wrong@localhost:{port}/0?ssl_ca_certs={own}", "invalid username-password pair"),
        ("rediss://localhost:{port}/0?ssl_ca_certs={own}", "Authentication required"),
    ],
)
def test_a_queue_that_is_not_the_one_meant_gets_no_messages(tmp_path: Path, url: str, why: str) -> None:
    own, other = certificate(tmp_path / "own"), certificate(tmp_path / "other")
    with queue_server() as queue, tls_before(str(queue.socket), own) as port:
        redis.Redis(unix_socket_path=str(queue.socket)).config_set("requirepass", PASSWORD)
        with environment(CIRIS_REDIS_URL=url.format(port=port, own=own.pem, other=other.pem, password=PASSWORD)):
            assert send_work() is False
            with pytest.raises(QueueError, match=why):
                waiting(SOLVE)
        with environment(CIRIS_REDIS_URL=f"rediss://:{PASSWORD}@localhost:{port}/0?ssl_ca_certs={own.pem}"):
            assert waiting(SOLVE) == 0


def test_a_database_that_is_not_the_one_meant_is_not_used(postgres: Postgres, tmp_path: Path) -> None:
    own, other = certificate(tmp_path / "own"), certificate(tmp_path / "other")

    def asked(host: str, port: int, options: str) -> object:
        database = Database(f"postgresql+psycopg://postgres@{host}:{port}/postgres?{options}")
        try:
            with database.read() as session:
                return session.scalar(text("SELECT 1"))
        finally:
            database.close()

    with tls_before(postgres.port, own, postgresql=True) as port:
        assert asked("localhost", port, f"sslmode=verify-full&sslrootcert={own.pem}") == 1
        for host, at, options, why in (
            ("localhost", port, f"sslmode=verify-full&sslrootcert={other.pem}", "certificate verify failed"),
            ("127.0.0.1", port, f"sslmode=verify-full&sslrootcert={own.pem}", "does not match host name"),
            ("localhost", postgres.port, "sslmode=require", "does not support SSL"),
        ):
            with pytest.raises(OperationalError, match=why):
                asked(host, at, options)
