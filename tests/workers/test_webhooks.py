"""Webhooks against a real receiver: signatures, repetition, what is refused, and that a worker's death loses nothing."""

from __future__ import annotations

import base64
import hashlib
import hmac
import json
import os
import socket
import threading
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import timedelta
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from sqlalchemy import select, text

from certifier.errors import CirisError
from db import jobs, projects, webhooks
from db.models import DEFAULT_PROJECT, Base, WebhookRow
from db.session import database
from db.settings import Host, Settings, settings
from db.states import JobState
from db.types import utcnow
from db.vault import vault
from tests.db.builders import a_job
from tests.workers.service import environment, eventually
from workers import addresses
from workers import webhooks as delivering
from workers.addresses import check, is_public, may_be_called, resolve
from workers.troubles import Troubles

pytestmark = pytest.mark.lengthy

SECRET = "whsec_" + base64.b64encode(bytes(range(32))).decode()


@dataclass
class Receiver:
    """An HTTP server that answers with ``answers`` in turn, the last of them for ever."""

    host: str = ""
    url: str = ""
    answers: list[int] = field(default_factory=lambda: [204])
    headers: list[dict[str, str]] = field(default_factory=list)
    bodies: list[bytes] = field(default_factory=list)


@pytest.fixture
def receiver() -> Iterator[Receiver]:
    received = Receiver()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            received.bodies.append(self.rfile.read(int(self.headers["Content-Length"])))
            received.headers.append({name.lower(): value for name, value in self.headers.items()})
            status = received.answers.pop(0) if len(received.answers) > 1 else received.answers[0]
            self.send_response(status)
            if status == 302:
                self.send_header("Location", "/elsewhere")
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    received.host = f"127.0.0.1:{server.server_port}"
    received.url = f"http://{received.host}/hook?a=b"
    yield received
    server.shutdown()
    thread.join()
    server.server_close()


@pytest.fixture
def service(database_url: str, receiver: Receiver) -> Iterator[None]:
    """The settings of a service that may call the receiver, which is on this machine."""
    with environment(CIRIS_DATABASE_URL=database_url, CIRIS_WEBHOOK_HOSTS=receiver.host):
        yield


def also_allow(server: socket.socket, monkeypatch: pytest.MonkeyPatch) -> str:
    """Lists another receiver on this machine, and returns its URL."""
    place = f"127.0.0.1:{server.getsockname()[1]}"
    monkeypatch.setenv("CIRIS_WEBHOOK_HOSTS", f"{os.environ['CIRIS_WEBHOOK_HOSTS']}, {place}")
    settings.cache_clear()
    return f"http://{place}/"


def a_webhook(url: str, *, ended: bool = True, project: str = DEFAULT_PROJECT) -> str:
    """The id of a job with a webhook."""
    with database().of(project).write() as session:
        job = a_job(session)
        webhooks.add(session, job.id, url, SECRET)
        if ended:
            jobs.finish(session, job, JobState.CANCELLED, reason="no longer wanted")
        return job.id


def deliver_due() -> None:
    """Attempts every delivery that is due."""
    with delivering.Couriers() as couriers:
        couriers.send_due()


def row_of(job_id: str) -> WebhookRow:
    with database().read() as session:
        return webhooks.of_job(session, job_id)


def pass_time(seconds: float) -> None:
    """What was to wait for this time waits no more."""
    with database().write() as session:
        for row in session.query(WebhookRow):
            row.next_at -= timedelta(seconds=seconds)


def test_the_end_of_a_job_is_told_once_and_signed(service: None, receiver: Receiver) -> None:
    job_id = a_webhook(receiver.url)
    for _ in range(2):
        deliver_due()
    (body,), (headers,) = receiver.bodies, receiver.headers
    message = json.loads(body)
    assert (message["type"], message["data"]["id"], message["data"]["state"]) == ("job.ended", job_id, "cancelled")
    row = row_of(job_id)
    assert (row.state, row.attempts, headers["webhook-id"]) == ("delivered", 1, row.id)
    assert abs(int(headers["webhook-timestamp"]) - time.time()) < 60
    signed = f"{row.id}.{headers['webhook-timestamp']}.".encode() + body
    expected = base64.b64encode(hmac.new(bytes(range(32)), signed, hashlib.sha256).digest()).decode()
    assert headers["webhook-signature"] == f"v1,{expected}"


