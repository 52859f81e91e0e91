"""Every robot of the benchmark is a scene, and one of them goes all the way to a verified region."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks import models, report, robots
from certifier.errors import CirisError
from certifier.scene.draft import draft


@pytest.mark.parametrize(
    ("name", "joints", "pairs"),
    [
        ("ur10", 6, 27),
        ("continuous", 7, 35),
        ("gripper", 7, 62),
        ("grasp", 6, 35),
        ("spheres", 7, 1154),
        pytest.param("shells", 7, 35, marks=pytest.mark.slow),  # its hollow meshes are measured for half a minute
    ],
)
def test_a_robot_is_drafted_with_a_free_seed(name: str, joints: int, pairs: int, tmp_path: Path) -> None:
    model = models.write(name, tmp_path)
    drafted = draft(model.robot, [model.world], tmp_path / "scene.yaml", {}, {})
    assert (drafted.scene.n, len(drafted.scene.pairs), drafted.ignored, drafted.overlapping) == (joints, pairs, (), ())
    assert drafted.seed is not None


@pytest.mark.slow
def test_a_row_says_how_long_each_command_took(monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot of one joint, so that it is quick."""
    monkeypatch.setattr(models, "ROBOTS", {"small": lambda _: SMALL, "broken": lambda _: "<link/>"})
    document = robots.robots(["small", "broken"], 20.0, lambda _: None)
    row, broken = document["rows"]
    assert row["ended"] == "verified"
    assert list(row["seconds"]) == ["scene init", "scene check", "grow", "verify"]
    assert 0.5 < row["share"] <= 1
    assert list(broken["seconds"]) == ["scene init"]
    assert "name" in broken["ended"]
    assert f"{row['share']:.2f}" in report.text(document)
    with pytest.raises(CirisError, match="there is no robot 'r2d2'"):
        robots.robots(["small", "r2d2"], 20.0, lambda _: None)


SMALL = """<link name="base"/>
<joint name="turn" type="continuous"><parent link="base"/><child link="hand"/><origin xyz="0 0 0.3"/><axis xyz="0 0 1"/></joint>
<link name="hand"><collision><origin xyz="0.4 0 0"/><geometry><box size="0.6 0.1 0.1"/></geometry></collision></link>"""
