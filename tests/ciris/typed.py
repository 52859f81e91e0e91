"""Code of users, which is never run: mypy reads it strictly, and says what the editor of an engineer would."""

from __future__ import annotations

from typing import assert_type

import numpy as np
from numpy.typing import NDArray

import ciris


def plan() -> None:
    with ciris.connect() as service:
        scene = assert_type(service.add_scene("scene.yaml"), ciris.Scene)
        region = assert_type(service.grow(scene, q=[0.0, 0.1], deadline=60, method="limits", paper={"pushes": 1}), ciris.Region)
        assert_type(region.C, NDArray[np.float64])
        assert_type(region.contains(np.zeros((3, 2))), NDArray[np.bool_])
        assert_type(region.proof(), bytes)
        assert_type(region.verify(), ciris.Verification)
        assert_type(region.guarantee, ciris.Guarantee)
        job = assert_type(service.submit_grow("my-cell", np.zeros(2)), ciris.Job)
        for event in job.follow():
            assert_type(event, ciris.Event)
        assert_type(job.result(), ciris.Region)
        assert_type(service.regions("my-cell"), list[ciris.Region])
        assert_type(service.contains("my-cell", [0.0, 0.1]).inside, NDArray[np.bool_])
        assert_type(service.segments("my-cell", s=np.zeros((4, 2, 2))), ciris.Segments)
        assert_type(service.path("my-cell", np.zeros((3, 2))), ciris.Coverage)
        assert_type(service.graph("my-cell"), ciris.Graph)
        assert_type(service.certify_path("my-cell", np.zeros((3, 2))).proof, bytes | None)
        assert_type(service.certify_path("my-cell", bezier=np.zeros((1, 4, 2))).verify_seconds, float)
        assert_type(service.path("my-cell", knots=np.zeros(8), control_points=np.zeros((4, 2))), ciris.Coverage)
        assert_type(service.plan("my-cell", [0.0, 0.1], "1f9b2a7c").q, NDArray[np.float64])
        assert_type(service.cover("my-cell", connect=np.zeros((2, 2)), deadline=60), ciris.Cover)
        assert_type(service.recertify(region, scene), ciris.Region)
        moving = assert_type(service.submit_certify_path("my-cell", np.zeros((3, 2)), deadline=60), ciris.Job)
        assert_type(moving.motion(prove=True), ciris.Motion)
        for near in service.nearest("my-cell", [0.0, 0.1]):
            if near is not None:
                assert_type(near.q, NDArray[np.float64])
        assert_type(ciris.CirisError("code", "message").field, str | None)
        service.grow("my-cell", q=[0.0, 0.1], method="magic")  # type: ignore[arg-type]
        service.grow("my-cell", q=[0.0, 0.1], paper={"push": 1})  # type: ignore[typeddict-unknown-key]
        service.grow("my-cell", q=[0.0, 0.1], dead_line=60)  # type: ignore[call-arg]


async def wait() -> None:
    async with ciris.connect_async() as service:
        region = assert_type(await service.grow("my-cell", q=[0.0, 0.1], deadline=60), ciris.AsyncRegion)
        assert_type(await region.verify(), ciris.Verification)
        job = assert_type(await service.submit_grow("my-cell", np.zeros(2)), ciris.AsyncJob)
        async for event in job.follow():
            assert_type(event, ciris.Event)
        assert_type(await service.regions(), list[ciris.AsyncRegion])
        assert_type(await service.contains("my-cell", [0.0, 0.1]), ciris.Containment)
