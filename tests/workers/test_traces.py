"""Traces: one request's trace has all work on its job, whichever process does it; a collector that is away disturbs nothing."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from gzip import decompress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
import yaml
from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest
from opentelemetry.proto.trace.v1.trace_pb2 import Span

from ciris.synchronous.client import Client
from tests.services import Queue, free_port
from tests.workers.service import ROOT, Service, eventually, running_service

pytestmark = pytest.mark.lengthy

EXAMPLE = ROOT / "examples" / "planar_2dof"
TRACE, CALLER = "0af7651916cd43dd8448eb211c80319c", "b7ad6b7169203331"
NOT_SAMPLED = "1af7651916cd43dd8448eb211c80319c"


class Collector(ThreadingHTTPServer):
    """Takes spans as OTLP over HTTP."""

    def __init__(self) -> None:
        self.spans: list[tuple[str, Span]] = []
        """Each with the name of its service."""

        class Handler(BaseHTTPRequestHandler):
            def do_POST(handler) -> None:
                body = handler.rfile.read(int(handler.headers["Content-Length"]))
                body = decompress(body) if handler.headers.get("Content-Encoding") == "gzip" else body
                assert handler.path == "/v1/traces"
                for one in ExportTraceServiceRequest.FromString(body).resource_spans:
                    service = next(field.value.string_value for field in one.resource.attributes if field.key == "service.name")
                    self.spans += [(service, span) for scope in one.scope_spans for span in scope.spans]
                handler.send_response(200)
                handler.end_headers()

            def log_message(handler, *_: object) -> None:
                pass

        super().__init__(("127.0.0.1", 0), Handler)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_port}"

    def names(self) -> set[tuple[str, str]]:
        return {(service, span.name) for service, span in self.spans}


@pytest.fixture
def collector() -> Iterator[Collector]:
    with Collector() as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


@contextmanager
def traced_service(database_url: str, queue: Queue, logs: Path, endpoint: str, **variables: str) -> Iterator[tuple[Service, Client]]:
    """A whole service that sends spans there."""
    queue.flush()
    port = free_port()
    given = {"CIRIS_PORT": str(port), "OTEL_EXPORTER_OTLP_ENDPOINT": endpoint, "OTEL_BSP_SCHEDULE_DELAY": "200", **variables}
    with running_service(database_url, queue.url, logs, **given) as service:
        service.start("api")
        client = Client(f"http://127.0.0.1:{port}")
        eventually(lambda: _answers(f"http://127.0.0.1:{port}/healthz"), "the API answers")
        yield service, client


def _answers(url: str) -> bool:
    try:
        return urllib.request.urlopen(url, timeout=5).status == 200
    except OSError:
        return False


def post(client: Client, body: dict[str, Any], **headers: str) -> dict[str, Any]:
    request = urllib.request.Request(f"{client.url}/v1/jobs", json.dumps(body).encode(), {"Content-Type": "application/json", **headers})
    with urllib.request.urlopen(request) as response:
        return json.load(response)


def a_job(client: Client) -> dict[str, Any]:
    """The request for a job with seeding, pairs and a region."""
    scene = client.add_scene(EXAMPLE / "scene.yaml")["id"]
    seed = yaml.safe_load((EXAMPLE / "seed.yaml").read_text())
    return {"kind": "grow", "scene": scene, "seed": {"q": seed["q"]}, "options": {"stages": 1, "cells": 200}}


def ended(client: Client, job: str) -> dict[str, Any]:
    def look() -> dict[str, Any] | None:
        found = client.job(job)
        return found if found["ended"] else None

    return eventually(look, "the job ends")


def attributes(span: Span) -> dict[str, Any]:
    return {field.key: getattr(field.value, field.value.WhichOneof("value")) for field in span.attributes}


@pytest.mark.slow
def test_one_trace_has_the_way_from_the_request_to_the_proof_and_a_caller_who_does_not_sample_has_none(
    database_url: str, own_queue: Queue, tmp_path: Path, collector: Collector
) -> None:
    with traced_service(database_url, own_queue, tmp_path, collector.url) as (service, client):
        request = a_job(client)
        other = post(client, request, traceparent=f"00-{NOT_SAMPLED}-{CALLER}-00")
        assert ended(client, other["id"])["outcome"] == "certified"
        made = post(client, request, traceparent=f"00-{TRACE}-{CALLER}-01")
        assert made["trace"] == TRACE
        job = ended(client, made["id"])
        assert job["outcome"] == "certified"
        eventually(
            lambda: ("ciris-control", "job grow") in collector.names() or ("ciris-solve", "job grow") in collector.names(), "its end"
        )
        os.kill(service.pid("solve"), signal.SIGQUIT)
        eventually(lambda: ("ciris-solve", "accept") in collector.names(), "the region's proof")
    assert NOT_SAMPLED not in {span.trace_id.hex() for _, span in collector.spans}
    ours = [(name, span) for name, span in collector.spans if span.trace_id.hex() == TRACE]
    assert ("ciris-api", "POST /v1/jobs") in {(name, span.name) for name, span in ours}
    request = next(span for _, span in ours if span.name == "POST /v1/jobs")
    assert request.parent_span_id.hex() == CALLER
    assert attributes(request)["http.response.status_code"] == 201
    work = [(name, span) for name, span in ours if span is not request]
    assert {span.name for _, span in work} == {"coordinate", "propose", "certify", "accept", "job grow"}
    assert {span.parent_span_id for _, span in work} == {request.span_id}
    assert {attributes(span)["ciris.job"] for _, span in work} == {made["id"]}
    assert {name for name, span in work if span.name in ("propose", "certify", "accept")} == {"ciris-solve"}
    whole = next(span for _, span in work if span.name == "job grow")
    lasted = (whole.end_time_unix_nano - whole.start_time_unix_nano) / 1e9
    assert lasted > sum(span.end_time_unix_nano - span.start_time_unix_nano for _, span in work if span.name == "propose") / 1e9
    assert all(whole.start_time_unix_nano <= span.start_time_unix_nano for _, span in work)
    lines = [
        json.loads(line)
        for name in ("api", "control", "solve")
        for line in (tmp_path / f"{name}.log").read_text().splitlines()
        if line.startswith("{")
    ]
    assert {line["process"] for line in lines if line.get("trace") == TRACE} >= {"api"}
    assert not {span.name for _, span in collector.spans} & {"GET /healthz"}


@pytest.mark.slow
def test_a_collector_that_is_away_disturbs_nothing(database_url: str, own_queue: Queue, tmp_path: Path) -> None:
    with traced_service(database_url, own_queue, tmp_path, f"http://127.0.0.1:{free_port()}") as (service, client):
        made = post(client, a_job(client))
        assert ended(client, made["id"])["outcome"] == "certified"
        began = time.monotonic()
        for name in ("solve", "control", "api"):
            os.kill(service.pid(name), signal.SIGTERM)
        eventually(lambda: None not in [service.status(name) for name in ("solve", "control", "api")], "all of them end")
        assert time.monotonic() - began < 10


def test_without_a_collector_nothing_of_it_is_loaded() -> None:
    script = """
import sys
from db import traces
traces.configure("api")
import api.app, workers.turns
with traces.span("x", "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01"):
    pass
assert traces.here() is None
assert not [name for name in sys.modules if name.startswith(("opentelemetry.sdk.trace", "opentelemetry.exporter"))]
"""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("OTEL_")}
    subprocess.run([sys.executable, "-c", script], env=environment, cwd=ROOT, check=True)
