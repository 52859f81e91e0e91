"""A seccomp filter has the kernel refuse calls that no parser needs (Linux on x86-64). It holds for this process and all that it starts."""

from __future__ import annotations

import ctypes
import errno
import os
import platform
import struct
from collections.abc import Iterable

MACHINE = "x86_64"
_SET_SECCOMP, _FILTER = 22, 2
_AUDIT_X86_64, _X32 = 0xC000003E, 0x40000000
_LOAD, _EQUAL, _AT_LEAST, _ANY_BIT, _RETURN = 0x20, 0x15, 0x35, 0x45, 0x06
_ALLOW, _KILL, _ERROR = 0x7FFF0000, 0x80000000, 0x00050000
_NUMBER, _ARCHITECTURE, _FIRST = 0, 4, 16
"""Where the kernel says a call's number, its architecture and the lower half of its first argument."""
_CLONE, _CLONE3, _CLONE_THREAD = 56, 435, 0x10000
_TO_OTHERS = {"kill": 62, "tgkill": 234, "prlimit64": 302}
"""Calls whose first argument is a process: 0 or a number."""

EVERY = {
    "socket": 41,
    "ptrace": 101,
    "process_vm_readv": 310,
    "process_vm_writev": 311,
    "pidfd_getfd": 438,
    "io_uring_setup": 425,
    "bpf": 321,
    "perf_event_open": 298,
    "userfaultfd": 323,
    "add_key": 248,
    "request_key": 249,
    "keyctl": 250,
}
"""No child needs these: they reach the network, the memory of other processes, or seldom used parts of the kernel."""
STRANGE = {
    "vfork": 58,
    "fork": 57,
    "execve": 59,
    "execveat": 322,
    "unshare": 272,
    "setns": 308,
    "mount": 165,
    "umount2": 166,
    "pivot_root": 155,
    "chroot": 161,
    "open_tree": 428,
    "move_mount": 429,
    "fsopen": 430,
    "fsconfig": 431,
    "fsmount": 432,
    "open_by_handle_at": 304,
    "pidfd_open": 434,
    "pidfd_send_signal": 424,
    "tkill": 200,
    "rt_sigqueueinfo": 129,
    "rt_tgsigqueueinfo": 297,
    "setpgid": 109,
    "setsid": 112,
    "shmget": 29,
    "shmat": 30,
    "semget": 64,
    "msgget": 68,
}
"""A parser of a stranger's files starts no process, reaches none, and changes neither its namespaces nor its process group."""


def install(strange: bool) -> bool:
    """Refuses the calls, and returns whether the kernel does so. This process must have given up new privileges.

    Args:
        strange: also refuse those of ``STRANGE``, new processes, and signals and limits for other processes.
    """
    if platform.machine() != MACHINE:  # elsewhere calls have other numbers
        return False
    program = _program(strange)
    code = ctypes.create_string_buffer(program)
    pointer = struct.pack("HxxxxxxQ", len(program) // 8, ctypes.addressof(code))
    return bool(ctypes.CDLL(None).prctl(_SET_SECCOMP, _FILTER, ctypes.create_string_buffer(pointer), 0, 0) == 0)


def _program(strange: bool) -> bytes:
    refused = _ERROR | errno.EPERM
    steps = [
        _step(_LOAD, _ARCHITECTURE),
        _step(_EQUAL, _AUDIT_X86_64, 1, 0),
        _step(_RETURN, _KILL),
        _step(_LOAD, _NUMBER),
        _step(_AT_LEAST, _X32, 0, 1),
        _step(_RETURN, _KILL),
    ]
    for number in EVERY.values():
        steps += _where(number, [_step(_RETURN, refused)])
    if strange:
        for number in STRANGE.values():
            steps += _where(number, [_step(_RETURN, refused)])
        steps += _where(_CLONE3, [_step(_RETURN, _ERROR | errno.ENOSYS)])  # the C library calls clone then, whose flags can be seen
        allow = _step(_RETURN, _ALLOW)
        steps += _where(_CLONE, [_step(_LOAD, _FIRST), _step(_ANY_BIT, _CLONE_THREAD, 1, 0), _step(_RETURN, refused), allow])
        own = [_step(_LOAD, _FIRST), _step(_EQUAL, os.getpid(), 2, 0), _step(_EQUAL, 0, 1, 0), _step(_RETURN, refused), allow]
        for number in _TO_OTHERS.values():
            steps += _where(number, own)
    return b"".join([*steps, _step(_RETURN, _ALLOW)])


def _where(number: int, steps: Iterable[bytes]) -> list[bytes]:
    """Returns the steps for one call, which the others jump over."""
    own = list(steps)
    return [_step(_EQUAL, number, 0, len(own)), *own]


def _step(code: int, value: int, then: int = 0, otherwise: int = 0) -> bytes:
    return struct.pack("HBBI", code, then, otherwise, value)
