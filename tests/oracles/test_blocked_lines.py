"""Points that no region can hold together are refused, and Drake says that the named pair touches at the named configuration."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from certifier.errors import RegionError
from certifier.model import Array, Scene
from certifier.scene.parse import parse
from certifier.seeding.options import Method, SeedOptions
from certifier.seeding.propose import propose
from tests.oracles.clearance import DrakesClearance

EXAMPLES = Path(__file__).parents[2] / "examples"
TRIES, STEPS = 60, 100


def refusal(scene: Scene, a: Array, b: Array) -> str:
    """Returns why no region can hold two configurations; "" where a proposal with both was made."""
    try:
        propose(scene, SeedOptions(Method.LIMITS, q=tuple(a), contain=(tuple(b),)))
    except RegionError as error:
        return str(error) if error.code == "contain_blocked" else f"another error: {error}"
    return ""


@pytest.mark.parametrize("name", ["planar_2dof", "arm_3dof", "ur3e_bin"])
def test_drake_finds_contact_where_a_line_is_refused_and_none_where_it_is_not(name: str) -> None:
    scene = Scene.from_document(parse({"path": str(EXAMPLES / name / "scene.yaml")}))
    drake, rng, refused = DrakesClearance(scene), np.random.default_rng(0), 0
    for _ in range(TRIES):
        a, b = [q for q in rng.uniform(scene.q_lower, scene.q_upper, (300, scene.n)) if drake.free(q, 1e-3)][:2]
        said = refusal(scene, a, b)
        if said:
            named = re.search(r": (\S+) and (\S+) touch at q = \((.+)\) rad, on the straight line in s from the seed to this", said)
            assert named is not None, said
            distance, pair = drake.least(np.array([float(x) for x in named[3].split(",")]))
            assert distance < 1e-6
            assert (pair.a, pair.b) == named.groups()[:2]
            refused += 1
        else:
            s = scene.to_s(np.array([a, b]))
            assert all(drake.free(scene.to_q(x)) for x in s[0] + np.linspace(0, 1, STEPS)[:, None] * (s[1] - s[0]))
    assert refused > 0
