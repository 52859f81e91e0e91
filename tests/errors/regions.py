"""Errors of seeds, polytopes, options, growth and the programs that are asked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from certifier.carry.robot import same_bodies
from certifier.growth.machine import begin
from certifier.growth.options import GrowthOptions
from certifier.growth.state import GrowthState
from certifier.isolation.child import run_in_child
from certifier.jobs import local
from certifier.jobs.map import ways_of
from certifier.jobs.reference import Reference
from certifier.map.options import MapOptions
from certifier.model import Polytope, Scene
from certifier.motion.given import given as moved
from certifier.motion.splines import curve
from certifier.options import read
from certifier.polytopes.polytope import bound_multipliers, chebyshev_center
from certifier.polytopes.sampling import hit_and_run
from certifier.proof.motion import Space
from certifier.scene import load_scene
from certifier.seeding.options import SeedOptions
from certifier.seeding.propose import propose
from certifier.step.step import step
from certifier.stored import value
from planner.cover.options import MOST_GIVEN, CoverOptions
from tests.certifier.scenes import planar_arm
from tests.certifier.seeding.test_propose import crane
from tests.errors.trial import Table
from tests.scenes import slider

PLANAR = Path(__file__).parents[2] / "examples/planar_2dof/scene.yaml"


def seeded(**seed: Any) -> None:
    propose(crane(), SeedOptions.from_document(seed))


def given(C: Any, d: Any, **more: Any) -> None:
    seeded(method="polytope", C=C, d=d, **more)


def grow(**options: Any) -> GrowthOptions:
    return GrowthOptions.from_document({"kind": "grow", "seed": {"q": [0.0]}, **options})


def again(**seed: Any) -> None:
    begin(slider(), GrowthOptions.from_document({"kind": "recertify", "seed": seed}))


def stored(**changed: Any) -> Scene:
    return Scene.from_document(slider().to_document() | changed)


def polytope(C: Any, d: Any) -> Polytope:
    return Polytope(np.array(C, dtype=float), np.array(d, dtype=float))


def child(function: str, payload: object, timeout_s: float = 60) -> None:
    run_in_child(function, payload, timeout_s=timeout_s, memory_bytes=1 << 30)


REGIONS: Table = {
    ("polytope_missing", "polytope"): [
        lambda t: begin(slider(), GrowthOptions.from_document({"kind": "certify", "seed": {}})),
        lambda t: again(),
    ],
    ("seed_wrong_length", "seed.q"): [lambda t: again(C=[[1.0]], d=[0.5], q=[[0.0, 0.0]]), lambda t: seeded(q=[0])],
    ("seed_cut_off", "seed.q"): [lambda t: again(C=[[1.0]], d=[0.1], q=[[0.9]])],
    ("other_robot", "scene"): [
        lambda t: same_bodies(slider(), planar_arm(2)),
        lambda t: same_bodies(slider(), replace(slider(), q_star=np.array([0.1]))),
    ],
    ("number_too_large", "seed.q[1]"): [lambda t: seeded(q=[0, 1e16])],
    ("number_too_large", "seed.contain[0][1]"): [lambda t: seeded(q=[0, 0], contain=[[0, float("inf")]])],
    ("number_too_large", "q[0]"): [lambda t: slider().in_windows([1e7])],
    ("motion_not_finite", "waypoints[1][0]"): [lambda t: moved(slider(), [[0.0], [float("nan")]], Space.Q)],
    ("motion_not_finite", "bezier[0][1][0]"): [lambda t: curve({"bezier": [[[0.0], [float("inf")]]]})],
    ("unknown_option", "options.speed"): [lambda t: grow(speed=3)],
    ("unknown_option", "options.xyz"): [lambda t: grow(xyz=3)],
    ("option_value", "options.cells"): [lambda t: grow(cells=-1)],
    ("unknown_option", "options.pushes"): [lambda t: grow(pushes=3)],
    ("option_value", "seed.q"): [lambda t: seeded(q="0,0"), lambda t: seeded(q=["0", "0"])],
    ("option_value", "options.seeds"): [lambda t: CoverOptions.from_document({"seeds": MOST_GIVEN * [[0.0]] + [[0.0]]})],
    ("option_value", "seed.method"): [lambda t: grow(seed={"q": [0.0], "method": "limits"})],
    ("option_value", "options.stages"): [lambda t: grow(paper={}, stages=2)],
    ("option_value", "seed.tries"): [lambda t: SeedOptions.from_document({"q": [0.0], "method": "limits", "tries": 3})],
    ("option_value", "options.kind"): [lambda t: grow(kind="shrink")],
    ("option_value", "options.paper.contraction"): [
        lambda t: grow(paper={"contraction": "uniform"}, seed={"q": [0.0], "contain": [[0.1]]})
    ],
    ("other_version", "job"): [lambda t: value(GrowthState, {})],
    ("child_timeout", ""): [lambda t: child("time:sleep", 60, timeout_s=0.5)],
    ("child_memory", ""): [lambda t: child("builtins:bytearray", 1 << 40)],
    ("child_died", ""): [lambda t: child("os:_exit", 3)],
    ("not_grown", ""): [lambda t: local.grow(slider(), grow(seed={"q": [0.0], "method": "limits"}, paper={}), deadline_s=1e-6)],
    ("solver_unavailable", "solver"): [lambda t: Reference(slider(), "abacus")],
    ("unsupported_padding", "padding"): [lambda t: Reference(crane(padding=0.1))],
    ("unknown_geometry", ""): [lambda t: slider().geometry("nothing")],
    ("scene_document", "joints"): [lambda t: stored(joints=3)],
    ("scene_hash", "hash"): [lambda t: stored(padding=0.5)],
    ("scene_schema", "schema_version"): [lambda t: stored(schema_version=9)],
    ("polytope_shape", "seed.C"): [lambda t: given([[1.0, 0.0], [-1.0]], [1.0, 1.0]), lambda t: given([[1.0, 0.0, 0.0]], [1.0])],
    ("polytope_not_finite", "seed.C"): [lambda t: given([[1.0, float("nan")]], [1.0])],
    ("polytope_unbounded", "polytope"): [
        lambda t: chebyshev_center(polytope([[1, 0]], [1])),
        lambda t: chebyshev_center(polytope([[1, -1], [-1, 1]], [1, 1])),
        lambda t: hit_and_run(polytope([[1]], [1]), [0.0], 1, 0),
    ],
    ("polytope_empty", "polytope"): [
        lambda t: chebyshev_center(polytope([[1], [-1]], [0, 0])),
        lambda t: given([[1.0, 0.0], [-1.0, 0.0]], [-1.0, 0.0]),
    ],
    ("polytope_without_limits", "polytope"): [lambda t: bound_multipliers(polytope([[1, 1], [-1, 1], [0, -1]], [1, 1, 1]))],
    ("start_outside", "start"): [lambda t: hit_and_run(polytope([[1], [-1]], [1, 1]), [2.0], 1, 0)],
    ("point_outside", "contain"): [lambda t: step(slider(), slider().polytope([], []), {}, contain=np.array([[9.0]]))],
    ("seed_in_collision", "seed.q"): [lambda t: seeded(q=[1.5, 1.57]), lambda t: propose(crane(padding=9.0), SeedOptions(q=(0.0, 0.0)))],
    ("seed_outside_limits", "seed.q[0]"): [lambda t: seeded(q=[2.1, 0])],
    ("seed_outside_window", "options.paths[0][1][0]"): [
        lambda t: ways_of(t.scene(limit='<limit lower="-6" upper="6" effort="1" velocity="1"/>'), [[[0.0], [4.0]]])
    ],
    ("option_value", "options.paths[0]"): [lambda t: read(MapOptions, {"paths": [[[0.0]]]}, "options")],
    ("seed_outside_window", "seed.q[0]"): [
        lambda t: propose(t.scene(limit='<limit lower="-6" upper="6" effort="1" velocity="1"/>'), SeedOptions(q=(3.1,)))
    ],
    ("contain_blocked", "seed.contain"): [
        lambda t: propose(load_scene(PLANAR), SeedOptions(q=(-1.7072, -1.5029), contain=((1.4046, -2.0546), (-1.3543, 2.3956))))
    ],
    ("contain_blocked", "seed.contain[0]"): [lambda t: seeded(q=[1.5, 0.8], contain=[[1.5, 2.4]])],
    ("missing_option", "seed.q"): [lambda t: seeded(method="box")],
    ("option_value", "seed.center"): [lambda t: seeded(q=[0, 0], center=[0, 0])],
    ("center_outside", "seed.center"): [lambda t: given([[1.0, 0.0]], [0.5], center=[0.6, 0.0])],
}
