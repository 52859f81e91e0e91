"""Makers' arms from an installed wheel: one drafts, loads and moves in the check; the slow suite takes two through every step."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks import commands, makers, report
from benchmarks.__main__ import FAILED, OK, main
from certifier.errors import CirisError
from certifier.jobs.motion import certify
from certifier.motion.given import given
from certifier.outcome import Outcome
from certifier.proof.motion import Space
from certifier.scene.draft import Part, draft
from certifier.verify.file import verify_file

QUIET: Any = lambda _: None  # noqa: E731
REGION = {
    "share": {"value": 0.5},
    "halfspace_offsets": [1.0] * 20,
    "provenance": {"growth_curve": [{"seconds": 5.0, "share": 0.25}, {"seconds": 9.0, "share": 0.5}]},
}
SCENE = {"joints": [{}] * 6, "pairs": [{}] * 40, "ignored": [{}] * 3, "touching": []}


def standing(arm: makers.Arm) -> list[Part]:
    """What stands around an arm, as the arguments of the command say it."""
    texts = [text.rpartition("@") for text in arm.world[1::2]]
    return [Part(Path(file), "", *(tuple(float(x) for x in place.split(",")),)) for file, _, place in texts]  # type: ignore[arg-type]


def test_an_arm_with_a_gripper_is_drafted_from_its_wheel_and_moves(tmp_path: Path) -> None:
    """Its three boxes are pairs with each of the 13 things around it, and the verifier accepts the proof of a motion."""
    arm = makers.ARMS["ur5_gripper"]
    drafted = draft(arm.file, standing(arm), tmp_path / "scene.yaml", {})
    scene, seed = drafted.scene, drafted.seed
    assert (scene.n, len(scene.pairs), drafted.overlapping) == (6, 157, ())
    gripper = [pair for pair in scene.pairs if pair.b.startswith("ur5/tool0/") and not pair.a.startswith("ur5/")]
    assert len(gripper) == 3 * 13
    assert seed is not None
    verdict = certify(scene, given(scene, np.array([seed, seed + 0.1]), Space.Q))
    assert verdict.outcome is Outcome.CERTIFIED
    assert verdict.proof is not None
    statement = verify_file(verdict.proof)
    assert (statement.kind, statement.scene.hash) == ("motion", scene.hash)


def test_each_arm_of_the_first_wheel_is_where_it_is_looked_for() -> None:
    for arm in makers.ARMS.values():
        if arm.wheel == makers.ROBOPLAN:
            assert arm.file.is_file(), arm
    assert all(Path(file).is_file() for file in (makers.TABLE, makers.SHELF, makers.BIN))


def test_a_step_that_fails_says_why_and_the_other_arms_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """One arm's region does not grow, its motions are planned all the same; another's models are not installed."""

    def run(*arguments: str) -> subprocess.CompletedProcess[str]:
        said = "seeding: done after 2.04 s\n" if arguments[0] == "grow" else ""
        if "grow" in arguments and "home,q_star" in arguments:
            return subprocess.CompletedProcess(arguments, 2, "", f"{said}error: the deadline was reached\n")
        if "grow" in arguments:
            Path(arguments[-1]).write_bytes(b"0" * 3_000_000)
        return subprocess.CompletedProcess(arguments, 0, json.dumps({"grow": REGION, "scene": SCENE}.get(arguments[0], {})), said)

    known = makers.Arm(makers.ROBOPLAN, "an.urdf")
    absent = makers.Arm("robots-of-nobody", "an.urdf")
    monkeypatch.setattr(makers, "ARMS", {"one": makers.Arm(makers.ROBOPLAN, "an.urdf", "home"), "two": absent, "three": known})
    monkeypatch.setattr(commands, "run", run)
    planned = {"asked": 10, "answered": 9, "proved": 8, "p50_seconds": 0.125, "worst_seconds": 2.5}
    monkeypatch.setitem(makers._STEPS, "plan", ("load", lambda _, found: found.update(planned)))
    document = makers.arms(["one", "two", "three"], 20.0, 10, QUIET)
    one, two, three = document["rows"]
    assert one["failed"] == {"grow": "the deadline was reached"}
    assert one["grow"] == {"proposal_seconds": 2.04, "seconds": one["grow"]["seconds"]}
    assert one["plan"] == {**planned, "seconds": one["plan"]["seconds"]}
    assert "verify" not in one
    assert two["failed"] == {"draft": "robots-of-nobody is not installed (pip install robots-of-nobody)"}
    assert set(two) == {"arm", "failed", "draft"}
    assert three["failed"] == {}
    text = report.text(document)
    assert "one, grow: the deadline was reached" in text
    assert "two, draft: robots-of-nobody is not installed" in text
    cells = ["three", "6", "40", "3", "2.0", "0.250 after 5 s", "0.500", "3.0", "0.12", "2.50", "9 of 10", "8 of 10"]
    (line,) = [line.split("|") for line in text.splitlines() if line.startswith("| three")]
    assert [cell.strip() for cell in line if cell.strip() in cells] == cells
    for names, status in ((["one", "three"], FAILED), (["three"], OK)):
        monkeypatch.setattr(sys, "argv", ["bench", "arms", *names, "--json"])
        assert main() == status
    with pytest.raises(CirisError, match="there is no arm 'r2d2'"):
        makers.arms(["one", "r2d2"], 20.0, 10, QUIET)


@pytest.mark.slow
def test_two_arms_go_all_the_way_by_the_commands() -> None:
    """One of each wheel. Shares and seconds are for people to read; what is answered has to be proved."""
    command = [sys.executable, "-m", "client.cli", "bench", "arms", "fr3", "ur10", "--deadline", "300", "--json"]
    document = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    for row, joints in zip(document["rows"], (7, 6), strict=True):
        assert row["failed"] == {}
        assert row["load"]["joints"] == joints
        assert 0 < row["grow"]["curve"][0]["share"] <= row["grow"]["share"] <= 1
        assert row["plan"]["asked"] == 10
        assert row["grow"]["proposal_seconds"] > 0
        assert row["plan"]["proved"] == row["plan"]["answered"] > 5
        assert f"| {row['plan']['proved']} of 10 |" in report.text(document)
