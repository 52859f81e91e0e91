"""Program (11) by other hands: Drake's CspaceFreePolytope, solved by Clarabel."""

from __future__ import annotations

import numpy as np
from pydrake.geometry.optimization import CspaceFreePolytope, SeparatingPlaneOrder
from pydrake.solvers import ClarabelSolver, SolutionResult

from certifier.drake_model import build_diagram, geometry_name
from certifier.model import Array, Scene


def drake_certifies(scene: Scene, index: int, C: Array, d: Array) -> bool:
    """Whether Drake finds planes, affine in s, that separate pair ``index`` on {C s <= d} within the joint limits.

    Only Clarabel's "Solved" is a yes and only "PrimalInfeasible" a no; Drake itself takes "AlmostSolved" for success.

    Raises:
        AssertionError: the solver ended otherwise.
    """
    diagram = build_diagram(scene)
    inspector = diagram.scene_graph().model_inspector()
    ids = {geometry_name(inspector, i): i for i in inspector.GetAllGeometryIds()}
    pair = scene.pairs[index]
    polytopes = CspaceFreePolytope(diagram.plant(), diagram.scene_graph(), SeparatingPlaneOrder.kAffine, scene.q_star)
    first, second = sorted((ids[pair.a], ids[pair.b]), key=lambda i: i.get_value())
    program = polytopes.MakeIsGeometrySeparableProgram((first, second), np.asfortranarray(C), d)
    result = ClarabelSolver().Solve(program.prog())
    status = result.get_solver_details().status
    found = {(SolutionResult.kSolutionFound, "Solved"): True, (SolutionResult.kInfeasibleConstraints, "PrimalInfeasible"): False}
    answer = found.get((result.get_solution_result(), status))
    assert answer is not None, f"Clarabel ended with {status}"
    return answer
