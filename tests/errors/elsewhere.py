"""Errors that no provocation of this directory makes, by the function that makes them."""

from __future__ import annotations

PROOF_FILES = ("certifier/document.py", "certifier/proof/", "certifier/verify/")
"""What these refuse is a file that is broken or was changed; the tests of certifier/verify and certifier/proof change files."""

TESTED = {
    "api/connections.py:": "tests/api/test_connections.py",
    "api/problems.py:_http": "tests/api/test_odd_requests.py",
    "api/problems.py:_unavailable": "tests/api/test_odd_requests.py",
    "api/problems.py:_unexpected": "tests/api/test_problems.py",
    "api/writing.py:change": "tests/api/test_writers.py",
    "certifier/growth/refusal.py:refusal": "tests/certifier/jobs/test_recertify.py",
    "certifier/jobs/motion.py:certify": "tests/certifier/motion/test_clearance.py",
    "certifier/jobs/parallel.py:side_by_side": "tests/certifier/jobs/test_parallel.py",
    "certifier/scene/census.py:check_counts": "tests/certifier/scene/test_names.py",
    "certifier/scene/drake_model.py:_shape": "tests/certifier/jobs/test_reference.py",
    "certifier/scene/strict.py:taken": "tests/certifier/scene/test_strict.py",
    "certifier/step/step.py:_check_size": "tests/certifier/step/test_step.py",
    "certifier/step/step.py:step": "tests/certifier/step/test_step.py",
    "ciris/job.py:why_no_region": "tests/ciris/test_endurance.py",
    "client/planning.py:_goal": "tests/client/test_planning.py",
    "client/planning.py:plan": "tests/client/test_planning.py",
    "db/migrate.py:_check": "tests/db/test_migrations.py",
    "jobs/cover.py:save": "tests/workers/test_covers.py",
    "planner/poses/frame.py:_body": "tests/planner/poses/test_frame.py",
    "planner/poses/frame.py:_three": "tests/planner/poses/test_frame.py",
    "planner/poses/frame.py:frame_of": "tests/planner/poses/test_frame.py",
    "planner/poses/line.py:line": "tests/planner/poses/test_line.py",
    "workers/pairs.py:_certify": "tests/workers/test_turns.py",
    "workers/stack.py:_migrate": "tests/workers/test_disk.py",
    "workers/steps.py:_do": "tests/workers/test_turns.py",
    "workers/turns.py:turn": "tests/workers/test_turns.py",
}
"""Maps a function to the test file that provokes its errors."""

UNTESTED = {
    "api/children.py:run": "many uploads or checks at the same time",
    "api/questions.py:ask": "many large questions at the same time",
    "certifier/jobs/clearance.py:clearance": "a region of a scene without pairs",
    "certifier/jobs/clearance.py:clearance_in_child": "a file that goes away before the child process reads it",
    "certifier/polytopes/ellipsoid.py:inscribed_ellipsoid": "a polytope whose linear algebra breaks down",
    "certifier/polytopes/polytope.py:_maximise": "a polytope whose linear algebra breaks down",
    "certifier/scene/drake_model.py:build_diagram": "a scene document that was made by hand",
    "certifier/scene/hull.py:outer": "a mesh for which no polytope is found; none is known",
    "certifier/scene/parse.py:_convex": "a shape that Drake is yet to have",
    "certifier/scene/parse.py:couplings": "a loop that the strict readers let through; none is known",
    "certifier/scene/parse.py:joint_of": "a joint that the strict readers let through; none is known",
    "certifier/scene/parse.py:read_models": "geometry that Drake leaves out and the strict readers let through; none is known",
    "certifier/scene/tree.py:_outward": "a loop of joints that Drake takes",
    "certifier/seeding/drake_iris.py:drake_iris": "numbers that IRIS cannot do with",
    "certifier/seeding/propose.py:_refuse_hindered": "a seed so near to contact that IRIS finds no polytope around it",
    "certifier/seeding/propose.py:propose": "IRIS cutting off its own seed",
    "client/bench.py:bench": "an installed wheel",
    "client/cli.py:_command": "an installation of the verifier alone",
    "client/demo.py:_grown": "a machine that is too busy for the demonstration",
    "client/demo.py:_stack": "a machine on which the stack does not come up",
    "client/verify.py:_answer": "a file that goes away while it is checked",
    "workers/stack.py:_wait_until_healthy": "a stack whose API does not come up",
    "workers/steps.py:carry_out": "a fault of the program",
    "workers/turns.py:decide": "a fault of the program",
}
"""Maps a function to what would make its error; no test does."""
