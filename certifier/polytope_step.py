"""The polytope step (12) of C-IRIS: all pairs coupled, the faces move, the inscribed ellipsoid cannot shrink.

The face multipliers lambda_rj of every rational r are fixed to those of the proofs; free are the faces (C, d), delta, every
plane z_p, every lambda_r0 and the multipliers of the fixed joint limits. With {E u + s_E} the ellipsoid inscribed in the current
polytope,

    maximise  prod_j (delta_j + eps)
    s.t.      A_r z_p - t_p den - sum_j lambda_rj (d_j - c_j's) = lambda_r0 + sum_k lambda_rk l_k     for every rational r,
              |E c_j| <= d_j - c_j's_E - delta_j,   |c_j| <= 1,

where t_p is a share of the pair's present margin, so that (11) is strictly feasible on the new polytope. The current polytope
is feasible with delta >= 0. What comes out is a proposal: it has to be certified by (11) before it is a region.
The program is handed to Clarabel as it stands, so its size is limited.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.solvers import ClarabelSolver, MathematicalProgram

from certifier.basis import Basis, basis, rho, subsets
from certifier.errors import RegionError
from certifier.kinematics import Kinematics
from certifier.model import Array, Polytope, Scene
from certifier.polytope import drop_redundant, inscribed_ellipsoid
from certifier.proof import PairProof, Side

MARGIN_SHARE = 0.25
EPSILON = 1e-3
MAX_ROWS = 30_000


@dataclass(frozen=True)
class Step:
    """The moved polytope and where it came from; both have the same rows, joint limits last.

    Attributes:
        C, d, center: the new rows and the centre of the ellipsoid, which stays inside.
        base_C, base_d: the current polytope without its redundant rows.
        growth: relative growth of the inscribed ellipsoid's volume.
    """

    C: Array
    d: Array
    center: Array
    base_C: Array
    base_d: Array
    growth: float
    info: dict[str, Any]


def step(scene: Scene, polytope: Polytope, proofs: dict[int, bytes]) -> Step:
    """One polytope step from a certified polytope.

    Args:
        polytope: joint limits as the last 2n rows.
        proofs: pair index -> proof file; proofs on a polytope that contains this one will do.

    Raises:
        RegionError: ``step_too_large`` or ``step_failed``; the current region stands.
    """
    n = scene.n
    kept = drop_redundant(polytope, fixed=2 * n)
    faces = Polytope(polytope.C[kept[: -2 * n]], polytope.d[kept[: -2 * n]])
    ellipsoid = inscribed_ellipsoid(polytope)
    pairs = [PairProof.from_bytes(data, scene) for data in dict.fromkeys(proofs.values())]
    rows = sum(len(side.mantissa) * _rows(side, n) for proof in pairs for side in proof.sides)
    if rows > MAX_ROWS:
        raise RegionError("step_too_large", f"the polytope step would have {rows} equations, more than {MAX_ROWS}")
    program = MathematicalProgram()
    C = program.NewContinuousVariables(*faces.C.shape, "C")
    d = program.NewContinuousVariables(len(faces.d), "d")
    delta = program.NewContinuousVariables(len(faces.d), "delta")
    identities = _Identities(scene, program, faces, C, d)
    for proof in pairs:
        identities.add(proof)
    for c, offset, slack in zip(C, d, delta, strict=True):
        _cone(program, offset - c @ ellipsoid.center - slack, ellipsoid.shape @ c)
        _cone(program, 1.0, c)
    program.AddBoundingBoxConstraint(0, np.inf, delta)
    program.AddMaximizeGeometricMeanCost(np.eye(len(delta), order="F"), np.full(len(delta), EPSILON), delta)
    result = ClarabelSolver().Solve(program)
    status = result.get_solver_details().status
    if not result.is_success():
        raise RegionError("step_failed", f"the solver of the polytope step ended with {status}")
    moved = scene.polytope(result.GetSolution(C), result.GetSolution(d))
    after = inscribed_ellipsoid(moved)
    base = scene.polytope(faces.C, faces.d)
    info = {"rows": rows, "status": str(status), "volume_before": ellipsoid.volume, "volume_after": after.volume}
    return Step(moved.C, moved.d, after.center, base.C, base.d, after.volume / ellipsoid.volume - 1, info)


def _rows(side: Side, n: int) -> int:
    k = len(side.chain)
    return len(basis(k).points) + (n - k) * 3**k


def _cone(program: MathematicalProgram, bound: Any, vector: Any) -> None:
    """|vector| <= bound."""
    program.AddLorentzConeConstraint(np.concatenate([[bound], vector]))


class _Identities:
    """The polynomial identities, in the coordinates of certifier.basis on each proof's own box."""

    def __init__(self, scene: Scene, program: MathematicalProgram, faces: Polytope, C: Any, d: Any) -> None:
        self.scene, self.program, self.faces, self.C, self.d = scene, program, faces, C, d
        self.kinematics = Kinematics(scene)
        self.index = {c.tobytes(): j for j, c in enumerate(faces.C)}

    def add(self, proof: PairProof) -> None:
        """Both sides of one pair, with a plane of its own."""
        n, program = self.scene.n, self.program
        plane = program.NewContinuousVariables(4, n + 1, "plane")
        radii = [volume.radius + self.scene.padding for volume in proof.volumes]
        kappa = program.NewContinuousVariables(1, "kappa")[0]
        if max(radii) > 0:
            self._bound_normal(plane, kappa)
        for volume, radius, side, sign in zip(proof.volumes, radii, proof.sides, (1.0, -1.0), strict=True):
            space, chain = basis(len(side.chain)), list(side.chain)
            u = np.zeros((len(space.points), n))
            u[:, chain] = space.points
            X = self.kinematics.numerators(proof.frame, volume.body, proof.ground.mid + proof.ground.half * u)
            squares = _face_multipliers(proof, side, space)
            for v, vertex in enumerate(volume.vertices):
                p = sign * (X @ np.append(vertex, 1.0))
                constant = -MARGIN_SHARE * proof.t * X[:, 3, 3]
                self._identity(proof, space, chain, u, plane, p, kappa, -radius * X[:, 3, 3], constant, squares[v])

    def _identity(
        self,
        proof: PairProof,
        space: Basis,
        chain: list[int],
        u: Array,
        plane: Any,
        p: Array,
        kappa: Any,
        rounding: Array,
        offset: Array,
        squares: Array,
    ) -> None:
        """plane'p (x) [1; u] + kappa rounding + offset - sum_j squares_j g_j - sum_k l_k rho'Q_k rho = rho'Q_0 rho."""
        n, ground = self.scene.n, proof.ground
        points, grid, outside = len(u), space.grid, [i for i in range(n) if i not in chain]
        N = points + len(outside) * grid

        def affine(weight: Array, constant: float, slopes: Array) -> Array:
            """Coordinates (N,) of weight(u_A) (constant + slopes'u), for weight at the points."""
            first = weight * (constant + u @ slopes)
            return np.concatenate([first, *(slopes[i] * weight[:grid] for i in outside)])

        columns, variables = [], []
        unit = np.eye(n)
        for component in range(4):
            for e in range(n + 1):
                columns.append(affine(p[:, component], 1.0 if e == 0 else 0.0, unit[e - 1] if e else np.zeros(n)))
                variables.append(plane[component, e])
        if rounding.any():
            columns.append(affine(rounding, 1.0, np.zeros(n)))
            variables.append(kappa)
        right = -affine(offset, 1.0, np.zeros(n))
        for c, square in zip(ground.C, squares, strict=True):
            j = self.index.get(c.tobytes())
            if j is None:
                continue
            columns.append(affine(-square, 1.0, np.zeros(n)))
            variables.append(self.d[j])
            for i in range(n):
                columns.append(affine(square, ground.mid[i], ground.half[i] * unit[i]))
                variables.append(self.C[j, i])
        limits = self.scene.polytope(np.zeros((0, n)), np.zeros(0))
        products = space.rho[:, :, None] * space.rho[:, None, :]
        fixed = [(1.0, np.zeros(n))] + [(d - c @ ground.mid, -c * ground.half) for c, d in zip(limits.C, limits.d, strict=True)]
        lower = np.tril_indices(space.rho.shape[1])
        for constants, slopes in fixed:
            scale = max(abs(constants) + np.abs(slopes).sum(), 1e-12)
            Q = self._psd(space.rho.shape[1])
            for row, k in zip(*lower, strict=True):
                weight = products[:, row, k] * (1 if row == k else 2)
                columns.append(affine(-weight, constants / scale, slopes / scale))
                variables.append(Q[row, k])
        matrix = np.stack(columns, axis=1)
        assert matrix.shape[0] == N
        self.program.AddLinearEqualityConstraint(matrix, right, np.array(variables))

    def _psd(self, size: int) -> Any:
        if size == 1:
            Q = self.program.NewContinuousVariables(1, 1, "Q")
            self.program.AddBoundingBoxConstraint(0, np.inf, Q)
            return Q
        Q = self.program.NewSymmetricContinuousVariables(size, "Q")
        self.program.AddPositiveSemidefiniteConstraint(Q)
        return Q

    def _bound_normal(self, plane: Any, kappa: Any) -> None:
        """|a| <= kappa at the corners of the box, |a| being convex."""
        n = self.scene.n
        for signs in np.array(np.meshgrid(*[[-1.0, 1.0]] * n)).reshape(n, -1).T:
            _cone(self.program, kappa, plane[:3, 0] + plane[:3, 1:] @ signs)


