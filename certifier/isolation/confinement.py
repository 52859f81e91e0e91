"""A child process is confined here before it computes: whatever takes it over finds no secrets, no network and no files of others.

Every layer is used where the kernel has it. ``Layers`` says which ones are on.
"""

from __future__ import annotations

import ctypes
import json
import math
import os
import resource
import subprocess
import sys
import sysconfig
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from certifier.isolation import landlock, seccomp

MOST_WRITTEN = 2**28
"""A child may write this many bytes of its answer, and of any file, its log among them."""
NICENESS = 5
"""Who reads files of strangers goes after the program that answers requests, and before solvers (workers.processes)."""
_MOST_FILES, _MOST_THREADS = 256, 64
_LONGEST_S = 2**31
"""A limit of the processor's time in seconds that is as good as none."""
_KEPT = ("PATH", "HOME", "LANG", "LANGUAGE", "TZ", "TMPDIR", "PYTHONPATH", "LD_LIBRARY_PATH", "XDG_CACHE_HOME", "VIRTUAL_ENV")
_KEPT_KINDS = ("LC_", "NUMBA_", "OMP_", "OPENBLAS_", "MKL_")
_NO_NEW_PRIVILEGES = 38
_NEW_USER, _NEW_NETWORK = 0x10000000, 0x40000000
_CAPABILITIES_VERSION = 0x20080522
_READ_ALL = 1 << 1 | 1 << 2
"""Root reads files of others with these capabilities (CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH)."""
_ROOM = Path(__file__).resolve().parents[1]
"""The only one of our packages that children read. Beside it a checkout may have a file of secrets."""
_SYSTEM = ("/lib", "/lib64", "/usr/lib", "/usr/lib64", "/usr/local/lib", "/etc/ld.so.cache", "/dev/urandom")


@dataclass(frozen=True)
class Confinement:
    """What a call may reach.

    Attributes:
        directory: the directory in which it writes; None: it writes nowhere.
        strange: whether it reads files of strangers. Then it reads only this directory, Python and its packages. It starts no process.
    """

    directory: str | None
    strange: bool


@dataclass(frozen=True)
class Layers:
    """Says which layers of a strange call's confinement are on.

    Attributes:
        namespaces: it has a user namespace and a network of its own.
        landlock: the version of Landlock that limits its files; 0 for none.
        seccomp: it can open no socket, start no process, and reach no other one.
    """

    namespaces: bool
    landlock: int
    seccomp: bool

    def __str__(self) -> str:
        files = f"Landlock {self.landlock}" if self.landlock else "no Landlock"
        words = ["namespaces" if self.namespaces else "no namespaces", files, "seccomp" if self.seccomp else "no seccomp"]
        return ", ".join(words)


_layers: list[Layers] = []
"""What confines this process, where it reads files of strangers."""


def clean(environment: dict[str, str]) -> dict[str, str]:
    """Returns the variables that a child needs. All others stay out, secrets among them."""
    return {name: value for name, value in environment.items() if name in _KEPT or name.startswith(_KEPT_KINDS)}


def limit(memory_bytes: int, seconds: float) -> None:
    """Limits what this process may take, and lets it write no core file.

    Args:
        memory_bytes: its address space, bytes.
        seconds: its processor time.
    """
    lasting = math.ceil(min(seconds, _LONGEST_S)) + 1
    most = {resource.RLIMIT_AS: memory_bytes, resource.RLIMIT_FSIZE: MOST_WRITTEN, resource.RLIMIT_CORE: 0}
    for kind, value in {**most, resource.RLIMIT_CPU: lasting, resource.RLIMIT_NOFILE: _MOST_FILES}.items():
        hard = resource.getrlimit(kind)[1]
        value = value if hard == resource.RLIM_INFINITY else min(value, hard)
        resource.setrlimit(kind, (value, value))


def confine(confinement: Confinement | None) -> None:
    """Confines this process, which has one thread. Without a confinement, it only loses what no child needs: sockets, above all."""
    if sys.platform != "linux":
        return
    strange = confinement is not None and confinement.strange
    if strange:
        os.nice(NICENESS)
    namespaces = strange and _alone_in_namespaces()
    _drop_capabilities(0 if strange else _READ_ALL)
    ctypes.CDLL(None).prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0)
    if confinement is not None and landlock.version():
        landlock.restrict(confinement.directory, _readable() if strange else None)
    filtered = seccomp.install(strange)
    if confinement is not None and confinement.directory is not None:
        tempfile.tempdir = os.environ["TMPDIR"] = confinement.directory
    if strange:
        _layers[:] = [Layers(namespaces, landlock.version(), filtered)]


def alone() -> bool:
    """Says whether this process may start no other one."""
    return bool(_layers)


@cache
def probed() -> Layers:
    """Confines a process as one that reads a stranger's files, and returns which layers are on there."""
    command = [sys.executable, "-P", "-m", __name__]
    environment = {**clean(dict(os.environ)), "PYTHONPATH": str(_ROOM.parent)}
    said = subprocess.run(command, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=True)
    return Layers(**json.loads(said.stdout))


def _readable() -> list[str]:
    paths = sysconfig.get_paths()
    return [str(_ROOM), *(paths[name] for name in ("stdlib", "platstdlib", "purelib", "platlib")), *_SYSTEM]


def _alone_in_namespaces() -> bool:
    """Gives this process a user namespace without users and a network with nothing in it, and returns whether it has them."""
    done = ctypes.CDLL(None).unshare(_NEW_USER | _NEW_NETWORK) == 0
    if done:  # here only its own threads count
        resource.setrlimit(resource.RLIMIT_NPROC, (_MOST_THREADS, _MOST_THREADS))
    return done


def _drop_capabilities(kept: int) -> None:
    """Takes all capabilities from this process but some, if it has those."""
    libc, header, sets = ctypes.CDLL(None), (ctypes.c_uint32 * 2)(_CAPABILITIES_VERSION, 0), (ctypes.c_uint32 * 6)()
    libc.capget(header, sets)
    effective, permitted = sets[0] & kept, sets[1] & kept
    libc.capset(header, (ctypes.c_uint32 * 6)(effective, permitted, 0, 0, 0, 0))


if __name__ == "__main__":
    confine(Confinement(None, strange=True))
    print(json.dumps(vars(_layers[0] if _layers else Layers(namespaces=False, landlock=0, seccomp=False))))
