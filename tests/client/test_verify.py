"""``ciris verify`` of any file: one line, an exit status, and no more time and memory than it may have."""

from __future__ import annotations

import subprocess
import time
from dataclasses import replace
from pathlib import Path

import pytest

from certifier.model import WORLD, Ignored, Pair
from certifier.proof import limits
from certifier.proof.container import pack, unpack, with_scene
from certifier.proof.region import RegionProof
from certifier.verify.file import answer
from client.output import Screen
from client.verify import _progress
from tests.certifier.proofs import region
from tests.certifier.scenes import planar_arm
from tests.certifier.verify.partitions import Producer
from tests.client.conftest import Ciris, command, surroundings


def test_what_cannot_be_read_is_bad_input(ciris: Ciris, tmp_path: Path) -> None:
    (tmp_path / "directory").mkdir()
    for name, words in (
        ("missing", "no such file"),
        ("directory", "it is a directory"),
        ("missing/more", "no such file"),
        ("a\nb", "a\\nb"),
    ):
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
    what = "could not be checked" if size > limits.FILE_BYTES else "does not hold"
    assert f"zeros: the proof {what}: " in done.error
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


@pytest.mark.parametrize(
    ("line", "printed"),
    [
        ("verify region", True),
        ("verify <(cat region)", True),
        ("verify /dev/stdin < region", True),
        ("verify region <&-", True),
        ("verify region >&-", False),
        ("verify --json region >&-", False),
        ("verify region <&- >&- 2>&-", False),
    ],
)
def test_wherever_the_proof_comes_from_and_the_answer_goes(tmp_path: Path, line: str, printed: bool) -> None:
    (tmp_path / "region").write_bytes(region())
    ciris = " ".join(command())
    done = subprocess.run(["bash", "-c", f"{ciris} {line}"], cwd=tmp_path, env=surroundings(), capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("the proof holds:") == printed


def test_a_letter_that_the_terminal_lacks_is_escaped(tmp_path: Path) -> None:
    proof = RegionProof.from_bytes(region())
    a, b = sorted(geometry.name for geometry in proof.scene.geometries)[:2]
    ignored = tuple(i for i in proof.scene.ignored if (i.a, i.b) != (a, b))
    scene = replace(proof.scene, ignored=(*ignored, Ignored(a, b, "\u00fcber ein Gelenk")))
    assert Pair(a, b) not in scene.pairs
    (tmp_path / "region").write_bytes(replace(proof, scene=scene, proofs=tuple(replace(p, scene=scene) for p in proof.proofs)).to_bytes())
    environment = surroundings(PYTHONIOENCODING="ascii")
    done = subprocess.run(command("verify", "region"), cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "\\xfcber ein Gelenk" in done.stdout


def test_a_proof_over_a_partition_is_checked_by_all_cores(ciris: Ciris, tmp_path: Path) -> None:
    scene = planar_arm(2)
    proof = Producer(scene, scene.pairs[1], WORLD, [-0.2, -0.1], [0.3, 0.3]).proof(least=3)
    data = with_scene(proof.to_bytes(), scene)
    (tmp_path / "cells").write_bytes(data)
    done = ciris("verify", "cells")
    assert done.status == 0
    assert "'arm/link2/bar' and 'world/obstacle'" in done.stdout
    assert ciris("verify", "cells", "--json").json == answer(data)
    header, arrays = unpack(data, "partition")
    (tmp_path / "turned").write_bytes(pack(header, {**arrays, "proof/0/planes": -arrays["proof/0/planes"]}))
    done = ciris("verify", "turned")
    assert (done.status, done.raw) == (1, b"")
    assert "cell 0, vertex 0 of arm/link2/bar" in done.error


def test_the_progress_of_a_check_is_a_status_line(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[tuple[str, float]] = []
    monkeypatch.setattr(Screen, "status", lambda _, text, part: shown.append((text, part)))
    with _progress() as told:
        told.write_text("256\n1000\n")
        for _ in range(100):
            if shown:
                break
            time.sleep(0.05)
    assert shown[0] == ("256 of 1000 cells and proofs checked", 0.256)
