"""``python -m certifier.isolation.nursery MODULE FD`` loads a module once and forks a child for every call of one of its functions.

If the module has a function ``warm_up()``, it is called once, to load what the first call would otherwise load. Then the nursery says that
it has loaded. The calls, and texts to keep for them, come over the connection FD from certifier.isolation.child. When that connection is
closed, the nursery ends, and its child with it.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import resource
import select
import signal
import sys
import threading
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from types import ModuleType
from typing import Any

from certifier.errors import CirisError
from certifier.isolation import telling
from certifier.isolation.child import ERRORS, KEEP, LOADED, STATUS, TOLD, decode, encode
from certifier.isolation.confinement import MOST_WRITTEN, Confinement, confine, limit
from certifier.orphans import die_with_parent

_CHUNK = 2**16
_kept: dict[str, Any] = {}


def main() -> None:
    connection = Connection(int(sys.argv[2]))
    with _ending_with(connection), _ending_with_parent():
        module = importlib.import_module(sys.argv[1])
        if hasattr(module, "warm_up"):
            module.warm_up()
    confine(None)
    gc.freeze()  # what is loaded stays: collecting garbage need not look at it, nor copy its pages in a child
    try:
        connection.send_bytes(LOADED)
        while True:
            request = connection.recv_bytes()
            if request.startswith(KEEP):
                _keep(module, **json.loads(request.removeprefix(KEEP)))
                continue
            call = json.loads(request, object_hook=decode)
            if call["fork"]:
                connection.send_bytes(_forked(module, connection, call))
                continue
            resource.setrlimit(resource.RLIMIT_AS, (call["memory_bytes"], resource.RLIM_INFINITY))
            with _ending_with(connection):
                status, reply = _computed(module, call)
            connection.send_bytes(STATUS.pack(status) + reply)
    except (EOFError, ConnectionError):
        return


@contextmanager
def _ending_with(connection: Connection) -> Iterator[None]:
    """Ends this process at once when the other end of the connection is closed while the block runs."""
    loaded, done = os.pipe()

    def watch() -> None:
        looking = select.poll()
        looking.register(connection, 0)  # only whether it is closed: a request may wait already
        looking.register(loaded, select.POLLIN)
        if any(descriptor == connection.fileno() for descriptor, _ in looking.poll()):
            os.kill(os.getpid(), signal.SIGKILL)

    watching = threading.Thread(target=watch, daemon=True)
    watching.start()
    try:
        yield
    finally:
        os.close(done)
        watching.join()  # this process forks, and has one thread then
        os.close(loaded)


@contextmanager
def _ending_with_parent() -> Iterator[None]:
    """Ends this process at once when its parent dies while the block runs, which may compile for a minute.

    The thread that started this process waits while the nursery loads, and may be gone later.
    """
    die_with_parent()
    try:
        yield
    finally:
        die_with_parent(0)


def _keep(module: ModuleType, name: str, text: str, gone: list[str]) -> None:
    """Keeps what the module makes of a text for the calls that name it, and drops what is gone."""
    for former in gone:
        del _kept[former]
    _kept[name] = module.keep(text)
    gc.freeze()


def _forked(module: ModuleType, connection: Connection, call: dict[str, Any]) -> bytes:
    """Forks a child for a call, passes on what it tells, and returns how it ended and its answer.

    Raises:
        EOFError: the asking process is gone, and so is the child.
    """
    reading, writing = os.pipe()
    nursery = os.getpid()
    child = os.fork()
    if child == 0:
        os.close(reading)
        connection.close()
        os._exit(_answer(module, call, writing, nursery))
    os.close(writing)
    answer, gone = bytearray(), False
    while len(answer) <= MOST_WRITTEN:
        gone = connection in wait([reading, connection])  # the asking process sends nothing before there is an answer
        chunk = b"" if gone else os.read(reading, _CHUNK)
        if not chunk:
            break
        answer += chunk
        if b"\n" in chunk:  # an answer has no line breaks
            *told, answer = answer.split(b"\n")
            for line in told:
                connection.send_bytes(TOLD + line)
    os.close(reading)
    if gone or len(answer) > MOST_WRITTEN:
        os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    if gone:
        raise EOFError
    return STATUS.pack(os.waitstatus_to_exitcode(status)) + answer


def _answer(module: ModuleType, call: dict[str, Any], writing: int, nursery: int) -> int:
    """Answers a call in the child, and returns the child's exit status."""
    die_with_parent(parent=nursery)
    limit(call["memory_bytes"], call["timeout_s"])
    if call["confinement"] is not None:
        confine(Confinement(**call["confinement"]))
    telling.begin(writing)
    status, reply = _computed(module, call)
    with os.fdopen(writing, "wb") as answer:
        answer.write(reply)
    return status


def _computed(module: ModuleType, call: dict[str, Any]) -> tuple[int, bytes]:
    """Returns the exit status of a call, and its answer."""
    try:
        os.chdir(call["directory"])
        try:
            given = [] if call["kept"] is None else [_kept[call["kept"]]]
            reply = {"result": getattr(module, call["function"])(call["payload"], *given)}
        except CirisError as error:
            reply = {"error": error.to_document(), "class": type(error).__name__ if type(error).__name__ in ERRORS else "CirisError"}
        return 0, encode(reply)
    except BaseException:
        traceback.print_exc()
        return 1, b""
    finally:
        sys.stdout.flush()
        sys.stderr.flush()


if __name__ == "__main__":
    main()