def test_a_job_that_goes_on_is_not_told(service: None, receiver: Receiver) -> None:
    job_id = a_webhook(receiver.url, ended=False)
    deliver_due()
    assert receiver.bodies == []
    with database().write() as session:
        jobs.cancel(session, job_id)
    deliver_due()
    assert len(receiver.bodies) == 1


def test_a_receiver_that_fails_is_called_again_later_and_later(service: None, receiver: Receiver) -> None:
    receiver.answers = [500, 302, 204]
    job_id = a_webhook(receiver.url)
    deliver_due()
    for calls, pause in enumerate(webhooks.BACKOFF_SECONDS[:2], start=1):
        pass_time(pause - 5)
        deliver_due()
        assert len(receiver.bodies) == calls
        pass_time(5)
        deliver_due()
    assert len(receiver.bodies) == 3
    row = row_of(job_id)
    assert (row.state, row.attempts, row.error) == ("delivered", 3, None)
    assert len({headers["webhook-id"] for headers in receiver.headers}) == 1


def test_a_receiver_that_never_answers_well_is_given_up(service: None, receiver: Receiver) -> None:
    receiver.answers = [503]
    job_id = a_webhook(receiver.url)
    for pause in (0, *webhooks.BACKOFF_SECONDS, 86400):
        pass_time(pause)
        deliver_due()
    row = row_of(job_id)
    assert (row.state, row.attempts, row.error) == ("failed", 1 + len(webhooks.BACKOFF_SECONDS), "the receiver answered 503")
    assert len(receiver.bodies) == row.attempts


def test_a_worker_that_dies_with_a_delivery_loses_nothing(service: None, receiver: Receiver) -> None:
    job_id = a_webhook(receiver.url)
    with database().write() as session:
        assert len(webhooks.claim(session, utcnow())) == 1
        assert webhooks.claim(session, utcnow()) == [], "nobody else takes it meanwhile"
    pass_time(delivering.SECONDS + webhooks.BACKOFF_SECONDS[0])
    deliver_due()
    assert receiver.bodies == [], "an attempt may take longer than the pause after it"
    pass_time(webhooks.HELD_SECONDS - delivering.SECONDS - webhooks.BACKOFF_SECONDS[0])
    deliver_due()
    assert row_of(job_id).state == "delivered"


def test_a_worker_that_dies_each_time_is_given_up(service: None) -> None:
    job_id = a_webhook("http://127.0.0.1:9/")
    for _ in range(2 + len(webhooks.BACKOFF_SECONDS)):
        with database().write() as session:
            webhooks.claim(session, utcnow())
        pass_time(86400)
    assert row_of(job_id).state == "failed"


def claimed(*under_way: webhooks.Place) -> list[webhooks.Place]:
    with database().write() as session:
        return [delivery.place for delivery in webhooks.claim(session, utcnow(), under_way)]


def test_projects_take_turns_and_have_a_bound_as_each_of_their_receivers_has(service: None) -> None:
    with database().write() as session:
        projects.add(session, "others")
    for number in range(20):
        a_webhook(f"http://slow.example/{number}")
        a_webhook(f"http://{number}.example:8080?a")
    a_webhook("http://late.example", project="others")
    first = claimed()
    assert first[:2] in ([first[0], ("others", "http://late.example")], [("others", "http://late.example"), first[1]])
    assert Counter(project for project, _ in first) == {"default": webhooks.OF_PROJECT, "others": 1}
    slow = ("default", "http://slow.example")
    assert Counter(first)[slow] == webhooks.OF_RECEIVER
    assert claimed(*first) == [], "the project has as many under way as it may"
    assert set(claimed(*[slow] * webhooks.OF_RECEIVER)) == {("default", f"http://{number}.example:8080") for number in range(4, 8)}
    assert claimed(*[("elsewhere", "http://any.example")] * webhooks.AT_ONCE) == []


