"""One function runs in a child process, which may die, hang or take too much memory without harming the caller.

Loading Drake takes longer than most of what is then asked of it. So a nursery (:mod:`certifier.isolation.nursery`) loads a module once
and forks a child for every call of one of its functions. It is kept for the next call, and it sees nothing of what the children read.

Arguments and results travel as JSON, in which NumPy arrays are ``{"__array__": ..., "dtype": ..., "shape": ...}``. Whatever native code
prints goes to a log, whose tail explains a death.
"""

from __future__ import annotations

import importlib
import json
import os
import signal
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict
from multiprocessing.connection import Pipe
from pathlib import Path
from typing import Any

from certifier.errors import CirisError, RegionError, SceneError
from certifier.isolation.confinement import Confinement, alone, clean

ERRORS = {cls.__name__: cls for cls in (CirisError, SceneError, RegionError)}
LOADED = b"loaded"
"""A nursery says this when it has loaded its module."""
LOADING_S = 600.0
"""Loading may take this long where functions are compiled for the first time, on a machine that does much else."""
KEEP = b"keep"
"""A message that begins so is no call: it gives a text to keep."""
TOLD = b"told"
"""A reply that begins so is no answer yet: it says how far the function is (:mod:`certifier.isolation.telling`)."""
TELL_S = 1.0
"""The asking process hears this often that the function still runs."""
STATUS = struct.Struct("i")
"""This says how a child ended, before its answer: 0, an exit status, or a signal with a minus."""
AT_ONCE = 2
"""Number of nurseries of a module that are kept for its next calls."""
MOST, MORE = 1000, 100
"""A nursery that has computed this many calls itself makes room for another one, whatever its libraries have left behind. It computes more,
while the other one loads.
"""
KEPT = 4
"""Number of texts that a nursery keeps, those that were named last."""
Tell = Callable[[dict[str, Any]], None]
"""Hears how far a function is."""
_TAIL_BYTES = 2000
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def run_in_child(
    function: str,
    payload: Any,
    *,
    timeout_s: float,
    memory_bytes: int,
    kept: tuple[str, str] | None = None,
    fork: bool = True,
    tell: Tell | None = None,
    confinement: Confinement | None = None,
) -> Any:
    """Returns ``function(payload)``, computed by a child process that is killed when it takes too long or outlives this process.

    Args:
        function: ``"package.module:name"``.
        payload: JSON-able data; NumPy arrays are allowed anywhere in it, as in the result.
        timeout_s: wall-clock limit in seconds, without what a new nursery takes to load the module.
        memory_bytes: limit of the child's address space in bytes.
        kept: a name, and a text that this program has written. The function gets what ``keep(text)`` of the module makes of it as a second
            argument. The nursery calls ``keep`` once for a name. So it reads a scene once for all calls about the scene.
        fork: whether a fork of the nursery computes it. The nursery itself takes half the time where a call takes some milliseconds, and
            what it has read of one call may be seen by the next. If it dies, the next call waits until another one has loaded the module.
        tell: hears every TELL_S seconds, and when the time is up, what the function has told by then: for each name what came last.
        confinement: which files a fork may reach; None: those that this process can reach. It never has a network, or variables of the
            environment that it does not need.

    In a child that may start no process, the function is called there.

    Raises:
        CirisError: the function's own error, of the class it was raised with; or ``child_timeout``, ``child_memory``, or
            ``child_died`` with the tail of its standard error.
    """
    module, _, name = function.partition(":")
    if alone():
        return getattr(importlib.import_module(module), name)(payload)
    call = {"function": name, "payload": payload, "memory_bytes": int(memory_bytes), "timeout_s": timeout_s}
    call |= {"kept": None if kept is None else kept[0], "fork": fork}
    where = Path.cwd() if confinement is None or not confinement.strange else confinement.directory or "/"
    call |= {"confinement": None if confinement is None else asdict(confinement), "directory": str(where)}
    nursery = _free(module)
    try:
        status, answer = nursery.ask(encode(call), timeout_s, kept, tell)
    except TimeoutError:
        message = f"it took more than {float(format(timeout_s, '.3g')):g} s and was stopped{nursery.tail()}"
        raise CirisError("child_timeout", message, hint="ask for less, or try again when the machine has less to do") from None
    except (EOFError, ConnectionError):
        raise _death(nursery.process.returncode, nursery.tail(), memory_bytes) from None
    tail = nursery.tail()
    waiting = _idle.setdefault(module, [])
    nursery.computed += not fork
    if nursery.computed >= MOST:
        nursery = _renewed(nursery, module)
    if len(waiting) < AT_ONCE:
        waiting.append(nursery)
    else:
        nursery.kill()
    if status != 0:
        raise _death(status, tail, memory_bytes)
    return _result(json.loads(answer, object_hook=decode))


def prepare(function: str, wait_s: float = 0.0) -> int:
    """Begins to load what the first call of a function needs, waits for it at most this long, and returns the id of the process."""
    module = function.partition(":")[0]
    nursery = _free(module)
    _idle[module].append(nursery)
    nursery.wait(wait_s)
    return nursery.process.pid


def _free(module: str) -> _Nursery:
    """Returns a nursery of the module that nobody else asks."""
    waiting = _idle.setdefault(module, [])
    while waiting:
        nursery = waiting.pop()
        if nursery.process.poll() is None:
            return nursery
        nursery.kill()
    return _Nursery(module)


