"""Drake's CspaceFreePolytope solves program (11) here with a convex solver of one's choice, as a cross-check.

The planes, affine in s, and the multipliers are the same as ours. But Drake chooses the reference frame, keeps every face, and treats
balls by another relaxation. The answer is a solver's word in floating point, so it is never worth more than :attr:`Guarantee.NUMERIC`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

import numpy as np
from pydrake.geometry.optimization import CspaceFreePolytope, SeparatingPlaneOrder
from pydrake.multibody.rational import RationalForwardKinematics
from pydrake.solvers import (
    ClarabelSolver,
    CsdpSolver,
    MathematicalProgramResult,
    MosekSolver,
    ScsSolver,
    SolutionResult,
    SolverInterface,
)

from certifier.errors import CirisError, SceneError
from certifier.jobs.verdict import Verdict
from certifier.model import Array, Polytope, Scene
from certifier.outcome import Guarantee, Outcome, Stage
from certifier.pair.result import PairResult
from certifier.polytopes.polytope import chebyshev_center
from certifier.scene.drake_model import build_diagram, check_independent, geometry_name, scene_name


class Solver(StrEnum):
    """A solver is a convex solver that Drake can hand the program to."""

    CLARABEL = "clarabel"
    """This is an open interior-point solver."""
    SCS = "scs"
    """This is an open first-order solver of low accuracy."""
    CSDP = "csdp"
    """This is an open interior-point solver, which splits every free variable in two."""
    MOSEK = "mosek"
    """This is an interior-point solver, which needs a licence."""


@dataclass(frozen=True)
class _Answers:
    """Says how one solver is called and which of its words mean yes and no; any other word means neither."""

    make: Callable[[], SolverInterface]
    status: str
    yes: Any
    no: Any


_SOLVERS = {
    Solver.CLARABEL: _Answers(ClarabelSolver, "status", "Solved", "PrimalInfeasible"),
    Solver.SCS: _Answers(ScsSolver, "scs_status", 1, -2),
    Solver.CSDP: _Answers(CsdpSolver, "return_code", 0, 1),
    Solver.MOSEK: _Answers(MosekSolver, "solution_status", 1, 5),
}


def available() -> list[Solver]:
    """Returns the solvers that this Drake has and that are licensed."""
    return [name for name, answers in _SOLVERS.items() if answers.make().available() and answers.make().enabled()]


@dataclass(frozen=True)
class ReferenceResult:
    """Holds what Drake and the solver say about one pair.

    Attributes:
        outcome: certified, not_certifiable or inconclusive.
        status: the solver's name, how Drake says that it ended, and the solver's own word for it.
        frame: the body in whose frame Drake expressed the plane.
        build_seconds, solve_seconds: processor time that making and solving the program took.
    """

    outcome: Outcome
    status: str
    frame: str
    build_seconds: float
    solve_seconds: float


class Reference:
    """Makes and solves Drake's pair programs for one scene.

    Args:
        solver: the name of a :class:`Solver`, one of :func:`available`.

    Attributes:
        setup_seconds: processor time that Drake took for the symbolic kinematics of all pairs.

    Raises:
        CirisError: ``solver_unavailable``.
        SceneError: ``unsupported_shape``, ``unsupported_padding`` or ``unsupported_joint``.
    """

    def __init__(self, scene: Scene, solver: str = Solver.CLARABEL) -> None:
        if solver not in available():
            wrong = "is not available or not licensed" if solver in list(Solver) else "is unknown"
            raise CirisError("solver_unavailable", f"{solver} {wrong}", field="solver", hint=f"available: {', '.join(available())}")
        self.scene, self._solver, self._answers = scene, solver, _SOLVERS[Solver(solver)]
        if any(map(scene.padding_of, scene.pairs)):
            raise SceneError("unsupported_padding", "Drake's programs have no padding", field="padding", hint="set it to 0")
        check_independent(scene)
        start = time.process_time()
        self._diagram = diagram = build_diagram(scene)
        inspector = diagram.scene_graph().model_inspector()
        self._ids = {geometry_name(inspector, i): i for i in inspector.GetAllGeometryIds()}
        self._polytopes = CspaceFreePolytope(diagram.plant(), diagram.scene_graph(), SeparatingPlaneOrder.kAffine, scene.q_star)
        self.setup_seconds = time.process_time() - start
        self._order = self._joint_order()

    def certify(self, index: int, C: Array, d: Array) -> ReferenceResult:
        """Asks for planes, affine in s, that separate pair ``scene.pairs[index]`` on {C s <= d} within the joint limits."""
        pair = self.scene.pairs[index]
        first, second = sorted((self._ids[pair.a], self._ids[pair.b]), key=lambda i: i.get_value())
        start = time.process_time()
        program = self._polytopes.MakeIsGeometrySeparableProgram((first, second), np.asfortranarray(C[:, self._order]), d)
        built = time.process_time()
        result = self._answers.make().Solve(program.prog())
        solved = time.process_time()
        plane = self._polytopes.separating_planes()[program.plane_index]
        frame = scene_name(self._diagram.plant().get_body(plane.expressed_body).name())
        outcome, status = self._outcome(result)
        return ReferenceResult(outcome, status, frame, built - start, solved - built)

    def alternate(self, C: Array, d: Array, max_rounds: int, tolerance: float) -> list[tuple[Array, Array]]:
        """Runs Drake's bilinear alternation between (11) and (12) from {C s <= d}.

        The alternation ends when the ellipsoid's volume grows by less than ``tolerance``.

        Returns:
            The polytope of every round, without the joint limits; none when not even the first polytope could be certified.
        """
        options = CspaceFreePolytope.BilinearAlternationOptions()
        options.max_iter, options.convergence_tol = max_rounds, tolerance
        for program in (options.find_lagrangian_options, options.find_polytope_options):
            program.solver_id = self._answers.make().solver_id()
        found = self._polytopes.SearchWithBilinearAlternation(set(), np.asfortranarray(C[:, self._order]), d, options)
        ours = np.argsort(self._order)
        return [(result.C()[:, ours], result.d()) for result in found]

    def _outcome(self, result: MathematicalProgramResult) -> tuple[Outcome, str]:
        """Returns the outcome and the words for it.

        Drake takes "almost solved" for success, so the solver's own word counts as well.
        """
        found = result.get_solution_result()
        word = getattr(result.get_solver_details(), self._answers.status)
        status = f"{self._solver}: {found.name.removeprefix('k')} ({word})"
        if found == SolutionResult.kSolutionFound and word == self._answers.yes:
            return Outcome.CERTIFIED, status
        if found == SolutionResult.kInfeasibleConstraints and word == self._answers.no:
            return Outcome.NOT_CERTIFIABLE, status
        return Outcome.INCONCLUSIVE, status

    def _joint_order(self) -> list[int]:
        """Returns our position index of every entry of Drake's s.

        On a branched tree Drake numbers the entries of s otherwise than those of q.
        """
        s = np.linspace(-0.5, 0.5, self.scene.n)
        theirs = RationalForwardKinematics(self._diagram.plant()).ComputeSValue(self.scene.to_q(s), self.scene.q_star)
        return [int(np.abs(s - value).argmin()) for value in theirs]


def certify(scene: Scene, polytope: Polytope, solver: str, progress: Callable[[str], None] = lambda _: None) -> Verdict:
    """Lets Drake certify every pair on a polytope and the joint limits.

    Raises:
        CirisError: as :class:`Reference`.
        RegionError: the polytope is malformed, empty or unbounded; on an empty one a solver would "certify" anything.
    """
    start = time.perf_counter()
    given = Polytope.given(polytope.C, polytope.d, scene.n)
    chebyshev_center(scene.polytope(given.C, given.d), tuple(joint.name for joint in scene.moving))
    reference = Reference(scene, solver)
    results: dict[int, PairResult] = {}
    for index, pair in enumerate(scene.pairs):
        found = reference.certify(index, given.C, given.d)
        results[index] = PairResult(found.outcome, Stage.SOS, found.build_seconds + found.solve_seconds, detail=found.status)
        progress(f"drake: {index + 1}/{len(scene.pairs)} {pair.a} - {pair.b}: {found.outcome}")
    return Verdict(results, Guarantee.NUMERIC, time.perf_counter() - start)
