"""Proposals to certify are made here: each is a polytope in s around a seed, or a given one. Nothing here is a proof."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from certifier import stored
from certifier.conditioned import tightened
from certifier.errors import RegionError
from certifier.isolation.telling import tell
from certifier.model import Array, Polytope, Scene
from certifier.outcome import Guarantee
from certifier.pair.collisions import in_collision
from certifier.polytopes.polytope import chebyshev_center
from certifier.seeding.arm import AT, NEAR, arm
from certifier.seeding.free import Nearest, check_free
from certifier.seeding.hindrance import hindrance
from certifier.seeding.limits import check_limits, off_limits
from certifier.seeding.lines import check_lines
from certifier.seeding.options import Method, SeedOptions
from certifier.seeding.proposal import Proposal, mend
from certifier.seeding.tries import best_of_tries
from certifier.words import counted


def check_seed(scene: Scene, q: ArrayLike, field: str = "seed.q") -> Nearest:
    """Refuses joint positions around which no region can be certified, and returns the pair that is nearest at others.

    Raises:
        RegionError: ``seed_wrong_length``, ``seed_in_collision``, or as
            :func:`certifier.seeding.limits.check_limits`; the error names the joint or the pair.
    """
    q = np.asarray(q, dtype=float)
    if q.shape != (scene.n,):
        message = f"it has {counted(q.size, 'number')}, the scene {counted(scene.n, 'joint')}"
        raise RegionError("seed_wrong_length", message, field=field, hint=scene.in_order)
    check_limits(scene, q, field)
    return check_free(scene, q, field)


def propose(scene: Scene, options: SeedOptions) -> Proposal:
    """Returns a polytope around the seed, by the options' method; it is deterministic for ``random_seed``, 0 if not given.

    What is on a joint limit is moved inside by a hair (:func:`certifier.seeding.limits.off_limits`).

    IRIS may take minutes, and it runs native code, so call it in a process that may die.

    Raises:
        RegionError: as :func:`check_seed`, :func:`certifier.seeding.lines.check_lines` and ``polytope.chebyshev_center``;
            ``polytope_shape``; ``center_outside``; ``seed_hindered``; ``seed_cut_off`` when the polytope does not contain the seed and
            ``contain``; ``seeding_failed``.
    """
    start = time.perf_counter()
    method = options.method or Method.IRIS
    checked = [check_seed(scene, q, f"seed.contain[{i}]") for i, q in enumerate(options.contain)]
    contain = scene.to_s(off_limits(scene, options.contain)) if options.contain else np.zeros((0, scene.n))
    if method is Method.POLYTOPE:
        checked += check_lines(scene, contain, checked)
        C, d, center = _given(scene, options)
        said: dict[str, Any] = {}
    else:
        assert options.q is not None, "every method but polytope has a seed"
        checked.insert(0, check_seed(scene, options.q))
        center = scene.to_s(off_limits(scene, options.q))
        points = np.concatenate([center[None], contain])
        checked += check_lines(scene, points, checked)
        tell(hindrance=hindrance(scene, checked))  # in case it takes longer than there is time
        if method is Method.LIMITS:
            C, d = np.zeros((0, scene.n)), np.zeros(0)
            said = {}
        elif method is Method.BOX:
            assert options.half_width is not None, "a box has a width"
            C, d = _box(scene, points, options.half_width)
            said = {}
        else:
            try:
                C, d, said = best_of_tries(_to_propose(scene, points), points, replace(options, method=method))
            except RegionError:
                _refuse_hindered(scene, checked)
                raise
            if not (d[:, None] > C @ points.T).all():
                _refuse_hindered(scene, checked)
    if not (d[:, None] > C @ np.concatenate([center[None], contain]).T).all():
        kept = "the seed and all of contain" if options.contain else "the seed"
        if method is Method.POLYTOPE:
            raise RegionError("seed_cut_off", f"the given polytope does not contain {kept}", field="seed", hint="give one that does")
        hint = "leave the method out, or give configurations that see one another"
        raise RegionError("seed_cut_off", f"the method {method} found no region that contains {kept}", field="seed", hint=hint)
    guarantee = said.pop("guarantee", Guarantee.NONE)
    info = {"method": method.value, "guarantee": guarantee.value, "faces": len(d), "seconds": time.perf_counter() - start, **said}
    if known := hindrance(scene, checked):
        info["hindrance"] = known
    return Proposal(C, d, center, contain, info)


def _to_propose(scene: Scene, points: Array) -> Scene:
    """Returns the scene with tightened conditions, where points in s, (k, n), keep these."""
    tight = tightened(scene)
    return scene if tight is scene or in_collision(tight, points).any() else tight


def _refuse_hindered(scene: Scene, checked: list[Nearest]) -> None:
    """Refuses a seed of which no proposal came, if it is known what hinders one.

    Raises:
        RegionError: ``seed_hindered``.
    """
    if known := hindrance(scene, checked):
        raise RegionError("seed_hindered", known, field="seed", hint=mend(known))


def warm_up() -> None:
    """Loads the compiled functions that a proposal needs, and Drake's libraries, by making one for a small arm."""
    propose(arm(), SeedOptions(q=AT, contain=(NEAR,), delta=0.5))


def propose_in_child(payload: dict[str, Any]) -> dict[str, Any]:
    """Runs :func:`propose` in a child process: takes documents and returns the document of the proposal."""
    found = propose(Scene.from_document(payload["scene"]), SeedOptions.from_document(payload["seed"]))
    return dict(stored.document(found))


def _given(scene: Scene, options: SeedOptions) -> tuple[Array, Array, Array]:
    given = Polytope.given(options.C, options.d, scene.n, field="seed.C")
    limited = scene.polytope(given.C, given.d)
    middle, _ = chebyshev_center(limited, tuple(joint.name for joint in scene.moving))
    if options.center is None:
        return given.C, given.d, middle
    center = np.array(options.center)
    if center.shape != (scene.n,) or not np.all(limited.C @ center < limited.d):
        raise RegionError(
            "center_outside",
            "the centre does not lie strictly inside the polytope and the joint limits",
            field="seed.center",
            hint="leave it out to have one found",
        )
    return given.C, given.d, center


def _box(scene: Scene, points: Array, half_width: float) -> tuple[Array, Array]:
    eye, upper, lower = np.eye(scene.n), points.max(axis=0) + half_width, points.min(axis=0) - half_width
    above, below = upper < scene.s_upper, lower > scene.s_lower
    return np.concatenate([eye[above], -eye[below]]), np.concatenate([upper[above], -lower[below]])