def test_receivers_that_do_not_answer_delay_nobody_else(service: None, receiver: Receiver, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither another project nor another receiver of the same project."""
    with database().write() as session:
        projects.add(session, "others")
    stop = threading.Event()
    telling = threading.Thread(target=delivering.run, args=(stop, Troubles()))
    with socket.create_server(("127.0.0.1", 0), backlog=100) as silent:
        url = also_allow(silent, monkeypatch)
        for _ in range(60):
            a_webhook(url)
        telling.start()
        try:
            eventually(lambda: sum(row.attempts for row in every_row()) == webhooks.OF_RECEIVER, "the silent one is called")
            began = time.monotonic()
            told = [a_webhook(receiver.url), a_webhook(receiver.url, project="others")]
            eventually(lambda: all(row_of(job_id).state == "delivered" for job_id in told), "the others are told", delivering.SECONDS)
            assert time.monotonic() - began < delivering.SECONDS
        finally:
            stop.set()
            silent.close()
            telling.join()
    assert sum(row.attempts for row in every_row()) == webhooks.OF_RECEIVER + 2


def test_two_control_workers_send_nothing_twice(service: None, receiver: Receiver) -> None:
    told = [a_webhook(receiver.url) for _ in range(30)]
    stop = threading.Event()
    workers = [threading.Thread(target=delivering.run, args=(stop, Troubles())) for _ in range(2)]
    for worker in workers:
        worker.start()
    try:
        eventually(lambda: all(row.state == "delivered" for row in every_row()), "all are told", 60)
    finally:
        stop.set()
        for worker in workers:
            worker.join()
    assert {row.attempts for row in every_row()} == {1}
    assert len(receiver.bodies) == len({headers["webhook-id"] for headers in receiver.headers}) == len(told)


def every_row() -> list[WebhookRow]:
    with database().read() as session:
        return list(session.scalars(select(WebhookRow)))


def test_a_receiver_that_trickles_is_cut_off(service: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(delivering, "SECONDS", 1.0)
    done = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as server:

        def trickle() -> None:
            connection, _ = server.accept()
            with connection:
                try:
                    while not done.wait(0.1):
                        connection.send(b"H")
                except OSError:
                    pass

        thread = threading.Thread(target=trickle)
        thread.start()
        job_id = a_webhook(also_allow(server, monkeypatch))
        start = time.monotonic()
        deliver_due()
        assert time.monotonic() - start < 30
        done.set()
        thread.join()
    assert row_of(job_id).error in SAID


def test_a_retry_tells_the_same_receiver(service: None, receiver: Receiver) -> None:
    job_id = a_webhook(receiver.url)
    with database().write() as session:
        again = jobs.retry(session, job_id).id
        assert jobs.retry(session, job_id).id == again
    row = row_of(again)
    assert (row.url, row.state, vault().open(row.secret, row.url)) == (receiver.url, "waiting", SECRET)


def test_the_database_does_not_hold_the_secret(service: None, receiver: Receiver) -> None:
    """Neither as it is given, nor as the bytes that it stands for."""
    a_webhook(receiver.url)
    with database().read() as session:
        stored = [str(tuple(row)) for table in Base.metadata.tables for row in session.execute(text(f'SELECT * FROM "{table}"'))]
    assert any(receiver.url in row for row in stored)
    for secret in (SECRET, SECRET.removeprefix("whsec_"), bytes(range(32)).hex(), str(bytes(range(32)))):
        assert not any(secret in row for row in stored)


def test_a_secret_that_an_earlier_version_stored_is_encrypted_when_the_worker_starts(service: None, receiver: Receiver) -> None:
    job_id = a_webhook(receiver.url)
    with database().write() as session:
        webhooks.of_job(session, job_id).secret = SECRET
        assert webhooks.seal_all(session) == 1
        assert webhooks.seal_all(session) == 0
    deliver_due()
    row = row_of(job_id)
    assert row.state == "delivered"
    assert SECRET not in row.secret


def test_without_the_key_a_receiver_is_not_told_and_the_attempt_says_why(service: None, receiver: Receiver) -> None:
    job_id = a_webhook(receiver.url)
    with environment(CIRIS_DATABASE_URL=settings().database_url, CIRIS_WEBHOOK_HOSTS=receiver.host, CIRIS_SECRET_KEY=""):
        deliver_due()
        assert receiver.bodies == []
        assert "no key fits" in (row_of(job_id).error or "")


def test_attempts_are_remembered_and_a_receiver_is_told_again_when_somebody_asks(service: None, receiver: Receiver) -> None:
    receiver.answers = [500, 204]
    job_id = a_webhook(receiver.url)
    deliver_due()
    pass_time(webhooks.BACKOFF_SECONDS[0])
    deliver_due()
    with database().write() as session:
        row = webhooks.of_job(session, job_id)
        told = [(one.status, one.error) for one in webhooks.deliveries(session, row.id)]
        assert told == [(204, None), (500, "the receiver answered 500")]
        again = webhooks.send_again(session, jobs.lock(session, job_id), utcnow())
        assert (again.state, again.attempts) == ("waiting", 0)
    deliver_due()
    assert row_of(job_id).state == "delivered"
    assert [headers["webhook-id"] for headers in receiver.headers] == [row.id] * 3
    for _ in range(webhooks.KEPT):
        with database().write() as session:
            webhooks.send_again(session, jobs.lock(session, job_id), utcnow())
        deliver_due()
    with database().read() as session:
        assert len(webhooks.deliveries(session, row.id)) == webhooks.KEPT


@pytest.mark.parametrize("host", ["localhost", "127.0.0.1", "2130706433", "127.1", "nobody.invalid"])
def test_private_addresses_are_not_called_and_nobody_learns_which_names_are_known(database_url: str, receiver: Receiver, host: str) -> None:
    port = receiver.host.partition(":")[2]
    with environment(CIRIS_DATABASE_URL=database_url, CIRIS_WEBHOOK_HOSTS=f"elsewhere:{port}"):
        for url, error in (
            (f"http://{host}/", f"{host} has no public address"),
            (f"http://{host}:{port}/", f"port {port} of {host} may not be called"),
        ):
            job_id = a_webhook(url)
            deliver_due()
            assert receiver.bodies == []
            assert row_of(job_id).error == error


def test_the_address_is_looked_at_again_at_each_attempt(service: None, receiver: Receiver, monkeypatch: pytest.MonkeyPatch) -> None:
    """A name that led to a public address leads to this machine when the receiver is called (DNS rebinding)."""
    port = int(receiver.host.partition(":")[2])
    monkeypatch.setattr(addresses, "PORTS", (port,))
    monkeypatch.setattr(addresses.socket, "getaddrinfo", lambda *_args, **_options: [(2, 1, 6, "", ("127.0.0.1", port))])
    assert check("rebound.example", port, ()) is False
    job_id = a_webhook(f"http://rebound.example:{port}/")
    deliver_due()
    assert (receiver.bodies, row_of(job_id).error) == ([], "rebound.example has no public address")


SAID = {"no connection to the receiver, or it broke off", "the receiver has not answered within 1 s", "the receiver's answer is not HTTP"}


@pytest.mark.parametrize(
    ("answer", "scheme", "said"),
    [
        (None, "http", "no connection to the receiver, or it broke off"),
        (b"SSH-2.0-OpenSSH_9.2 db-7.internal\r\n", "http", "the receiver's answer is not HTTP"),
        (b"HTTP/1.1 400 10.1.2.3\r\n\r\n", "https", "the receiver does not speak TLS as it should"),
    ],
)
def test_an_error_says_nothing_about_the_network(
    service: None, monkeypatch: pytest.MonkeyPatch, answer: bytes | None, scheme: str, said: str
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        url = also_allow(server, monkeypatch).replace("http", scheme, 1)

        def tell() -> None:
            connection, _ = server.accept()
            with connection:
                connection.recv(65536)
                connection.sendall(answer or b"")

        thread = threading.Thread(target=tell)
        if answer is None:
            server.close()
        else:
            thread.start()
        job_id = a_webhook(url)
        deliver_due()
        if answer is not None:
            thread.join()
    assert row_of(job_id).error == said


PRIVATE = ["127.0.0.1", "10.1.2.3", "172.16.0.1", "192.168.1.1", "100.64.0.1", "::1", "fc00::1", "fd12:3456::1"]
NEVER = [
    address
    for line in (
        "0.0.0.0 169.254.169.254 169.254.170.2 168.63.129.16 100.100.100.200 192.0.0.192 192.88.99.1 198.18.0.1 224.0.0.1 240.0.0.1",
        "255.255.255.255 :: ::8.8.8.8 ::7f00:1 fe80::1 fe80::1%eth0 fec0::1 fd00:ec2::254 fd20:ce::254 ff02::1 ff0e::1 100::1 3fff::1",
        "5f00::1 ::ffff:127.0.0.1 ::ffff:8.8.8.8 ::ffff:0:8.8.8.8 64:ff9b::7f00:1",
        "64:ff9b::808:808 64:ff9b:1::808:808 2002:7f00:1:: 2002:808:808::",
        "2001:0:53aa:64c:0:0:80ff:fffe 2001:20::1 2001:db8::1",
    )
    for address in line.split()
]


def test_what_is_public_and_what_can_be_allowed() -> None:
    assert [address for address in PRIVATE + NEVER if is_public(address)] == []
    assert [address for address in NEVER if may_be_called(address, listed=True)] == []
    assert all(may_be_called(address, listed=True) and not may_be_called(address, listed=False) for address in PRIVATE)
    for address in ("8.8.8.8", "2606:4700:4700::1111", "2a00:1450:4001:80b::200e"):
        assert is_public(address)


def test_the_list_names_hosts_with_their_ports() -> None:
    hosts = Settings(webhook_hosts="Hooks.internal, 10.1.2.3:8080,[fd00::1]:99").webhook_hosts  # type: ignore[arg-type]
    assert hosts == (Host("hooks.internal", None), Host("10.1.2.3", 8080), Host("fd00::1", 99))
    for host, port in (("hooks.INTERNAL", 80), ("hooks.internal.", 443), ("10.1.2.3", 8080), ("fd00::1", 99)):
        assert check(host, port, hosts)
    for host, port in (("hooks.internal", 8080), ("10.1.2.3", 80), ("10.1.2.4", 443), ("other.internal", 99), ("fd00::1", 443)):
        with pytest.raises(CirisError) as refused:
            resolve(host, port, hosts)
        assert refused.value.code == "webhook_address"
    for wrong in ("http://a", "a/b", "a:0", "a:x", "user@a", ":80", "a?b"):
        with pytest.raises(ValueError, match="webhook_hosts"):
            Settings(webhook_hosts=wrong)  # type: ignore[arg-type]


def test_one_private_address_among_public_ones_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    def found(*addresses_found: str) -> None:
        entries = [(0, 0, 0, "", (address, 80)) for address in addresses_found]
        monkeypatch.setattr(addresses.socket, "getaddrinfo", lambda *_args, **_options: entries)

    listed = (Host("example.org", None),)
    found("8.8.8.8")
    assert resolve("example.org", 80, ()) == "8.8.8.8"
    found("8.8.8.8", "10.0.0.1")
    with pytest.raises(CirisError, match="no public address"):
        resolve("example.org", 80, ())
    assert resolve("example.org", 80, listed) == "8.8.8.8"
    found("10.0.0.1", "169.254.169.254")
    with pytest.raises(CirisError, match="no address that may be called"):
        resolve("example.org", 80, listed)


def test_names_that_do_not_resolve_are_an_error_of_the_receiver() -> None:
    for host in ("nowhere.invalid", "a" * 300, "\udcff"):
        with pytest.raises(CirisError, match="no public address"):
            resolve(host, 80, ())


def test_the_running_service_delivers(receiver: Receiver, sqlite_url: str, queue: object, tmp_path: Path) -> None:
    from tests.workers.service import running_service

    with running_service(sqlite_url, queue.url, tmp_path, ["control"], CIRIS_WEBHOOK_HOSTS=receiver.host):  # type: ignore[attr-defined]
        job_id = a_webhook(receiver.url)
        eventually(lambda: row_of(job_id).state == "delivered", "the webhook is delivered")
    assert len(receiver.bodies) == 1
