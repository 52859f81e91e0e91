"""The polytope step (12) of C-IRIS couples all pairs: the faces move, and the inscribed ellipsoid cannot shrink.

The moved polytope is {C s <= d} within a *trust box* B around the current one. The face multipliers of the proofs are fixed. Free are
the faces (C, d), the margins delta, every plane z_p, and the multipliers of 1 and of the faces of B:

    maximise  sum_j log(delta_j + eps)
    s.t.      A_r z_p - t_p den - sum_j lambda_rj (d_j - c_j's)  in  K_B            for every rational r (certifier.step.identities),
              |E c_j| <= d_j - c_j's_E - delta_j,   |E c_j| <= 1,   delta_j >= 0,   c_j's_k <= d_j for every point s_k to contain.

{E u + s_E} is the inscribed ellipsoid. t_p is a share of the pair's present margin, so that (11) is strictly feasible on what comes out.
|E c_j| <= 1 stands for the paper's |c_j| <= 1, so that margins are measured against the ellipsoid, whatever the units of the joints.

A pair that holds on all of B constrains nothing and is left out. A face that no pair needs is dropped, and B stands in for it. Before
that, (11) is tried against the faces of B for every proof that does not hold there, so that few pairs ask for few faces.

The program is an arrow (conic.arrow). The polytope that it starts from is feasible, so the ellipsoid cannot shrink. Where the proofs
have too little margin, it starts from a slightly smaller polytope. What comes out is a proposal that has to be certified by (11).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from certifier.conic.arrow import Arrow, Term
from certifier.conic.basis import dimension
from certifier.errors import RegionError
from certifier.model import Array, Box, Polytope, Scene
from certifier.outcome import Outcome
from certifier.pair.certification import Certification
from certifier.polytopes.ellipsoid import Ellipsoid, inscribed_ellipsoid
from certifier.polytopes.polytope import bounds, drop_redundant
from certifier.proof.pair import PairProof
from certifier.step.face_terms import face_barrier, objective_term
from certifier.step.identities import IdentityGroups, face_multipliers, holds_on
from certifier.step.stepped import Stepped

TRUST = 1.3
"""The trust box is larger by this factor than the smallest box around the current polytope."""
MARGIN_SHARE = 0.25
START_LENGTH = 0.9
"""The faces have this |E c_j| at the start, which is inside |E c_j| <= 1."""
RETREATS = (1.0, 0.95, 0.85)
"""The step is tried from the polytope at these scales, one after the other.

Targeted contraction ends where some pair has hardly any margin, and from there no proof is strictly feasible.
"""
PUSH = 0.5
"""All faces are first moved out by this share of the way to the first boundary, to have delta > 0."""
WEIGHT = 512.0
"""The objective has this weight against the barriers: large enough to come close to the optimum, small enough to stay off the boundary."""
TOLERANCE = 0.005
"""The objective is minimised to this tolerance per face."""
MOST_TERMS = 4096
"""A rational's polynomial may have this many terms, with all joints of the scene in play.

Above, its Schur complement alone has 128 MiB, and a step takes hours.
"""

Progress = Callable[[str], None]


def trust_box(scene: Scene, polytope: Polytope, ellipsoid: Ellipsoid) -> Box:
    """Returns the smallest box around P, enlarged about the ellipsoid's centre and cut to the joint limits."""
    lower, upper = bounds(polytope)
    center = ellipsoid.center
    return Box.around(
        np.maximum(scene.s_lower, center + TRUST * (lower - center)), np.minimum(scene.s_upper, center + TRUST * (upper - center))
    )


