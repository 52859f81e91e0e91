"""``ciris verify`` checks a proof file on this machine, with nothing installed but numpy and python-flint.

Files come from strangers, so a child process checks them, with limits on its time and its memory.
"""

from __future__ import annotations

import stat
import sys
import tempfile
import threading
from argparse import Namespace
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from certifier.errors import CirisError, unreadable
from certifier.isolation.child import run_in_child
from certifier.names import escaped
from certifier.proof.limits import FILE_BYTES
from client.cores import cores
from client.output import Screen, print_json

HOLDS, DOES_NOT = 0, 1
REFUSED = "get the file again from whom you have it, or grow the region again; believe nothing that this file says"
UNCHECKED = "the proof may hold; the verifier takes no files of this size, because they may come from strangers"
"""These say what to do about every proof that does not hold, and about one that is too large."""
MEMORY_BYTES = 4 << 30
"""This is the limit of each process, of which there is one for each core."""
TIMEOUT_S = 3600.0


def verify(args: Namespace) -> int:
    """Checks a file, prints what it proves, and returns the command's exit status.

    Raises:
        CirisError: the file cannot be read.
    """
    with readable(Path(args.proof)) as path:
        found = _answer(path)
    if args.json:
        print_json(found)
    elif found["holds"]:
        print("the proof holds:", *found["statement"], sep="\n  ")
    if found["holds"]:
        return HOLDS
    problem = CirisError.from_document(found["error"])
    what = "could not be checked" if problem.code.startswith("child_") or problem.code == "proof_too_large" else "does not hold"
    print("error:", escaped(f"{args.proof}: the proof {what}: ") + " ".join(str(problem).split()), file=sys.stderr)
    return DOES_NOT


def in_child(function: str, proof: str) -> dict[str, Any]:
    """Returns what a function says of a proof file. It runs in a child process, and gets the file's ``path`` and a number of ``processes``.

    Raises:
        CirisError: what the function raises, with the proof's name as users know it.
    """
    with readable(Path(proof)) as path:
        payload = {"path": str(path.absolute()), "processes": cores()}
        try:
            found: dict[str, Any] = run_in_child(function, payload, timeout_s=TIMEOUT_S, memory_bytes=MEMORY_BYTES)
        except CirisError as error:
            error.field = escaped(proof)
            raise
    return found


@contextmanager
def readable(path: Path) -> Iterator[Path]:
    """Yields a path at which a child process finds the proof: the file itself, or a copy of what comes from a pipe.

    Raises:
        CirisError: no_file, naming the path.
    """
    where = path.absolute()
    try:
        if stat.S_ISREG(where.stat().st_mode) and where.parts[1] not in ("dev", "proc"):
            yield where
            return
        with tempfile.NamedTemporaryFile(prefix="ciris-") as copy, open(where, "rb") as pipe:
            copy.write(pipe.read(FILE_BYTES + 1))
            copy.flush()
            yield Path(copy.name)
    except (OSError, CirisError) as error:
        if isinstance(error, CirisError) and error.code != "no_file":
            raise
        what = error.message if isinstance(error, CirisError) else unreadable(error)
        raise CirisError("no_file", what, field=escaped(str(path)), hint="name a proof file") from None


def _answer(path: Path) -> dict[str, Any]:
    """Returns what :func:`certifier.verify.file.answer` says of the file, or which error ended the child process that checked it."""
    try:
        with _progress() as told:
            payload = {"path": str(path.absolute()), "processes": cores(), "progress": str(told)}
            found: dict[str, Any] = run_in_child(
                "certifier.verify.file:answer_about_file", payload, timeout_s=TIMEOUT_S, memory_bytes=MEMORY_BYTES
            )
    except CirisError as error:
        if error.code == "no_file":
            raise
        found = {"holds": False, "error": {**error.to_document(), "message": escaped(error.message)}}
    if not found["holds"]:
        found["error"]["hint"] = found["error"]["hint"] or (UNCHECKED if found["error"]["code"] == "proof_too_large" else REFUSED)
    return found


@contextmanager
def _progress() -> Iterator[Path]:
    """Yields a file in which the child process says how far it has come; a terminal shows it in its status line."""
    screen, ended = Screen(), threading.Event()

    def show(told: Path) -> None:
        while not ended.wait(0.2):
            numbers = told.read_text().split()
            if len(numbers) == 2:
                done, total = map(int, numbers)
                screen.status(f"{done} of {total} cells and proofs checked", done / total)

    with tempfile.NamedTemporaryFile(prefix="ciris-") as file:
        thread = threading.Thread(target=show, args=(Path(file.name),), daemon=True)
        thread.start()
        try:
            yield Path(file.name)
        finally:
            ended.set()
            thread.join()
            screen.clear()
