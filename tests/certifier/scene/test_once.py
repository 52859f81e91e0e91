"""What takes long for a mesh is computed once, and for what differs in anything it is computed again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from certifier.scene import once as remembering
from certifier.scene.hull import outer
from certifier.scene.once import once
from certifier.scene.parse import parse
from tests.certifier.scene.workshop import write

POINTS = np.arange(12.0).reshape(4, 3)


def test_equal_arrays_are_computed_once_and_others_again(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    @once
    def total(points: np.ndarray, most: int) -> float:
        asked.append(most)
        return float(points.sum())

    assert [total(POINTS, 1), total(POINTS.copy(), 1), total(np.asfortranarray(POINTS), 1)] == [66.0] * 3
    assert asked == [1]
    total(POINTS, 2)
    total(POINTS.reshape(3, 4), 1)
    total(POINTS.astype(np.float32), 1)
    total(POINTS + 1, 1)
    assert asked == [1, 2, 1, 1, 1]
    monkeypatch.setattr(remembering, "KEPT", 1)
    total(POINTS + 2, 1)
    total(POINTS, 1)
    assert asked[5:] == [1, 1], "the oldest one goes first"


def test_a_scene_that_is_read_again_is_the_same(tmp_path: Path) -> None:
    scene = write(
        tmp_path,
        shape='<mesh filename="m.obj"/>',
        files={"m.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"},
    )
    first = parse({"path": str(scene)})
    assert parse({"path": str(scene)})["geometries"] == first["geometries"]
    vertices, inflation, count = outer(POINTS, 8)
    again = outer(POINTS.copy(), 8)
    assert again[0] is vertices
    assert again[1:] == (inflation, count)