def step(
    scene: Scene,
    polytope: Polytope,
    proofs: dict[int, bytes],
    contain: Array | None = None,
    progress: Progress = lambda _: None,
) -> Stepped:
    """Carries out one polytope step from a certified polytope.

    Args:
        polytope: its last 2n rows are the joint limits.
        proofs: pair index -> proof file; proofs on a polytope that contains this one will do. Those made against the faces of
            :func:`trust_box` (``Certification(..., box=...)``) are used as they are.
        contain: (k, n) points of the polytope that stay inside; None for none.
        progress: called many times with a sentence; an exception that it raises ends the step.

    Raises:
        RegionError: ``point_outside``; ``step_too_large``, which names the pair; or ``step_failed``, after which the current region stands.
    """
    points = np.zeros((0, scene.n)) if contain is None else contain
    if not polytope.contains(points).all():
        raise RegionError("point_outside", "a point to contain must be in the polytope", field="contain")
    before = inscribed_ellipsoid(polytope)
    for scale in RETREATS:
        smaller = polytope if scale == 1.0 else _about(before.center, polytope, scale, fixed=2 * scene.n)
        if not smaller.contains(points).all():
            break
        try:
            found = _step(scene, smaller, proofs, points, progress)
        except np.linalg.LinAlgError:
            continue
        growth = found.info["volume_after"] / before.volume - 1
        if scale < 1.0 and growth <= 0:
            message = f"nothing larger was found from {scale} of the polytope"
            raise RegionError("step_failed", message, field="polytope", hint=_PUSH)
        return replace(found, growth=growth, info=found.info | {"volume_before": before.volume, "from": scale})
    raise RegionError("step_failed", "no proof holds with room to spare on the step's trust box", field="polytope", hint=_PUSH)


_PUSH = "push the faces out instead of stepping (pushes)"


def _about(center: Array, polytope: Polytope, scale: float, fixed: int) -> Polytope:
    """Returns the polytope scaled about a point, in all but its last ``fixed`` rows."""
    height = polytope.C @ center
    d = height + scale * (polytope.d - height)
    d[-fixed:] = polytope.d[-fixed:]
    return Polytope(polytope.C, d)


def _step(
    scene: Scene,
    polytope: Polytope,
    proofs: dict[int, bytes],
    points: Array,
    progress: Progress,
) -> Stepped:
    """Carries out the step from a polytope on which the proofs are strictly feasible; the result's growth is from there.

    Raises:
        np.linalg.LinAlgError: the proofs are not strictly feasible.
    """
    n = scene.n
    before = inscribed_ellipsoid(polytope)
    box = trust_box(scene, polytope, before)
    kept = drop_redundant(polytope, fixed=2 * n)[: -2 * n]
    current = _within(box, polytope.C[kept], polytope.d[kept])
    needed = _coupled(scene, polytope, before.center, current, proofs, box, progress)
    used = np.flatnonzero(sum(Y.sum(axis=0) for _, Y in needed) > 0) if needed else np.zeros(0, dtype=int)
    base = scene.polytope(*_rows(scene, box, current.C[used], current.d[used]))
    start = inscribed_ellipsoid(base)
    faces = _Faces(current.C[used], current.d[used], start)
    groups = IdentityGroups(scene, box, start, faces.scale, MARGIN_SHARE)
    info: dict[str, Any] = {"faces": len(used), "coupled_pairs": len(needed), "trust": TRUST}
    C, d = faces.rows(faces.start)
    base = scene.polytope(*_rows(scene, box, C, d))
    if needed:
        method = Arrow(
            [groups.group(proof, Y[:, used]) for proof, Y in needed],
            faces.start,
            lambda iteration: progress(f"polytope step: iteration {iteration}"),
        )
        method.shift(PUSH * min(1.0, method.reach(faces.push)) * faces.push)
        reach = float(np.linalg.norm(np.abs(box.mid - start.center) + box.half) / np.linalg.eigvalsh(start.shape)[0])
        barrier = face_barrier(n, 2 * max(reach, float(faces.start.max())), np.linalg.solve(start.shape, (points - start.center).T).T)
        method.minimise(_weighted(objective_term(n), barrier), TOLERANCE * WEIGHT * len(used))
        C, d = faces.rows(method.y)
        info |= {"iterations": method.iterations, "rationals": sum(len(p) for group in method.groups for p in group.blocks)}
    moved = scene.polytope(*_rows(scene, box, C, d))
    after = inscribed_ellipsoid(moved)
    info["volume_after"] = after.volume
    moved, base = (Polytope(np.ascontiguousarray(rows.C), rows.d) for rows in (moved, base))
    return Stepped(moved, after.center, base, after.volume / before.volume - 1, info)


