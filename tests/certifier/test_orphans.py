"""Children that certify pairs, or check proofs, end with the process that forked them, however that ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CERTIFYING = """
import os, time
from certifier.jobs.parallel import side_by_side
def certify(index, part):
    os.write(1, f"{os.getpid()}\\n".encode())
    time.sleep(600)
next(side_by_side(certify, [(0, 0), (1, 0)], 2, lambda index: index))
"""
CHECKING = """
import os, time
from certifier.verify import separations
class Check:
    def parts(self):
        return iter([separations.Part(0, None), separations.Part(1, None)])
    def gap(self, part):
        os.write(1, f"{os.getpid()}\\n".encode())
        time.sleep(600)
next(separations._results(Check(), 2))
"""


def lives(process: int) -> bool:
    """Returns whether a process exists that is no zombie."""
    with suppress(OSError):
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    return False


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux signals the death of a parent")
@pytest.mark.parametrize("program", [CERTIFYING, CHECKING], ids=["certifying", "checking"])
def test_children_end_with_a_parent_that_is_killed(program: str) -> None:
    parent = subprocess.Popen([sys.executable, "-c", program], cwd=ROOT, stdout=subprocess.PIPE, text=True)
    assert parent.stdout is not None
    children = [int(parent.stdout.readline()) for _ in range(2)]
    assert all(lives(child) for child in children)
    parent.kill()
    parent.wait()
    until = time.monotonic() + 20
    while any(lives(child) for child in children) and time.monotonic() < until:
        time.sleep(0.05)
    left = [child for child in children if lives(child)]
    for child in left:
        os.kill(child, signal.SIGKILL)
    assert not left
