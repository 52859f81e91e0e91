"""Errors of slices through configuration space."""

from __future__ import annotations

from typing import Any

from db import scenes
from tests.certifier.scenes import planar_arm
from tests.errors.trial import Table, Trial


def sliced(t: Trial, **parts: Any) -> None:
    client = t.request.getfixturevalue("client")
    with client.app.state.database.write() as session:
        scenes.add(session, planar_arm(limit=1.2))
    t.ask("POST", "/v1/planning/slice", json={"scene": "planar", "q": [0.0, 0.0], "x": "arm/joint1", "y": "arm/joint2"} | parts)


DRAWING: Table = {
    ("same_joint", "y"): [lambda t: sliced(t, y="arm/joint1")],
    ("unknown_joint", "x"): [lambda t: sliced(t, x="arm/joint9")],
    ("slice_outside_limits", "x_range"): [lambda t: sliced(t, x_range=[2.0, 3.0])],
    ("region_elsewhere", "regions[0]"): [lambda t: sliced(t, regions=["none"])],
}
