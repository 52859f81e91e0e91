"""Errors of covers: options that make no sense, and configurations that are in collision."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from planner.cover.ground import free_samples
from planner.cover.look import Look
from planner.cover.options import CoverOptions
from tests.certifier.scenes import planar_arm
from tests.errors.trial import Table, Trial


def options(**given: Any) -> object:
    return CoverOptions.from_document(given)


def looked(**given: Sequence[Any]) -> object:
    """Looks at a scene in which everything collides but what is far to the left."""
    scene = planar_arm()
    return Look(scene, lambda s: scene.to_q(s)[:, 0] > -1.0, CoverOptions(**given))


def nothing_is_free(_: Trial) -> object:
    return free_samples(planar_arm(), lambda s: np.ones(len(s), dtype=bool), 1, np.random.default_rng(0))


def not_a_cover(t: Trial) -> None:
    t.need("scene")
    client = t.need("client")
    job = client.post("/v1/jobs", json={"kind": "grow", "scene": "slider", "seed": {"q": [0.0]}}).json()["id"]
    t.ask("GET", f"/v1/jobs/{job}/cover")


def in_s(t: Trial) -> None:
    path = t.write(path__json='{"s": [[0.0], [0.1]]}')
    t.ciris("cover", "slider", "--path", path)


def from_a_region(t: Trial) -> None:
    url, region = (t.need(name) for name in ("url", "region"))
    t.ciris("plan", "slider", "--from", region, "--to", "0.9", "--regions-only", "--grow", CIRIS_URL=url)


COVERS: Table = {
    ("option_value", "options.connect"): [lambda t: options(connect=[[0.0]])],
    ("nothing_free", "scene"): [nothing_is_free],
    ("seed_in_collision", "options.seeds[0]"): [lambda t: looked(seeds=((0.0, 0.0),))],
    ("path_in_collision", "options.paths[0]"): [lambda t: looked(paths=(((-1.5, 0.0), (0.0, 0.0)),))],
    ("cover_not_found", "job"): [not_a_cover],
    ("unknown_configuration", "--from"): [from_a_region],
    ("option", "--path"): [in_s],
    ("option_value", "--deadline"): [lambda t: t.ciris("cover", "slider", "--deadline", "-1")],
}
