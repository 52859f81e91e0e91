"""Landlock keeps this process, and all that it starts, from files and from TCP (Linux 5.13 and newer; docs.kernel.org, userspace-api)."""

from __future__ import annotations

import ctypes
import os
import stat
from collections.abc import Iterable

_CREATE, _ADD_RULE, _RESTRICT = 444, 445, 446
_VERSION, _PATH_BENEATH = 1, 1
_EXECUTE, _WRITE_FILE, _READ_FILE, _READ_DIR, _TRUNCATE = 1 << 0, 1 << 1, 1 << 2, 1 << 3, 1 << 14
_READING = _EXECUTE | _READ_FILE | _READ_DIR
_OF_FILES = _EXECUTE | _WRITE_FILE | _READ_FILE | _TRUNCATE
_OWN = sum(1 << bit for bit in (1, 2, 3, 4, 5, 7, 8, 13, 14))
"""In its own directory a process may read, write, make and remove files and directories."""
_BITS = {1: 13, 2: 14, 3: 15, 4: 15}
"""Number of rights that a version of Landlock knows about files; 16 since version 5."""
_TCP = 0b11
_SCOPES = 0b11
"""Abstract sockets and signals reach only processes that are confined with this one."""
_libc = ctypes.CDLL(None, use_errno=True)


class _Ruleset(ctypes.Structure):
    _fields_ = [("files", ctypes.c_uint64), ("network", ctypes.c_uint64), ("scoped", ctypes.c_uint64)]


class _Beneath(ctypes.Structure):
    _pack_ = 1
    _fields_ = [("allowed", ctypes.c_uint64), ("parent", ctypes.c_int32)]


def version() -> int:
    """Returns the version of Landlock that the kernel has; 0 for none."""
    return max(0, _libc.syscall(_CREATE, None, ctypes.c_size_t(0), _VERSION))


def restrict(own: str | None, readable: Iterable[str] | None) -> None:
    """Lets this process write in its own directory and to /dev/null only. It must have given up new privileges.

    Args:
        own: its directory; None for no directory.
        readable: files and directories that it may read; those that do not exist are left out. None: it may read what it could read before.

    Raises:
        OSError: the kernel refused.
    """
    abi = version()
    handled = (1 << _BITS.get(abi, 16)) - 1
    if readable is None:
        handled &= ~_READING
    ruleset = _Ruleset(handled, _TCP if abi >= 4 else 0, _SCOPES if abi >= 6 else 0)
    size = 8 if abi < 4 else 16 if abi < 6 else 24
    rules = _checked(_libc.syscall(_CREATE, ctypes.byref(ruleset), ctypes.c_size_t(size), 0))
    try:
        _allow(rules, "/dev/null", (_WRITE_FILE | _READ_FILE) & handled)
        if own is not None:
            _allow(rules, own, _OWN & handled)
        for path in readable or ():
            _allow(rules, path, _READING)
        _checked(_libc.syscall(_RESTRICT, rules, 0))
    finally:
        os.close(rules)


def _allow(rules: int, path: str, rights: int) -> None:
    try:
        place = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except OSError:  # what cannot be reached needs no permission
        return
    try:
        if not stat.S_ISDIR(os.fstat(place).st_mode):
            rights &= _OF_FILES
        rule = _Beneath(rights, place)
        _checked(_libc.syscall(_ADD_RULE, rules, _PATH_BENEATH, ctypes.byref(rule), 0))
    finally:
        os.close(place)


def _checked(result: int) -> int:
    if result < 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return result
