"""How processes go after others."""

from __future__ import annotations

import os
import subprocess
import sys

TWICE = """
import os, subprocess, sys
from workers.processes import NICENESS, give_way

child = subprocess.Popen(["sleep", "60"])
niceness = os.getpriority(os.PRIO_PROCESS, 0) + NICENESS
give_way(niceness)
if os.fork() == 0:
    give_way(niceness, child.pid)
    print(*(os.getpriority(os.PRIO_PROCESS, pid) for pid in (os.getppid(), os.getpid(), child.pid)))
else:
    os.wait()
    child.kill()
"""


def test_a_process_that_is_forked_later_goes_no_further_behind_than_the_first() -> None:
    own = os.getpriority(os.PRIO_PROCESS, 0)
    said = subprocess.run([sys.executable, "-c", TWICE], capture_output=True, text=True, check=True, timeout=60).stdout
    assert [int(one) - own for one in said.split()] == [10] * 3