def _coupled(
    scene: Scene, polytope: Polytope, center: Array, current: Polytope, proofs: dict[int, bytes], box: Box, progress: Progress
) -> list[tuple[PairProof, Array]]:
    """Returns the proofs that do not hold on all of the box, with the faces they need; (11) is tried with the faces of the box first."""
    trusted: Certification | None = None
    needed: dict[bytes, tuple[PairProof, Array]] = {}
    affordable = {index: _terms(scene, PairProof.from_bytes(data, scene)) <= MOST_TERMS for index, data in proofs.items()}
    # Proofs that may have to be refused come first. The others keep their order, on which the last digits of the step's sums depend.
    for count, index in enumerate(sorted(proofs, key=affordable.__getitem__)):
        data = proofs[index]
        proof = PairProof.from_bytes(data, scene)
        m = len(proof.ground.d)
        if not (holds_on(proof, box, proof.faces) or holds_on(proof, box, range(m, m + 2 * scene.n))):
            trusted = trusted or Certification(scene, polytope, center, box=box)
            pair = scene.pairs[index]
            progress(f"polytope step: {count + 1}/{len(proofs)} {pair.a} - {pair.b} on the trust box")
            result = trusted.certify(index)
            if result.outcome is Outcome.CERTIFIED and result.proof:
                data = result.proof
                proof = PairProof.from_bytes(data, scene)
        # A proof may stand for many pairs.
        if data not in needed:
            Y = face_multipliers(proof, current, box)
            if Y.any():
                _check_size(scene, index, proof)
                needed[data] = proof, Y
    return list(needed.values())


def _terms(scene: Scene, proof: PairProof) -> int:
    """Returns the number of terms of the larger side's polynomials, with all joints of the scene in play."""
    return max(dimension(k, k, scene.n - k) for k in (len(side.chain) for side in proof.sides))


def _check_size(scene: Scene, index: int, proof: PairProof) -> None:
    terms = _terms(scene, proof)
    if terms > MOST_TERMS:
        pair, most = scene.pairs[index], f"more than {MOST_TERMS}"
        problem = f"with all {scene.n} joints in play the polynomials of {pair.a} and {pair.b} have {terms} terms, {most}"
        raise RegionError("step_too_large", problem, field="options.paper.max_rounds", hint=_PUSH)


def _within(box: Box, C: Array, d: Array) -> Polytope:
    """Returns the faces, then those of the box."""
    eye = np.eye(len(box.mid))
    return Polytope(np.concatenate([C, eye, -eye]), np.concatenate([d, box.upper, -box.lower]))


def _rows(scene: Scene, box: Box, C: Array, d: Array) -> tuple[Array, Array]:
    """Returns the faces, then those of the box that say more than the joint limits."""
    inside = np.concatenate([box.upper < scene.s_upper, box.lower > scene.s_lower])
    rows = _within(box, C, d)
    keep = np.concatenate([np.ones(len(d), dtype=bool), inside])
    return rows.C[keep], rows.d[keep]


def _weighted(objective: Term, barrier: Term) -> Term:
    def term(y: Array) -> tuple[float, Array, Array]:
        value, gradient, hessian = objective(y)
        wall, slope, curvature = barrier(y)
        return WEIGHT * value + wall, WEIGHT * gradient + slope, WEIGHT * hessian + curvature

    return term


class _Faces:
    """Holds the faces as unknowns (c_j, d_j, delta_j), one after the other, in coordinates in which the ellipsoid is the unit ball.

    Attributes:
        scale: (m,) what the rows are multiplied by, for |E c_j| = START_LENGTH.
        start: (m (n + 2),) the given faces, with delta = 0.
        push: (m (n + 2),) the direction in which all faces move out.
    """

    def __init__(self, C: Array, d: Array, ellipsoid: Ellipsoid) -> None:
        self._ellipsoid = ellipsoid
        self._n = C.shape[1]
        normals, offsets = C @ ellipsoid.shape, d - C @ ellipsoid.center
        self.scale = START_LENGTH / np.linalg.norm(normals, axis=1)
        self.start = np.column_stack([normals * self.scale[:, None], offsets * self.scale, np.zeros(len(d))]).ravel()
        self.push = np.tile(np.append(np.zeros(self._n), [1.0, 0.5]), len(d))

    def rows(self, y: Array) -> tuple[Array, Array]:
        """Returns C and d of the unknowns."""
        v = y.reshape(-1, self._n + 2)
        C = np.linalg.solve(self._ellipsoid.shape, v[:, : self._n].T).T
        return C, v[:, self._n] + C @ self._ellipsoid.center