def _face_multipliers(proof: PairProof, side: Side, space: Basis) -> Array:
    """Values of lambda_j at the points for every face of the ground, (V, m, N_A).

    A multiplier of a face of the box counts for the faces that imply it, half_i (1 -+ u_i) = sum_j y_j g_j + (a constant >= 0); what
    falls to the constant and to the joint limits is free in (12) anyway.
    """
    ground, squares = proof.ground, _squares(side, space)[:, 1:]
    m, n = ground.C.shape
    multipliers = np.zeros((len(squares), m, squares.shape[2]))
    for position, face in enumerate(proof.faces):
        if face < m:
            multipliers[:, face] += squares[:, position]
        else:
            i, Y = (face - m) % n, ground.Y_lower if face < m + n else ground.Y_upper
            multipliers += (Y[i, :m] / ground.half[i])[:, None] * squares[:, position, None]
    return multipliers


def _squares(side: Side, space: Basis) -> Array:
    """Values of |L_j' rho|^2 at the points for 1 and the faces used, (V, f + 1, N_A)."""
    monomials = rho(space.points) / np.sqrt(3.0) ** subsets(len(side.chain)).sum(axis=1)
    return np.square(np.einsum("nl,vjlk->vjnk", monomials, side.factors)).sum(axis=3)
