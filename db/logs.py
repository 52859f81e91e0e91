"""Every process of the service logs one JSON object a line on standard error, with the job and pair that the line is about.

What is bound with ``structlog.contextvars.bound_contextvars(job=...)`` is in every line until the block ends, whichever library writes
the line. Libraries and our own code use the standard library's loggers.

Our code never logs secrets. This module also blots out those that get into the text of an error.
"""

from __future__ import annotations

import json
import logging
import re
import sys

import structlog
from structlog.types import EventDict

from db import traces

_SECRETS = (
    (re.compile(r"(ciris_[0-9a-f]{12}_)[\w-]+"), r"\1***"),
    (re.compile(r"(whsec_)[\w+/=-]+"), r"\1***"),
    (re.compile(r"(\w://[^\s/:@]*:)[^\s/@]+@"), r"\1***@"),
)
REQUEST_FIELDS = ("method", "path", "status", "seconds", "client", "key")
"""The line of a request has these fields in its ``extra``."""


def configure(process: str) -> None:
    """Sets this process up to log.

    Args:
        process: name of the process, shown in every line.
    """

    def named(_logger: object, _method: str, event: EventDict) -> EventDict:
        event["process"] = process
        return event

    formatter = structlog.stdlib.ProcessorFormatter(
        foreign_pre_chain=[
            structlog.contextvars.merge_contextvars,
            _traced,
            structlog.stdlib.add_log_level,
            structlog.stdlib.add_logger_name,
            structlog.stdlib.ExtraAdder(allow=REQUEST_FIELDS),
            structlog.processors.TimeStamper(fmt="iso"),
        ],
        processors=[
            structlog.stdlib.ProcessorFormatter.remove_processors_meta,
            named,
            structlog.processors.format_exc_info,
            structlog.processors.EventRenamer("message"),
            _render,
        ],
    )
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(formatter)
    logging.basicConfig(level=logging.INFO, handlers=[handler], force=True)
    logging.captureWarnings(True)
    logging.getLogger("alembic").setLevel(logging.WARNING)  # below WARNING it logs every migration


def _traced(_logger: object, _method: str, event: EventDict) -> EventDict:
    if (traceparent := traces.here()) is not None:
        event["trace"] = traces.trace_id(traceparent)
    return event


def _render(_logger: object, _method: str, event: EventDict) -> str:
    line = json.dumps(event, default=str)
    for pattern, replacement in _SECRETS:
        line = pattern.sub(replacement, line)
    return line
