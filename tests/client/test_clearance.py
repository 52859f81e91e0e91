"""``ciris clearance``: what it prints of a region's proof file, what it keeps, and what it refuses."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.certifier.jobs.test_clearance import region
from tests.certifier.motions import swing
from tests.client.conftest import Ciris


@pytest.fixture
def proof(tmp_path: Path) -> Path:
    path = tmp_path / "region.proof"
    path.write_bytes(region(swing(0.02), [-1.0], [0.8]))
    return path


def test_the_clearance_of_a_region_is_printed_and_its_proof_kept(ciris: Ciris, proof: Path, tmp_path: Path) -> None:
    kept = tmp_path / "clearance.proof"
    done = ciris("clearance", proof, "--out", kept)
    assert (done.status, done.stderr) == (0, "")
    for word in ("clearance  at least", "closest", "mm apart", "q = ", f"check it: ciris verify {kept}"):
        assert word in done.stdout
    assert re.search(r"q = \(\S+\) rad$", done.stdout, re.MULTILINE)
    found = ciris("clearance", proof, "--json").json
    assert 0.9 * 0.02 <= found["clearance"] <= 0.02
    assert (found["tight"], found["proof"]) == (True, None)
    checked = ciris("verify", kept)
    assert checked.status == 0
    assert "padding 0.00" in checked.stdout


def test_what_is_no_region_is_refused(ciris: Ciris, tmp_path: Path) -> None:
    other = tmp_path / "other.proof"
    other.write_bytes(b"nothing")
    done = ciris("clearance", other)
    assert (done.status, done.stdout) == (2, "")
    assert str(other) in done.error
    assert "there is no such file" in ciris("clearance", tmp_path / "none.proof").error
