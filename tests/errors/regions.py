"""Errors of seeds, polytopes, options, growth and the programs that are asked."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from certifier.carry.robot import same_bodies
from certifier.growth.machine import begin
from certifier.growth.options import GrowthOptions
from certifier.growth.state import GrowthState
from certifier.isolation.child import run_in_child
from certifier.jobs import local
from certifier.jobs.reference import Reference
from certifier.model import Polytope, Scene
from certifier.motion.given import given as moved
from certifier.motion.splines import curve
from certifier.polytopes.polytope import bound_multipliers, chebyshev_center
from certifier.polytopes.sampling import hit_and_run
from certifier.proof.motion import Space
from certifier.seeding.options import SeedOptions
from certifier.seeding.propose import propose
from certifier.step.step import step
from certifier.stored import value
from planner.cover.options import MOST_GIVEN, CoverOptions
from tests.certifier.scenes import planar_arm
from tests.certifier.seeding.test_propose import crane
from tests.errors.rows import Row, rows
from tests.scenes import box_seed, slider

LIMITS = "add the joint limits as rows"
STORED = "the document was changed or is of another version; load the scene from its file again"
SCALED = "scale the rows of C to length 1, and leave out rows that nearly repeat others"
PUSH = "push the faces out instead of stepping (pushes)"
CENTER = "leave it out to have one found"
ROBOT = "grow a region of the new scene: its joints, their limits and q* must be those of the old one"


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


GROWTH = [
    *rows(
        "certifier/jobs/parallel.py",
        (
            "worker_lost",
            "",
            "a process that certified pairs died",
            "look whether the machine ran out of memory; fewer cores need less of it",
            "a process that the machine killed (tests/certifier/jobs/test_parallel.py)",
        ),
    ),
    *rows(
        "certifier/growth/machine.py",
        (
            "polytope_missing",
            "polytope",
            "a polytope needs C and d",
            "give both",
            lambda t: begin(slider(), GrowthOptions.from_document({"kind": "certify", "seed": {}})),
        ),
    ),
    *rows(
        "certifier/growth/again.py",
        ("polytope_missing", "polytope", "a region needs C, d and q", "give all of them", lambda t: again()),
        (
            "seed_wrong_length",
            "seed.q",
            "a configuration to keep has not {n} numbers",
            "one for each joint",
            lambda t: again(C=[[1.0]], d=[0.5], q=[[0.0, 0.0]]),
        ),
        (
            "seed_cut_off",
            "seed.q",
            "a configuration to keep is not inside the region",
            "name one that is inside",
            lambda t: again(C=[[1.0]], d=[0.1], q=[[0.9]]),
        ),
    ),
    *rows(
        "certifier/carry/robot.py",
        (
            "other_robot",
            "scene",
            "the old scene has {n} joints that move and the new one has {n}",
            ROBOT,
            lambda t: same_bodies(slider(), planar_arm(2)),
        ),
        (
            "other_robot",
            "scene",
            "{what} of joint {name} is not what it was",
            ROBOT,
            lambda t: same_bodies(slider(), replace(slider(), q_star=np.array([0.1]))),
        ),
    ),
    *rows(
        "certifier/positions.py",
        *(
            (code, "{field}{place}", "{...} is no number of at most {most}", "", provoke)
            for code, provoke in (
                ("number_too_large", lambda t: seeded(q=[0, 1e16])),
                ("number_too_large", lambda t: seeded(q=[0, 0], contain=[[0, float("inf")]])),
                ("number_too_large", lambda t: slider().in_windows([1e7])),
                ("motion_not_finite", lambda t: moved(slider(), [[0.0], [float("nan")]], Space.Q)),
                ("motion_not_finite", lambda t: curve({"bezier": [[[0.0], [float("inf")]]]})),
            )
        ),
    ),
    *rows(
        "certifier/options.py",
        ("unknown_option", "{place}.{name}", "there is no option {name}", "{...}", lambda t: grow(speed=3)),
        ("unknown_option", "{place}.{name}", "there is no option {name}", "options: {...}", lambda t: grow(xyz=3)),
        ("unknown_option", "{place}.{name}", "there is no option {name}", "give {place}.{found}", lambda t: grow(pushes=3)),
        ("option_value", "{where}", "{name} must be {what}", "", lambda t: grow(cells=0)),
        ("option_value", "{where}", "{...} must be a list{...}", "", lambda t: seeded(q="0,0")),
        ("option_value", "{where}", "{...} must be a list of numbers", "", lambda t: seeded(q=["0", "0"])),
        (
            "option_value",
            "{where}",
            "{...} must have at most {most} items",
            "",
            lambda t: CoverOptions.from_document({"seeds": MOST_GIVEN * [[0.0]] + [[0.0]]}),
        ),
    ),
    *rows(
        "certifier/growth/options.py",
        ("option_value", "options.kind", "kind must be 'grow', 'certify' or 'recertify'", "", lambda t: grow(kind="shrink")),
        (
            "option_value",
            "seed.method",
            "only the papers' algorithm begins with the method {method}",
            "ask for that algorithm with the option paper, or choose another method",
            lambda t: grow(seed={"q": [0.0], "method": "limits"}),
        ),
        (
            "option_value",
            "options.paper.contraction",
            "uniform contraction does not keep points inside",
            "leave out the points, or contract otherwise",
            lambda t: grow(paper={"contraction": "uniform"}, seed={"q": [0.0], "contain": [[0.1]]}),
        ),
    ),
    *rows(
        "certifier/stored.py",
        (
            "other_version",
            "job",
            "this job was begun by another version of ciris and cannot go on",
            "retry it",
            lambda t: value(GrowthState, {}),
        ),
    ),
    *rows(
        "certifier/isolation/child.py",
        (
            "child_timeout",
            "",
            "it took more than {timeout_s} s and was stopped{...}",
            "ask for less, or try again when the machine has less to do",
            lambda t: child("time:sleep", 60, timeout_s=0.5),
        ),
        (
            "child_memory",
            "",
            "it needed more than {...} GiB of memory{tail}",
            "ask for less: fewer bodies, or fewer vertices",
            lambda t: child("builtins:bytearray", 1 << 40),
        ),
        (
            "child_died",
            "",
            "the process died ({how}){tail}",
            "try again; report it with these words if it dies again",
            lambda t: child("os:_exit", 3),
        ),
    ),
    *rows(
        "certifier/growth/refusal.py",
        (
            "not_grown",
            "",
            "{...}",
            "allow more time",
            lambda t: local.grow(slider(), grow(seed=box_seed([0.0], 0.1)), deadline_s=1e-6),
        ),
        ("not_grown", "", "{...}", "{...}", "a seed next to contact: tests/certifier/jobs/test_next_to_contact.py"),
        ("not_grown", "", "{...}", "try another seed, or look at the pair named", "bodies that come too close between points to keep"),
        ("revoked", "", "{...}", "grow a region of the new scene from another seed", "tests/certifier/jobs/test_recertify.py"),
    ),
    *rows(
        "certifier/jobs/reference.py",
        ("solver_unavailable", "solver", "{solver} {wrong}", "available: {...}", lambda t: Reference(slider(), "abacus")),
        (
            "unsupported_padding",
            "padding",
            "Drake's programs have no padding",
            "set it to 0",
            lambda t: Reference(crane(padding=0.1)),
        ),
    ),
    *rows(
        "certifier/model.py",
        ("unknown_geometry", "", "no geometry is called {name}", "write model/body/geometry", lambda t: slider().geometry("nothing")),
        ("scene_document", "{...}", "{...}", STORED, lambda t: stored(joints=3)),
        ("scene_hash", "hash", "the scene's stored hash does not match its content", STORED, lambda t: stored(padding=0.5)),
        (
            "scene_schema",
            "schema_version",
            "the scene's schema version is not {SCHEMA_VERSION}",
            STORED,
            lambda t: stored(schema_version=9),
        ),
        (
            "polytope_shape",
            "seed.C",
            "C and d must be lists of numbers, and the rows of C equally long",
            "",
            lambda t: given([[1.0, 0.0], [-1.0]], [1.0, 1.0]),
        ),
        (
            "polytope_shape",
            "seed.C",
            "C is {...} and d is {...}",
            "C must be m x {...}, one column a joint in the scene's order, and d must have m numbers",
            lambda t: given([[1.0, 0.0, 0.0]], [1.0]),
        ),
        (
            "polytope_not_finite",
            "seed.C",
            "C and d must be finite numbers of at most {LARGEST}",
            "",
            lambda t: given([[1.0, float("nan")]], [1.0]),
        ),
    ),
]

POLYTOPES = [
    *rows(
        "certifier/polytopes/ellipsoid.py",
        ("ellipsoid_failed", "polytope", "no inscribed ellipsoid was found", SCALED, "a polytope whose linear algebra breaks down"),
    ),
    *rows(
        "certifier/polytopes/polytope.py",
        (
            "polytope_unbounded",
            "polytope",
            "no row bounds {joint} from {word}",
            LIMITS,
            lambda t: chebyshev_center(polytope([[1, 0]], [1])),
        ),
        (
            "polytope_empty",
            "polytope",
            "the polytope is flat: no ball of radius {_FLAT} fits inside",
            "move its faces apart",
            lambda t: chebyshev_center(polytope([[1], [-1]], [0, 0])),
        ),
        (
            "polytope_empty",
            "polytope",
            "no point satisfies C s <= d",
            "look at the signs and at the joint limits",
            lambda t: given([[1.0, 0.0], [-1.0, 0.0]], [-1.0, 0.0]),
        ),
        (
            "polytope_unbounded",
            "polytope",
            "the polytope is unbounded along {v}",
            LIMITS,
            lambda t: chebyshev_center(polytope([[1, -1], [-1, 1]], [1, 1])),
        ),
        (
            "polytope_numerics",
            "polytope",
            "a linear program over the polytope failed",
            SCALED,
            "a polytope whose linear algebra breaks down",
        ),
        (
            "polytope_without_limits",
            "polytope",
            "no row bounds s[{...}] alone from {...}",
            LIMITS,
            lambda t: bound_multipliers(polytope([[1, 1], [-1, 1], [0, -1]], [1, 1, 1])),
        ),
    ),
    *rows(
        "certifier/polytopes/sampling.py",
        (
            "start_outside",
            "start",
            "sampling must start at a point inside the polytope",
            "",
            lambda t: hit_and_run(polytope([[1], [-1]], [1, 1]), [2.0], 1, 0),
        ),
        (
            "polytope_unbounded",
            "polytope",
            "a line through the polytope does not end",
            LIMITS,
            lambda t: hit_and_run(polytope([[1]], [1]), [0.0], 1, 0),
        ),
    ),
    *rows(
        "certifier/step/step.py",
        (
            "point_outside",
            "contain",
            "a point to contain must be in the polytope",
            "",
            lambda t: step(slider(), slider().polytope([], []), {}, contain=np.array([[9.0]])),
        ),
        ("step_failed", "polytope", "nothing larger was found from {scale} of the polytope", PUSH, "a region that cannot grow"),
        (
            "step_failed",
            "polytope",
            "no proof holds with room to spare on the step's trust box",
            PUSH,
            "a region whose proofs have no room to spare",
        ),
        (
            "step_too_large",
            "options.paper.max_rounds",
            "with all {n} joints in play the polynomials of {a} and {b} have {terms} terms, {most}",
            PUSH,
            "an arm of many joints",
        ),
    ),
]

SEEDS = [
    *rows(
        "certifier/seeding/free.py",
        (
            "seed_in_collision",
            "seed.q",
            "{a} and {b} {how}{hollow}",
            "the nearest free configuration found is q = {...}",
            lambda t: seeded(q=[1.5, 1.57]),
        ),
        (
            "seed_in_collision",
            "seed.q",
            "{a} and {b} {how}{hollow}",
            "move the seed, or ignore the pair in the scene",
            lambda t: propose(crane(padding=9.0), SeedOptions(q=(0.0, 0.0))),
        ),
    ),
    *rows(
        "certifier/seeding/iris.py",
        ("seeding_failed", "seed", "{method}: {error}", "try another method, or move the seed", "numbers that IRIS cannot do with"),
    ),
    *rows(
        "certifier/seeding/limits.py",
        (
            "seed_outside_limits",
            "{field}[{i}]",
            "joint {name} is at {value}, not between its limits {own_lower} and {own_upper}",
            "move it between them",
            lambda t: seeded(q=[2.1, 0]),
        ),
        (
            "seed_outside_window",
            "{field}[{i}]",
            "joint {name} is at {value}, outside of the window from {lower} to {upper} that the scene covers",
            "set q_star of this joint to about {value}",
            lambda t: propose(t.scene(limit='<limit lower="-6" upper="6" effort="1" velocity="1"/>'), SeedOptions(q=(3.1,))),
        ),
    ),
    *rows(
        "certifier/seeding/options.py",
        ("missing_option", "seed.q", "the method {...} needs {name}", "give it", lambda t: seeded(method="iris_zo")),
        (
            "missing_option",
            "seed.half_width",
            "the method {...} needs {name}",
            "give it in s, such as 0.1: about 11 degrees on each side of a joint near q*",
            lambda t: seeded(q=[0.0], method="box"),
        ),
        (
            "option_value",
            "seed.center",
            "the method {...} has no use for {name}",
            "leave it out",
            lambda t: seeded(q=[0, 0], center=[0, 0]),
        ),
    ),
    *rows(
        "certifier/seeding/propose.py",
        ("seed_wrong_length", "seed.q", "the seed has {size} numbers, the scene {n} joints", "in order: {names}", lambda t: seeded(q=[0])),
        (
            "seed_cut_off",
            "seed",
            "the polytope of {method} does not contain the seed and all of contain",
            "allow fewer iterations, or give points that see one another",
            "IRIS cutting off a point that it was to keep",
        ),
        (
            "seed_cut_off",
            "seed",
            "the polytope of {method} does not contain the seed",
            "allow fewer iterations, or give points that see one another",
            "IRIS cutting off its own seed",
        ),
        ("seed_hindered", "seed", "{...}", "{...}", "a seed so near to contact that IRIS finds no polytope around it"),
        (
            "center_outside",
            "seed.center",
            "the centre does not lie strictly inside the polytope and the joint limits",
            CENTER,
            lambda t: given([[1.0, 0.0]], [0.5], center=[0.6, 0.0]),
        ),
    ),
]

REGIONS: list[Row] = [*GROWTH, *POLYTOPES, *SEEDS]
