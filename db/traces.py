"""Traces (OpenTelemetry) show where the time between a request and its proof went.

They are off, and every span costs next to nothing, until the environment names a collector. A job keeps the ``traceparent`` (W3C Trace
Context) of the request that created it. So whatever works on the job later, in whichever process, adds its spans to that request's trace.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from importlib.metadata import version

from opentelemetry import trace
from opentelemetry.context import Context
from opentelemetry.trace.propagation.tracecontext import TraceContextTextMapPropagator

from db.leases import this_worker

ENDPOINTS = "OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT"
"""Either of OpenTelemetry's own variables turns traces on. Its other variables have their usual meanings."""

END_SECONDS = 2.0

_HEADER = "traceparent"
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
_propagator = TraceContextTextMapPropagator()
_tracer = trace.get_tracer("ciris")

Attribute = str | int | float | bool


def configure(process: str) -> None:
    """Sends this process's spans to the collector that the environment names, over HTTP, from a thread of its own.

    It does nothing where the environment names none. A process that forks others must not have called it before: they would share
    its spans. Spans that the collector does not take in time are dropped, and a line in the log says so.

    Args:
        process: name of the process; the service is called ``ciris-`` and this name, unless OTEL_SERVICE_NAME says otherwise.
    """
    if not any(os.environ.get(name) for name in ENDPOINTS):
        return
    from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
    from opentelemetry.sdk.resources import Resource
    from opentelemetry.sdk.trace import TracerProvider
    from opentelemetry.sdk.trace.export import BatchSpanProcessor

    named = {} if os.environ.get("OTEL_SERVICE_NAME") else {"service.name": f"ciris-{process}"}
    about = {**named, "service.version": version("ciris"), "service.instance.id": this_worker()}
    provider = TracerProvider(resource=Resource.create(about), shutdown_on_exit=False)
    provider.add_span_processor(BatchSpanProcessor(OTLPSpanExporter()))
    trace.set_tracer_provider(provider)


def end() -> None:
    """Sends the remaining traces before the process ends. A collector that is away delays the end by two seconds at most."""
    if (shutdown := getattr(trace.get_tracer_provider(), "shutdown", None)) is not None:
        rest = threading.Thread(target=shutdown, daemon=True)
        rest.start()
        rest.join(END_SECONDS)


def here() -> str | None:
    """Returns the ``traceparent`` of the span that this code runs in; None outside of one."""
    return headers().get(_HEADER)


def headers() -> dict[str, str]:
    """Returns the HTTP headers that let a receiver go on with the trace; none outside of a span."""
    carrier: dict[str, str] = {}
    _propagator.inject(carrier)
    return carrier


def trace_id(traceparent: str | None) -> str | None:
    """Returns the trace's id, 32 hexadecimal digits, out of a ``traceparent``."""
    return None if traceparent is None else traceparent.split("-")[1]


@contextmanager
def span(name: str, traceparent: str | None, **attributes: Attribute) -> Iterator[trace.Span]:
    """Runs a block in a span of a job's trace, or in none if the job has no trace.

    Args:
        traceparent: the job's.
        attributes: facts about the span; ``ciris.`` is put before their names.
    """
    if traceparent is None:
        yield trace.INVALID_SPAN
        return
    with _tracer.start_as_current_span(name, context=_context(traceparent), attributes=_named(attributes)) as made:
        yield made


def past(name: str, traceparent: str | None, began: datetime, ended: datetime, **attributes: Attribute) -> None:
    """Adds a span to a job's trace for something that is over."""
    if traceparent is not None:
        made = _tracer.start_span(name, context=_context(traceparent), attributes=_named(attributes), start_time=_nanoseconds(began))
        made.end(_nanoseconds(ended))


def note(made: trace.Span, **attributes: Attribute) -> None:
    """Adds what is known of a span only later."""
    made.set_attributes(_named(attributes))


def _context(traceparent: str) -> Context:
    return _propagator.extract({_HEADER: traceparent})


def _named(attributes: dict[str, Attribute]) -> dict[str, Attribute]:
    return {f"ciris.{name}": value for name, value in attributes.items()}


def _nanoseconds(at: datetime) -> int:
    return (at - _EPOCH) // timedelta(microseconds=1) * 1000
