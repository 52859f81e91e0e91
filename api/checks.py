"""These checks compare the numbers of a request with its scene. They are cheap and need no Drake; the job makes the other checks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from api.schemas.covers import CoverRequestOptions
from api.schemas.jobs import PolytopeBody, Seed, WebhookRequest
from api.schemas.motions import GivenMotion
from certifier.carry.robot import same_bodies
from certifier.errors import CirisError, RegionError
from certifier.model import Array, Polytope, Scene
from certifier.motion.given import motion_of, padding_of
from certifier.positions import check_magnitude
from certifier.proof.motion import Space
from certifier.seeding.limits import check_limits
from certifier.seeding.options import SeedOptions
from db.settings import settings
from planner.cover.options import MOST_JOINTS, STAGES, CoverOptions
from planner.membership import to_s
from workers.addresses import is_public


def seed(scene: Scene, body: Seed) -> SeedOptions:
    """Returns the options of a seeding.

    It refuses options that contradict each other, a configuration of the wrong length, and one outside the joint limits.

    Raises:
        RegionError: seed_wrong_length, seed_outside_limits, seed_outside_window, polytope_shape, number_too_large, or as
            SeedOptions.from_document; the field names the place.
    """
    options = SeedOptions.from_document(body.model_dump(exclude_none=True))
    for i, row in enumerate(options.C or ()):
        _length(scene, row, f"seed.C[{i}]", "polytope_shape")
    if options.q is not None:
        _length(scene, options.q, "seed.q", "seed_wrong_length")
        check_limits(scene, options.q, "seed.q")
    return options


def cover(scene: Scene, body: CoverRequestOptions) -> CoverOptions:
    """Returns the options of a cover. It refuses configurations of the wrong length, or outside the joint limits.

    Raises:
        RegionError: seed_wrong_length, number_too_large, seed_outside_limits, seed_outside_window, or as CoverOptions.from_document; the
            field says where.
    """
    given = {f"options.{name}[{i}]": q for name in ("seeds", "connect") for i, q in enumerate(getattr(body, name))}
    given |= {f"options.paths[{i}][{j}]": q for i, path in enumerate(body.paths) for j, q in enumerate(path)}
    for field, q in given.items():
        _length(scene, q, field, "seed_wrong_length")
        check_limits(scene, q, field)
    options = CoverOptions.from_document(body.model_dump())
    return options if options.stages is not None or scene.n <= MOST_JOINTS else replace(options, stages=STAGES)


def polytope(scene: Scene, body: PolytopeBody) -> None:
    """Refuses a polytope whose shapes do not fit the scene or each other, or whose centre is outside of it.

    Raises:
        RegionError: polytope_shape, polytope_not_finite, number_too_large, center_outside.
    """
    for i, row in enumerate(body.C):
        _length(scene, row, f"polytope.C[{i}]", "polytope_shape")
    if len(body.C) != len(body.d):
        raise RegionError(
            "polytope_shape", f"C has {len(body.C)} rows and d has {len(body.d)} numbers", field="polytope.d", hint="give one number a row"
        )
    Polytope.given(body.C, body.d, scene.n)
    if body.center is not None:
        _configuration(scene, body.center, "polytope.center", "polytope_shape")
        if not scene.polytope(body.C, body.d).contains(body.center):
            raise RegionError(
                "center_outside",
                "the centre is not inside the polytope and the joint limits",
                field="polytope.center",
                hint="leave it out to have one found",
            )


def motion(scene: Scene, body: GivenMotion) -> dict[str, Any]:
    """Returns the motion of a request as certifier.motion.given.motion_of takes it, with ``space`` where it was given, ``tube``,
    ``padding`` and ``clearance``.

    Raises:
        RegionError: as motion_of; the field names the place.
    """
    padding_of(body.padding)
    document = body.model_dump(mode="json", include=set(GivenMotion.model_fields), exclude_none=True)
    motion_of(scene, document, Space(body.space) if body.space else None)
    return document


def same_robot(old: Scene, new: Scene) -> None:
    """Refuses to take a region over into a scene whose joints are other ones.

    Raises:
        SceneError: other_robot.
    """
    same_bodies(old, new)


def kept(scene: Scene, manifest: dict[str, Any]) -> list[list[float]]:
    """Returns the joint positions that stay inside of a region that is certified again: its seed, and what it had to contain."""
    asked = manifest["provenance"].get("options", {})
    if asked.get("kind") == "recertify":
        return [list(map(float, q)) for q in asked["seed"]["q"]]
    seed = manifest["seed"] or scene.to_q(manifest["interior_point"]).tolist()
    return [seed, *(asked.get("seed", {}).get("contain") or [])]


def webhook(body: WebhookRequest) -> None:
    """Refuses a webhook whose receiver the service could never call.

    Raises:
        CirisError: webhook_url, webhook_address.
    """
    try:
        url = urlsplit(body.url)
        usable = url.hostname and url.username is None and url.port != 0
    except ValueError:
        usable = False
    if not usable or not body.url.isascii() or not body.url.isprintable() or " " in body.url:
        raise CirisError(
            "webhook_url", f"{body.url!r} cannot be called", field="webhook.url", hint="write https://host/path, without credentials"
        )
    try:
        private = not is_public(url.hostname or "")
    except ValueError:
        return  # the host is a name: the worker that calls it resolves it
    if private and not settings().webhook_private:
        hint = "CIRIS_WEBHOOK_PRIVATE=1 allows it"
        raise CirisError("webhook_address", f"{url.hostname} is not a public address", field="webhook.url", hint=hint)


def points(scene: Scene, rows: Sequence[Sequence[float]], field: str) -> Array:
    """Returns the points of a request as an array (k, n).

    Raises:
        RegionError: wrong_length, number_too_large.
    """
    for i, row in enumerate(rows):
        _length(scene, row, f"{field}[{i}]", "wrong_length")
    found = np.array(rows, dtype=float)
    check_magnitude(found, field)
    return found


def point(scene: Scene, row: Sequence[float], field: str) -> Array:
    """Returns a configuration of a request as an array (n,).

    Raises:
        RegionError: wrong_length, number_too_large.
    """
    _configuration(scene, row, field, "wrong_length")
    return np.array(row, dtype=float)


def of_each_joint(scene: Scene, value: float | Sequence[float], field: str) -> Array:
    """Returns a number for each joint, (n,): the one that was given for all of them, or those that were given.

    Raises:
        RegionError: wrong_length.
    """
    return np.full(scene.n, float(value)) if isinstance(value, int | float) else point(scene, value, field)


def in_s(scene: Scene, q: Array, field: str) -> Array:
    """Returns waypoints q, (k, n), in s.

    Raises:
        RegionError: waypoint_outside_limits.
    """
    s = to_s(scene, q)
    for i in np.flatnonzero(~np.isfinite(s).all(axis=1)).tolist():
        message = "a joint of this waypoint is outside of its limits, or of the window that the scene covers, and has no s"
        raise RegionError("waypoint_outside_limits", message, field=f"{field}[{i}]", hint="`ciris scene show` lists the limits")
    return s


def _configuration(scene: Scene, values: Sequence[float], field: str, code: str) -> None:
    _length(scene, values, field, code)
    check_magnitude(values, field)


def _length(scene: Scene, values: Sequence[float], field: str, code: str) -> None:
    if len(values) != scene.n:
        names = ", ".join(joint.name for joint in scene.moving)
        message = f"{len(values)} numbers were given; {scene.name} has {scene.n} joints"
        raise RegionError(code, message, field=field, hint=f"in the order {names}")
