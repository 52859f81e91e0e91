"""examples/planner_gcs.py: Drake plans through regions of a real service, which covers the plan, or there is none."""

from __future__ import annotations

import os
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import ciris
from db.session import Database
from tests.api.conftest import store_region
from tests.api.test_planning import a_part

EXAMPLE = Path(__file__).parents[2] / "examples" / "planner_gcs.py"


def test_a_plan_goes_through_regions_that_overlap_and_through_no_gap(url: str, region: str, database: Database) -> None:
    """The regions are from -0.3 to 0.2, from 0.1 to 0.4 and from 0.6 to 0.9."""
    drive = runpy.run_path(str(EXAMPLE))["drive"]
    store_region(database, a_part(0.1, 0.4))
    store_region(database, a_part(0.6, 0.9))
    with ciris.connect(url) as service:
        waypoints = drive(service, "slider", [-0.2], [0.35], patience=0)
        assert waypoints[[0, -1], 0] == pytest.approx([-0.2, 0.35])
        assert len({piece.region for piece in service.path("slider", waypoints).pieces}) == 2
        assert np.all(np.diff(waypoints[:, 0]) > 0)
        for goal in (0.5, 0.8):
            assert drive(service, "slider", [-0.2], [goal], patience=0) is None


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere", "--start", "-0.1", "--goal", "0.1"], "error: scene: there is no scene 'nowhere'"),
        (["slider", "--start", "x", "--goal", "0.1"], "invalid float value: 'x'"),
        (["slider", "--start", "-0.1", "0.2", "--goal", "0.1"], "the last number must be 1"),
        (["slider", "--start", "-0.1", "--goal", "3"], "error: goal: model/slide is at 3, not between its limits"),
        (["slider", "--start", "nan", "--goal", "0.1"], "error: start: these are not finite numbers"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(url: str, region: str, arguments: list[str], words: str) -> None:
    done = subprocess.run(
        [sys.executable, EXAMPLE, *arguments], env=os.environ | {"CIRIS_URL": url}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert words in done.stderr
    assert "Traceback" not in done.stderr
