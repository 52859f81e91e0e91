"""Errors of covers: options that make no sense, and configurations that are in collision."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from planner.cover.ground import free_samples
from planner.cover.look import Look
from planner.cover.options import CoverOptions
from tests.certifier.scenes import planar_arm
from tests.errors.rows import Row, Trial, rows

COVER = {"kind": "cover", "scene": "slider"}


def options(**given: Any) -> object:
    return CoverOptions.from_document(given)


def looked(**given: Sequence[Any]) -> object:
    """Looks at a scene in which everything collides but what is far to the left."""
    scene = planar_arm()
    return Look(scene, lambda s: scene.to_q(s)[:, 0] > -1.0, CoverOptions(**given))


def nothing_is_free(_: Trial) -> object:
    return free_samples(planar_arm(), lambda s: np.ones(len(s), dtype=bool), 1, np.random.default_rng(0))


def not_a_cover(t: Trial) -> None:
    t.request.getfixturevalue("scene")
    client = t.request.getfixturevalue("client")
    job = client.post("/v1/jobs", json={"kind": "grow", "scene": "slider", "seed": {"q": [0.0]}}).json()["id"]
    t.ask("GET", f"/v1/jobs/{job}/cover")


def in_s(t: Trial) -> str:
    path = t.write(path__json='{"s": [[0.0], [0.1]]}')
    return t.ciris("cover", "slider", "--path", path)


def from_a_region(t: Trial) -> str:
    url, region = (t.request.getfixturevalue(name) for name in ("url", "region"))
    return t.ciris("plan", "slider", "--from", region, "--to", "0.9", "--grow", CIRIS_URL=url)


def without_grow(t: Trial) -> str:
    return t.ciris("plan", "slider", "--from", "0", "--to", "0", "--deadline", "9")


COVERS: list[Row] = [
    *rows(
        "planner/cover/options.py",
        (
            "option_value",
            "options.connect",
            "at least two configurations can be connected, and one was given",
            "give another one, or give it as a seed",
            lambda t: options(connect=[[0.0]]),
        ),
    ),
    *rows(
        "planner/cover/ground.py",
        (
            "nothing_free",
            "scene",
            "of {...} configurations, {total} were found that are free of collisions",
            "`ciris scene check` says which bodies always touch",
            nothing_is_free,
        ),
    ),
    *rows(
        "planner/cover/look.py",
        (
            "seed_in_collision",
            "options.{name}[{i}]",
            "bodies touch, or are nearer than the padding, at this configuration",
            "`ciris scene check --q` says which",
            lambda t: looked(seeds=((0.0, 0.0),)),
        ),
        (
            "path_in_collision",
            "options.paths[{i}]",
            "bodies touch, or are nearer than the padding, between waypoints {segment} and {...}",
            "`ciris certify-path` says which",
            lambda t: looked(paths=(((-1.5, 0.0), (0.0, 0.0)),)),
        ),
    ),
    *rows("workers/covers.py", ("not_covered", "options", "{...}", "regions that were certified remain", "a cover that cannot go on")),
    *rows(
        "api/routers/jobs.py",
        (
            "cover_not_found",
            "job",
            "the job {id} is no cover, but a {kind} job",
            "its own page and /v1/jobs/{{id}} describe it",
            not_a_cover,
        ),
    ),
    *rows(
        "client/planning.py",
        ("option", "--from", "regions grow between configurations, not regions", "give joint positions", from_a_region),
    ),
    *rows(
        "client/request.py",
        ("option", "--path", "{path} has no waypoints in q; a path to cover is straight in q between them", "give waypoints in q", in_s),
        ("option", "--{argument}", "is an option of --{flag}", "add --{flag}", without_grow),
    ),
]
