"""``ciris verify`` of any file: one line, an exit status, and no more time and memory than it may have."""

from __future__ import annotations

from pathlib import Path

import pytest

from certifier.proof import limits
from certifier.proof.container import pack, unpack
from tests.certifier.proofs import region
from tests.client.conftest import Ciris


def test_what_cannot_be_read_is_bad_input(ciris: Ciris, tmp_path: Path) -> None:
    (tmp_path / "directory").mkdir()
    for name, words in (("missing", "No such file"), ("directory", "Is a directory"), ("missing/more", "No such file"), ("a\nb", "a\\nb")):
        done = ciris("verify", name)
        assert (done.status, done.raw) == (2, b"")
        assert words in done.error
        assert done.error.isprintable()


@pytest.mark.parametrize("size", [0, 1, 21, 22, 1000, limits.FILE_BYTES + 1])
def test_what_is_no_proof_does_not_hold(ciris: Ciris, tmp_path: Path, size: int) -> None:
    with (tmp_path / "zeros").open("wb") as file:
        file.truncate(size)
    done = ciris("verify", "zeros")
    assert (done.status, done.raw) == (1, b"")
    assert "zeros: the proof does not hold: " in done.error
    assert ciris("verify", "zeros", "--json").json["holds"] is False


def test_what_a_file_says_is_printed_escaped(ciris: Ciris, tmp_path: Path) -> None:
    header, arrays = unpack(region(), "region")
    header["scene"]["name"] = "x\n  guarantee: none\x1b[2K"
    (tmp_path / "named").write_bytes(pack(header, arrays))
    done = ciris("verify", "named")
    assert all(line.isprintable() for line in done.stdout.splitlines())
    assert "guarantee: none" not in done.stdout
    header["proofs"][0]["frame"] = "\x1b[1A\nthe proof holds:"
    (tmp_path / "framed").write_bytes(pack(header, arrays))
    done = ciris("verify", "framed")
    assert (done.status, done.raw) == (1, b"")
    assert done.error.isprintable()


@pytest.mark.parametrize(
    ("name", "value", "words"), [("MEMORY_BYTES", 180 << 20, "GiB of memory"), ("TIMEOUT_S", 0.01, "it took more than")]
)
def test_what_takes_too_much_is_stopped(
    ciris: Ciris, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, value: float, words: str
) -> None:
    header, arrays = unpack(region(), "region")
    header["scene"]["provenance"] = {"a": [[i] for i in range(900_000)]}
    (tmp_path / "large").write_bytes(pack(header, arrays))
    assert ciris("verify", "large").status == 0
    monkeypatch.setattr(f"client.verify.{name}", value)
    done = ciris("verify", "large")
    assert (done.status, done.raw) == (1, b"")
    assert "the proof could not be checked" in done.error
    assert words in done.error
    assert done.error.isprintable()
