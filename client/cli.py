"""This module runs the ``ciris`` command."""

from __future__ import annotations

import argparse
import importlib
import io
import os
import re
import signal
import sys
from collections.abc import Callable, Sequence
from types import FrameType
from typing import NoReturn

from certifier.errors import CirisError, unreadable
from client.arguments import parser
from client.options import typed
from client.output import NEGATIVE

INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command and returns the exit status."""
    _prepare_streams()
    signal.signal(signal.SIGTERM, _terminated)  # so that files that a command made for itself are removed
    parsed = parser().parse_args(_joined(sys.argv[1:] if arguments is None else arguments))
    try:
        status = _command(parsed.run)(parsed)
        sys.stdout.flush()  # what cannot be written is said below, not when Python ends
        return status
    except CirisError as error:
        return _fail(str(typed(error, parsed.parser)), 1 if error.code in NEGATIVE else 2)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        return _fail(f"{error.filename or ''}: {unreadable(error)}".removeprefix(": "), 2)
    except KeyboardInterrupt:
        return _fail("interrupted", INTERRUPTED)


def _terminated(number: int, _frame: FrameType | None) -> NoReturn:
    raise SystemExit(128 + number)


def _prepare_streams() -> None:
    """Ensures that every text can be printed.

    A stream that the caller has closed leads nowhere, so that no file takes its place. A character that the terminal's encoding lacks is
    written as an escape.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the least free number, which is this one
    sys.stdout, sys.stderr = sys.stdout or open(1, "w", closefd=False), sys.stderr or open(2, "w", closefd=False)  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _command(where: str) -> Callable[[argparse.Namespace], int]:
    """Imports and returns the command at ``module:function``. It does so now because a check of a proof needs few of the modules.

    Raises:
        CirisError: not_installed.
    """
    module, _, function = where.partition(":")
    try:
        command: Callable[[argparse.Namespace], int] = getattr(importlib.import_module(module), function)
    except ModuleNotFoundError as error:
        problem = f"this command needs {error.name}, which is not installed"
        raise CirisError(
            "not_installed", problem, hint="pip install '.[service]'; `ciris verify` needs no more than '.[verify]'"
        ) from error
    return command


def _fail(message: str, status: int) -> int:
    print("error:", " ".join(message.split()), file=sys.stderr)
    return status


def _joined(arguments: Sequence[str]) -> list[str]:
    """Joins ``--q -0.5,1`` to ``--q=-0.5,1``, because argparse takes a list that begins with a minus for an option."""
    joined: list[str] = []
    for argument in arguments:
        if joined and re.fullmatch(r"--[a-z-]+", joined[-1]) and re.match(r"-[\d.]", argument):
            joined[-1] = f"{joined[-1]}={argument}"
        else:
            joined.append(argument)
    return joined


if __name__ == "__main__":
    sys.exit(main())
