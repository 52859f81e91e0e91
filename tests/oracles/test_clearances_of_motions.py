"""Clearances that are proved of random motions are the least distances along them, to 10 % and to 0.1 mm.

Drake says where bodies are, and how far apart. Its distance of two boxes was seen to be too large by 34 mm. So a quadratic program over the
vertices measures again what comes near.
"""

from functools import cache

import numpy as np
import pytest
from pydrake.solvers import ClarabelSolver, MathematicalProgram
from scipy.optimize import minimize_scalar

from benchmarks import catalogue
from certifier.jobs.motion import certify
from certifier.motion.given import given
from certifier.outcome import Outcome
from certifier.proof.motion import Motion, Space
from certifier.scene.drake_model import build_diagram, drake_name, geometry_name
from tests.certifier.motions import positions

EXAMPLES = ("planar_2dof", "arm_3dof", "iiwa_shelf", "ur3e_bin")
SAMPLES, COARSE = 401, 41
LONG = 25
"""How many motions of each example the slow suite checks."""
OFF = 5e-2
"""Drake's distances are wrong by less than this, in metres,"""
SOLVED = 1e-6
"""and those of the quadratic program by less than this."""


class Drake:
    """Drake's model of an example."""

    def __init__(self, name):
        self._scene = scene = catalogue.scene(name)
        diagram = build_diagram(scene)
        self._plant, self._graph = diagram.plant(), diagram.scene_graph()
        self._context = diagram.CreateDefaultContext()
        self._at, self._seen = diagram.mutable_plant_context(self._context), diagram.mutable_scene_graph_context(self._context)
        inspector = self._graph.model_inspector()
        ids = {geometry_name(inspector, i): i for i in inspector.GetAllGeometryIds()}
        self._pairs = [(ids[pair.a], ids[pair.b]) for pair in scene.pairs]

    def sampled(self, q):
        """Drake's distance of every pair, less the paddings, at joint positions (n,)."""
        self._plant.SetPositions(self._at, q)
        query = self._graph.get_query_output_port().Eval(self._seen)
        return np.array([query.ComputeSignedDistancePairClosestPoints(a, b).distance for a, b in self._pairs]) - 2 * self._scene.padding

    def exact(self, q, number):
        """The distance of a pair, less the paddings, by Drake's poses and a quadratic program."""
        pair = self._scene.pairs[number]
        self._plant.SetPositions(self._at, q)
        program, reach = MathematicalProgram(), 2 * self._scene.padding
        z = program.NewContinuousVariables(3)
        variables, columns = [z], [np.eye(3)]
        for name, sign in ((pair.a, -1.0), (pair.b, 1.0)):
            geometry = self._scene.geometry(name)
            body = self._plant.world_body() if geometry.body == "world" else self._plant.GetBodyByName(drake_name(geometry.body))
            pose = self._plant.EvalBodyPoseInWorld(self._at, body).GetAsMatrix34()
            weights = program.NewContinuousVariables(len(geometry.vertices))
            program.AddBoundingBoxConstraint(0, 1, weights)
            program.AddLinearEqualityConstraint(np.ones((1, len(weights))), np.ones(1), weights)
            variables.append(weights)
            columns.append(sign * (pose[:, :3] @ geometry.vertices.T + pose[:, 3:]))
            reach += geometry.radius
        program.AddLinearEqualityConstraint(np.hstack(columns), np.zeros(3), np.concatenate(variables))
        program.AddQuadraticCost(np.eye(3), np.zeros(3), z, is_convex=True)
        found = ClarabelSolver().Solve(program)
        assert found.is_success()
        return float(np.linalg.norm(found.GetSolution(z))) - reach


drake = cache(Drake)


def least(name, motion):
    """The least distance along a motion: samples by Drake, and exact samples and a descent for each pair that comes near to the least."""
    scene, model, found = catalogue.scene(name), drake(name), np.inf
    times, coarse = np.linspace(0, 1, SAMPLES), np.linspace(0, 1, COARSE)
    sampled = np.array([[model.sampled(q) for q in positions(scene, motion, piece, times)] for piece in range(motion.pieces)])
    for piece, pair in np.argwhere(sampled.min(axis=1) < sampled.min() + OFF):

        def distance(time, piece=piece, pair=pair):
            return model.exact(positions(scene, motion, piece, [time])[0], pair)

        known = [distance(time) for time in coarse]
        i = int(np.argmin(known))
        between = minimize_scalar(distance, bounds=(coarse[max(i - 1, 0)], coarse[min(i + 1, COARSE - 1)]), method="bounded")
        found = min(found, between.fun, known[i])
    return found


def free_motions(name, count, seed):
    """Random motions of an example that are certified: straight ones of two pieces in q or s, and cubic curves."""
    scene, rng = catalogue.scene(name), np.random.default_rng(seed)
    around, found = catalogue.seed(name), 0
    while found < count:
        way = rng.choice([0.1, 0.3, 1.0]) * rng.normal(size=(4, scene.n)) / 3
        points = np.clip(around + way, scene.q_lower, scene.q_upper)
        straight = given(scene, points[:3], Space.Q, Space.S if found % 3 else Space.Q)
        motion = Motion(Space.Q, points, 3) if found % 3 == 2 else straight
        if certify(scene, motion).outcome is Outcome.CERTIFIED:
            found += 1
            yield motion


def check(name, count, seed):
    scene = catalogue.scene(name)
    for motion in free_motions(name, count, seed):
        found = certify(scene, motion, clearance=True)
        clearance, nearest, true = found.statement.gap, found.nearest, least(name, motion)
        assert clearance == found.document()["clearance"]
        assert max(0.9 * true, true - 1e-4) - SOLVED <= clearance <= true + SOLVED
        at = np.array(found.document()["nearest"]["q"])
        assert drake(name).exact(at, scene.pairs.index(nearest.pair)) == pytest.approx(nearest.distance, abs=SOLVED)
        # Half of the clearance around every body is kept; half of what is more than Drake's distance is not.
        assert certify(scene, motion, padding=0.499 * clearance).outcome is Outcome.CERTIFIED
        asked = true + 2e-5
        refuted = certify(scene, motion, padding=asked / 2)
        stop = refuted.document()["stop"]
        begins = (stop["piece"], stop["time"]) == (0, 0.0)
        there = drake(name).exact(np.array(stop["q"]), scene.pairs.index(refuted.stop.pair))
        assert refuted.outcome is Outcome.REFUTED
        assert there <= asked + 1e-6
        assert begins or there == pytest.approx(asked, abs=1e-6), "the first configuration where the padding is not kept"
        before = [(piece, np.linspace(0, stop["time"] if piece == stop["piece"] else 1, 50)) for piece in range(stop["piece"] + 1)]
        earlier = np.concatenate([positions(scene, motion, piece, times) for piece, times in before])
        assert begins or min(drake(name).sampled(q).min() for q in earlier) >= asked - 1e-6


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_clearance_is_drakes_least_distance(name):
    check(name, 3, 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_the_clearance_of_many_motions_is_drakes_least_distance(name):
    check(name, LONG, 1)
