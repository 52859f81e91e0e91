"""``python -m tests.certifier.verify.fuzz_motion --seconds 3600``: files of motion proofs with changed bytes, judged one after the other.

Every file is refused with a ProofError, or what is stated of it is true (tests.certifier.verify.motion_oracle). Anything else is a
finding, and so is a file that takes longer than SLOW. A finding is printed and its file is kept in ``--findings``. The exit status is 1
if there was one. Every case can be made again from its number: ``--case 1234``. The file that is judged is kept as ``running-SEED.proof``,
where it can be found if the process dies or hangs.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from certifier.errors import ProofError
from certifier.model import Scene
from certifier.proof.motion import MotionProof
from certifier.verify.file import verify_file
from certifier.verify.motion import verify_motion
from tests.certifier.verify.motion_mutations import changed_bytes, changed_meaning, valid
from tests.certifier.verify.motion_oracle import MotionFile

SLOW = 3.0
"""A file of a few kilobytes that takes longer than this, in seconds, is a finding."""
MEMORY_BYTES = 8 << 30


@dataclass
class Campaign:
    """Counts what became of files."""

    outcomes: Counter[tuple[str, str]] = field(default_factory=Counter)
    slowest: float = 0.0
    _bounds: dict[tuple, tuple[bool, float]] = field(default_factory=dict)

    def judge(self, kind: str, data: bytes) -> str | None:
        """Returns what is wrong about the verifier's answer to a file; None where it is a refusal or true."""
        began = time.perf_counter()
        try:
            with np.errstate(all="ignore"):
                file = verify_file(data)
        except ProofError as error:
            self.outcomes[kind, error.code] += 1
            return self._took(began)
        except Exception:
            return traceback.format_exc()
        slow = self._took(began)
        if file.kind != "motion":
            return f"it is taken for a proof of kind {file.kind}"
        self.outcomes[kind, "accepted"] += 1
        return self.untrue(data) or slow

    def untrue(self, data: bytes) -> str | None:
        """Returns what is not true of what the verifier says of a file that it accepts."""
        stated = MotionFile(data)
        scene = Scene.from_document(stated.scene)
        gap = verify_motion(MotionProof.from_bytes(data, scene)).gap
        if stated.key not in self._bounds:
            if len(self._bounds) > 5000:
                self._bounds.clear()
            self._bounds[stated.key] = stated.within_limits(), stated.bound
        within, bound = self._bounds[stated.key]
        if not within:
            return "a control point is not within the limits"
        if not gap <= bound:
            return f"the bodies are said to be {gap!r} m apart at least, and they are {bound!r} m apart at most somewhere"
        return None

    def _took(self, began: float) -> str | None:
        took = time.perf_counter() - began
        self.slowest = max(self.slowest, took)
        return f"it takes {took:.1f} s" if took > SLOW else None

    def __str__(self) -> str:
        total, accepted = sum(self.outcomes.values()), sum(n for (_, code), n in self.outcomes.items() if code == "accepted")
        lines = [f"{total} files, {accepted} accepted and true, slowest {self.slowest:.2f} s"]
        return "\n".join([*lines, *(f"  {kind}, {code}: {n}" for (kind, code), n in sorted(self.outcomes.items()))])


def case(number: int, seed: int) -> tuple[str, bytes]:
    """Returns the kind and the file of a case."""
    rng = np.random.default_rng([seed, number])
    data = valid()[rng.integers(len(valid()))]
    if rng.random() < 0.7:
        return "bytes", changed_bytes(data, rng)
    return changed_meaning(data, rng)


def run(seconds: float, seed: int, findings: Path, say: Callable[[str], None], first: int = 0) -> int:
    """Judges files for some seconds and returns how many findings there were."""
    campaign, found, number = Campaign(), 0, first
    for data in valid():
        wrong = campaign.judge("unchanged", data)
        assert wrong is None, wrong
    end, told = time.monotonic() + seconds, time.monotonic()
    findings.mkdir(parents=True, exist_ok=True)
    running = findings / f"running-{seed}.proof"
    while time.monotonic() < end:
        kind, data = case(number, seed)
        running.write_bytes(data)
        wrong = campaign.judge(kind, data)
        if wrong:
            found += 1
            path = findings / f"{seed}-{number}.proof"
            path.write_bytes(data)
            say(f"FINDING in case {number} of seed {seed}, {kind}, kept in {path}: {wrong}")
        number += 1
        if time.monotonic() > told + 60:
            told = time.monotonic()
            say(f"{number} cases, {found} findings; {str(campaign).splitlines()[0]}")
    running.unlink(missing_ok=True)
    say(f"{campaign}\n{number - first} cases of seed {seed}, {found} findings")
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--findings", type=Path, default=Path(tempfile.gettempdir()) / "fuzz_motion")
    parser.add_argument("--case", type=int, help="judge this case alone")
    given = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    if given.case is None:
        return int(run(given.seconds, given.seed, given.findings, lambda line: print(line, flush=True)) > 0)
    campaign = Campaign()
    print(campaign.judge(*case(given.case, given.seed)) or campaign)
    return 0


if __name__ == "__main__":
    sys.exit(main())
