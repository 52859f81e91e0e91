"""What is compiled or loaded before a job begins is all that the job calls."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

ALL = """
import json, sys
from numba.core.dispatcher import Dispatcher

def called():
    return {
        f"{function.py_func.__module__}.{function.py_func.__name__}{signature}"
        for name, module in list(sys.modules.items())
        if name.startswith("certifier.")
        for function in vars(module).values()
        if isinstance(function, Dispatcher)
        for signature in function.nopython_signatures
    }

%s
before = called()
%s
print(json.dumps([sorted(before), sorted(called() - before)]))
"""
PLANAR = """
from dataclasses import replace

import numpy as np

from certifier.conditioned import with_conditions
from certifier.conditions import Cone
from certifier.growth.options import GrowthOptions
from certifier.jobs import local
from certifier.model import Polytope
from certifier.scene import load_scene
from certifier.seeding import propose
from certifier.seeding.options import SeedOptions

scene = load_scene("examples/planar_2dof/scene.yaml")
proposal = propose.propose(scene, SeedOptions(q=(0.0, 0.0), contain={contain}))
for asked in {ways}:
    region = local.grow(scene, GrowthOptions.from_document({{"seed": {{"q": [0.0, 0.0]}}, **asked}}), propose=lambda _: proposal)
    local.recertify(replace(scene, padding=0.01), region.proof)
    ahead = Cone("ahead", "arm/lower", (1.0, 0.0, 0.0), "world", (1.0, 0.0, 0.0), 1.0)
    local.certify(with_conditions(scene, [ahead]), Polytope(np.concatenate([np.eye(2), -np.eye(2)]), np.full(4, 0.05)), cells=100)
"""


@pytest.mark.parametrize(
    ("warm_up", "contain", "ways"),
    [
        ("from certifier.jobs import kernels; kernels.warm_up()", "()", '({"stages": 1}, {"paper": {"pushes": 1}})'),
        ("from certifier.seeding import propose; propose.warm_up()", "((0.1, 0.1),)", "()"),
    ],
    ids=["solver", "seeding"],
)
def test_a_job_calls_nothing_that_was_not_loaded_before(warm_up: str, contain: str, ways: str) -> None:
    code = ALL % (warm_up, PLANAR.format(contain=contain, ways=ways))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded, late = json.loads(done.stdout)
    assert loaded
    assert late == []
