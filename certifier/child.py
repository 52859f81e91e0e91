"""Run one function in a fresh interpreter that may die, hang or swallow memory without harming the caller.

The child gets its arguments as JSON on standard input and answers with JSON on a private copy of standard output; whatever
native code prints goes to standard error, whose tail explains a death. NumPy arrays travel as ``{"__array__": ..., "dtype": ...}``.
"""

from __future__ import annotations

import ctypes
import importlib
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import IO, Any

import numpy as np

from certifier.errors import CirisError, RegionError, SceneError

_ERRORS = {cls.__name__: cls for cls in (CirisError, SceneError, RegionError)}
_TAIL_BYTES = 2000
_PR_SET_PDEATHSIG = 1
_ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def run_in_child(function: str, payload: Any, *, timeout_s: float, memory_bytes: int, directory: Path | None = None) -> Any:
    """``function(payload)`` computed by a child process that is killed when it takes too long or outlives this process.

    Args:
        function: ``"package.module:name"``.
        payload: JSON-able data; NumPy arrays are allowed anywhere in it, as in the result.
        timeout_s: wall-clock limit in seconds.
        memory_bytes: limit of the child's address space.
        directory: the child's working directory; None for this process's own.

    Raises:
        CirisError: the function's own error, of the class it was raised with; or ``child_timeout``, ``child_memory``, or
            ``child_died`` with the tail of its standard error.
    """
    root = str(Path(__file__).resolve().parent.parent)
    path = os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))
    request = _encode({"function": function, "payload": payload, "memory_bytes": int(memory_bytes), "parent": os.getpid()})
    with tempfile.TemporaryFile() as log:
        with subprocess.Popen(
            [sys.executable, "-m", "certifier.child"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log,
            cwd=directory,
            env={**os.environ, **_ONE_THREAD, "PYTHONPATH": path},
        ) as process:
            try:
                answer, _ = process.communicate(request, timeout=timeout_s)
            except subprocess.TimeoutExpired:
                process.kill()
                raise CirisError("child_timeout", f"it took more than {timeout_s:g} s and was stopped{_tail(log)}") from None
            except BaseException:
                process.kill()
                raise
        if process.returncode == 0:
            return _result(json.loads(answer, object_hook=_decode))
        raise _death(process.returncode, _tail(log), memory_bytes)


def _result(answer: dict[str, Any]) -> Any:
    if "error" in answer:
        raise _ERRORS[answer["class"]](**answer["error"])
    return answer["result"]


def _death(returncode: int, tail: str, memory_bytes: int) -> CirisError:
    if "MemoryError" in tail or "bad_alloc" in tail:
        return CirisError("child_memory", f"it needed more than {memory_bytes / 2**30:.3g} GiB of memory{tail}")
    how = f"signal {signal.Signals(-returncode).name}" if returncode < 0 else f"exit status {returncode}"
    return CirisError("child_died", f"the process died ({how}){tail}")


def _tail(log: IO[bytes]) -> str:
    """The last lines of a log in one, without the frames of a traceback, after a colon; empty for an empty log."""
    log.seek(max(0, log.seek(0, os.SEEK_END) - _TAIL_BYTES))
    lines = log.read().decode(errors="replace").splitlines()
    text = " ".join(line.strip() for line in lines if line.strip() and not line.startswith((" ", "Traceback")))
    return f": {text}" if text else ""


def _encode(value: Any) -> bytes:
    def array(x: Any) -> Any:
        if isinstance(x, np.generic):
            return x.item()
        if isinstance(x, np.ndarray):
            return {"__array__": x.tolist(), "dtype": str(x.dtype), "shape": x.shape}
        raise TypeError(f"{type(x).__name__} cannot travel to another process")

    return json.dumps(value, default=array).encode()


def _decode(document: dict[str, Any]) -> Any:
    if "__array__" in document:
        return np.array(document["__array__"], dtype=document["dtype"]).reshape(document["shape"])
    return document


def _confine(memory_bytes: int, parent: int) -> None:
    """Limit this process's memory, write no core file, and die with the parent."""
    resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            os.kill(os.getpid(), signal.SIGKILL)


def _main() -> None:
    with os.fdopen(os.dup(1), "wb") as answer:
        os.dup2(2, 1)
        request = json.loads(sys.stdin.buffer.read(), object_hook=_decode)
        _confine(request["memory_bytes"], request["parent"])
        module, name = request["function"].split(":")
        try:
            reply = {"result": getattr(importlib.import_module(module), name)(request["payload"])}
        except CirisError as error:
            reply = {"error": error.to_document(), "class": type(error).__name__ if type(error).__name__ in _ERRORS else "CirisError"}
        answer.write(_encode(reply))
        answer.flush()


if __name__ == "__main__":
    _main()