def _renewed(nursery: _Nursery, module: str) -> _Nursery:
    """Returns what computes the next call, where a nursery has computed many: itself, until another one has had time to load."""
    if nursery.next is None:
        nursery.next = _Nursery(module)
    if nursery.computed < MOST + MORE:
        return nursery
    renewed, nursery.next = nursery.next, None
    nursery.kill()
    return renewed


class _Nursery:
    """Holds a process that has loaded a module, and the connection to it."""

    def __init__(self, module: str) -> None:
        self.computed, self._kept = 0, list[str]()
        self.next: _Nursery | None = None
        self._loaded = False
        self._connection, theirs = Pipe()
        self._log = tempfile.TemporaryFile()  # noqa: SIM115 - it lives as long as the process
        self._last_words = ""
        root = str(Path(__file__).resolve().parents[2])
        path = os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))
        with theirs:
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "certifier.isolation.nursery", module, str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                stdout=self._log,
                stderr=self._log,
                pass_fds=[theirs.fileno()],
                process_group=0,
                env={**clean(dict(os.environ)), **_ONE_THREAD, "PYTHONPATH": path},
            )

    def ask(self, request: bytes, timeout_s: float, kept: tuple[str, str] | None, tell: Tell | None) -> tuple[int, bytes]:
        """Returns how the child ended, and its answer. What is kept is sent first, unless the nursery has it.

        The nursery is killed before any error is raised.

        Raises:
            TimeoutError: the child has not ended in time.
            EOFError, ConnectionError: the nursery itself has ended.
        """
        self._log.seek(0)
        self._log.truncate()
        try:
            if not self._loaded:
                self._answer(LOADING_S)
                self._loaded = True
            if kept is not None and kept[0] not in self._kept:
                self._kept, gone = [*self._kept[1 - KEPT :], kept[0]], self._kept[: 1 - KEPT]
                self._connection.send_bytes(KEEP + encode({"name": kept[0], "text": kept[1], "gone": gone}))
            self._connection.send_bytes(request)
            reply = self._answer(timeout_s, tell)
        except BaseException:
            self.kill()
            raise
        return STATUS.unpack_from(reply)[0], reply[STATUS.size :]

    def wait(self, seconds: float) -> None:
        """Waits until the process has loaded, or has ended, but no longer than this."""
        if not self._loaded:
            self._connection.poll(seconds)

    def _answer(self, timeout_s: float, tell: Tell | None = None) -> bytes:
        """Returns what the nursery says next. Until then, ``tell`` hears how far the function is.

        Raises:
            TimeoutError: it has said nothing in time.
            EOFError, ConnectionError: it has ended.
        """
        told: dict[str, Any] = {}
        now = time.monotonic()
        until, again = now + timeout_s, now + TELL_S
        while True:
            if self._connection.poll(max(min(until, again) - now, 0.0)):
                reply = self._connection.recv_bytes()
                if not reply.startswith(TOLD):
                    return reply
                told |= json.loads(reply.removeprefix(TOLD))
            now = time.monotonic()
            if tell is not None and now >= min(until, again):
                tell(told)
            if now >= until:
                raise TimeoutError
            again = now + TELL_S if now >= again else again

    def kill(self) -> None:
        """Ends the process with its children, and the one that was to follow it."""
        if self.next is not None:
            self.next.kill()
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        self._connection.close()
        self._last_words = self.tail()
        self._log.close()

    def tail(self) -> str:
        """Returns the last lines of the log as one line after a colon, each once, without the frames of a traceback; empty without any."""
        if self._log.closed:
            return self._last_words
        self._log.seek(max(0, self._log.seek(0, os.SEEK_END) - _TAIL_BYTES))
        lines = self._log.read().decode(errors="replace").splitlines()
        text = " ".join(dict.fromkeys(line.strip() for line in lines if line.strip() and not line.startswith((" ", "Traceback"))))
        return f": {text}" if text else ""


_idle: dict[str, list[_Nursery]] = {}
"""Maps a module to the nurseries that wait for its next call, at most AT_ONCE, however many were needed at once."""
os.register_at_fork(after_in_child=_idle.clear)


def _result(answer: dict[str, Any]) -> Any:
    if "error" in answer:
        raise ERRORS[answer["class"]](**answer["error"])
    return answer["result"]


def _death(status: int, tail: str, memory_bytes: int) -> CirisError:
    if "MemoryError" in tail or "bad_alloc" in tail:
        message = f"it needed more than {memory_bytes / 2**30:.3g} GiB of memory{tail}"
        return CirisError("child_memory", message, hint="ask for less: fewer bodies, or fewer vertices")
    how = f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
    return CirisError("child_died", f"the process died ({how}){tail}", hint="try again; report it with these words if it dies again")


def encode(value: Any) -> bytes:
    """Returns a value as JSON with NumPy arrays.

    Raises:
        TypeError: something in the value cannot be JSON.
    """

    import numpy as np

    def array(x: Any) -> Any:
        if isinstance(x, np.generic):
            return x.item()
        if isinstance(x, np.ndarray):
            return {"__array__": x.tolist(), "dtype": str(x.dtype), "shape": x.shape}
        raise TypeError(f"{type(x).__name__} cannot travel to another process")

    return json.dumps(value, default=array).encode()


def decode(document: dict[str, Any]) -> Any:
    """Makes arrays again of what :func:`encode` made of them; it is an ``object_hook``."""
    if "__array__" in document:
        import numpy as np

        return np.array(document["__array__"], dtype=document["dtype"]).reshape(document["shape"])
    return document
