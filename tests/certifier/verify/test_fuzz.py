"""A campaign over files of strangers: the verifier always answers, within its time and its memory, and what it says holds is true.

``CIRIS_FUZZ_SECONDS`` is how long the long campaign (``-m slow``) lasts.
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from certifier.errors import RegionError, SceneError
from certifier.isolation.child import run_in_child
from certifier.kinematics import Kinematics
from certifier.model import WORLD, Pair, Scene
from certifier.outcome import Outcome
from certifier.pair.certification import Certification
from certifier.proof.container import unpack
from certifier.proof.ground import Ground
from certifier.proof.motion import MotionProof
from certifier.proof.negative import DualProof, WitnessProof
from certifier.proof.pair import PairProof
from certifier.proof.region import RegionProof
from certifier.scene.bundle import load_bundle, pack_bundle
from certifier.verify.motion import verify_motion
from certifier.verify.pair import verify_pair
from certifier.verify.region import verify_region
from certifier.verify.scene import check_scene
from certifier.verify.witness import TOLERANCE
from tests.certifier.motions import positions
from tests.certifier.truth import distances, distances_at
from tests.certifier.verify.hostile import FAMILIES, HOSTILE, KINDS, bytes_changed, members, mutants, text_of, valid, zip_changed, zipped

SECONDS_A_CASE, MEMORY_BYTES = 20.0, 1 << 30
EXAMPLES, BUNDLES = 80, 20
LONG_SECONDS = float(os.environ.get("CIRIS_FUZZ_SECONDS", "3600"))
EXAMPLE = Path(__file__).parents[3] / "examples" / "planar_2dof" / "scene.yaml"


class Figures:
    """What a campaign met."""

    def __init__(self) -> None:
        self.outcomes: Counter[tuple[str, str]] = Counter()
        self.slowest, self.peak = 0.0, 0

    def __str__(self) -> str:
        lines = [f"{sum(self.outcomes.values())} cases, slowest {self.slowest:.2f} s, peak memory {self.peak / 2**20:.0f} MiB"]
        return "\n".join([*lines, *(f"  {family}, {code}: {count}" for (family, code), count in sorted(self.outcomes.items()))])


FIGURES = Figures()


def judged(family: str, kind: str, data: bytes) -> dict[str, Any]:
    """The verifier's answer, which it gives in a child with little memory; counted."""
    with tempfile.NamedTemporaryFile(suffix=".proof") as file:
        file.write(data)
        file.flush()
        began, payload = time.perf_counter(), {"path": file.name}
        found = run_in_child("tests.certifier.verify.judge:judge", payload, timeout_s=SECONDS_A_CASE, memory_bytes=MEMORY_BYTES)
    FIGURES.slowest = max(FIGURES.slowest, time.perf_counter() - began)
    FIGURES.peak = max(FIGURES.peak, found["peak"])
    answer: dict[str, Any] = found["answer"]
    code = "accepted" if answer["holds"] else answer["error"]["code"]
    FIGURES.outcomes[family, code if data != valid(kind) else "unchanged"] += 1
    return answer


def check_answer(family: str, case: tuple[str, bytes]) -> None:
    kind, data = case
    answer = judged(family, kind, data)
    texts = answer["statement"] if answer["holds"] else [answer["error"][key] or "" for key in ("code", "message", "field", "hint")]
    assert all(text.isprintable() for text in texts)
    if not answer["holds"]:
        assert answer.keys() == {"holds", "error"}
        assert answer["error"].keys() == {"code", "message", "field", "hint"}
        return
    assert answer.keys() == {"holds", "kind", "scene", "statement", "guarantee"}
    header, arrays = unpack(data, answer["kind"])
    scene = Scene.from_document(header["scene"])
    assert scene.hash == answer["scene"]["hash"]
    assert scene.hash in answer["statement"][0]
    if meaning(header, arrays, scene) != meaning(*unpack(valid(answer["kind"]), answer["kind"])):
        JUSTIFIED[answer["kind"]](data, scene)


def meaning(header: dict[str, Any], arrays: dict[str, np.ndarray], scene: Scene | None = None) -> tuple:
    """What a statement may follow from: all of the file but the scene's name, warnings and provenance."""
    scene = scene or Scene.from_document(header["scene"])
    rest = {key: value for key, value in header.items() if key != "scene"}
    return scene.hash, json.dumps(rest, sort_keys=True), {name: (a.dtype, a.shape, a.tobytes()) for name, a in arrays.items()}


def region_is_true(data: bytes, scene: Scene) -> None:
    proof, statement = RegionProof.from_bytes(data), verify_region(data)
    least = distances(scene, proof.C, proof.d, 60)
    assert statement.gaps.keys() == set(scene.pairs)
    assert all(statement.gaps[pair] <= least[pair] + 1e-9 for pair in scene.pairs)


def pair_is_true(data: bytes, scene: Scene) -> None:
    proof = PairProof.from_bytes(data, scene)
    statement = verify_pair(proof)
    polytope = scene.polytope(proof.ground.C, proof.ground.d)
    assert polytope.contains(proof.interior, 1e-9)
    inside = distances_at(scene, proof.interior[None])
    assert all(statement.gap <= inside[pair] + 1e-9 for pair in statement.pairs)
    with suppress(RegionError):  # where no point is strictly inside, the one is all that there is to look at
        least = distances(scene, polytope.C, polytope.d, 60)
        assert all(statement.gap <= least[pair] + 1e-9 for pair in statement.pairs)


def dual_is_true(data: bytes, scene: Scene) -> None:
    proof = DualProof.from_bytes(data, scene)
    polytope = scene.polytope(proof.ground.C, proof.ground.d)
    assert polytope.contains(proof.interior, 1e-9)
    with suppress(RegionError):
        result = Certification(scene, polytope).certify(scene.pairs.index(proof.pair))
        assert result.outcome is not Outcome.CERTIFIED or not contradicts(PairProof.from_bytes(result.proof, scene), proof)


def contradicts(found: PairProof, proof: DualProof) -> bool:
    """Whether what was found is of the kind that the dual proof excludes: in its frame, with its faces, or with some farther out."""
    every, used = half_spaces(proof.ground), half_spaces(found.ground)
    return found.frame == proof.frame and all(
        any(np.array_equal(c, normal) and offset <= d + 1e-12 for normal, offset in every) for c, d in (used[j] for j in found.faces)
    )


def half_spaces(ground: Ground) -> list[tuple[np.ndarray, float]]:
    """The faces of a ground and of its box, numbered as in a pair's proof, as c's <= d."""
    eye = np.eye(len(ground.mid))
    lower, upper = zip(-eye, ground.half - ground.mid, strict=True), zip(eye, ground.mid + ground.half, strict=True)
    return [*zip(ground.C, ground.d, strict=True), *lower, *upper]


def witness_is_true(data: bytes, scene: Scene) -> None:
    proof = WitnessProof.from_bytes(data, scene)
    assert scene.polytope(proof.C, proof.d).contains(proof.s, 1e-9)
    bodies = [scene.geometry(name) for name in (proof.pair.a, proof.pair.b)]
    p, q = (
        weights @ Kinematics(scene).points(WORLD, body.body, body.vertices, proof.s[None])[0] / weights.sum()
        for body, weights in zip(bodies, proof.weights, strict=True)
    )
    assert np.linalg.norm(p - q) <= sum(body.radius + scene.padding for body in bodies) + TOLERANCE + 1e-9


def motion_is_true(data: bytes, scene: Scene) -> None:
    """At 40 times of each piece, up to the end, and at as many corners of the tube."""
    proof = MotionProof.from_bytes(data, scene)
    statement, motion, rng = verify_motion(proof), proof.motion, np.random.default_rng(0)
    for piece in range(motion.pieces):
        times = np.linspace(0, proof.end if piece == motion.pieces - 1 else 1, 40)
        q = positions(scene, motion, piece, times)
        for near in (q, q + proof.rho * rng.choice([-1.0, 1.0], q.shape)):
            assert all(statement.gap <= least + 1e-9 for least in distances_at(scene, scene.to_s(near)).values())


JUSTIFIED: dict[str, Callable[[bytes, Scene], None]] = {
    "region": region_is_true,
    "pair": pair_is_true,
    "dual": dual_is_true,
    "motion": motion_is_true,
    "witness": witness_is_true,
}


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_valid_is_accepted_and_true(kind):
    check_answer("valid", (kind, valid(kind)))
    JUSTIFIED[kind](valid(kind), Scene.from_document(unpack(valid(kind), kind)[0]["scene"]))


def campaign(strategy: st.SearchStrategy, check: Callable[[Any], None], examples: int, number: int) -> None:
    """The check of this many examples; whatever fails is made as small as it can be."""
    phases = (Phase.generate, Phase.shrink)

    @seed(number)
    @settings(max_examples=examples, deadline=None, database=None, phases=phases, suppress_health_check=list(HealthCheck))
    @given(strategy)
    def run(case: Any) -> None:
        check(case)

    run()


@pytest.mark.parametrize("family", FAMILIES)
def test_every_file_is_answered(family):
    campaign(mutants(family), partial(check_answer, family), EXAMPLES, 0)
    print(FIGURES)


@st.composite
def bundles(draw) -> bytes:
    """A scene's bundle with bytes, members, or words of its files changed."""
    data = pack_bundle(EXAMPLE)
    way = draw(st.integers(0, 3))
    if way <= 1:
        return (bytes_changed, zip_changed)[way](draw, data)
    found = members(data)
    at = draw(st.integers(0, len(found) - 1))
    words = found[at][1].split(b" ")
    for place in draw(st.lists(st.integers(0, len(words) - 1), min_size=1, max_size=3)):
        words[place] = text_of(draw(HOSTILE)).strip(b'"') if draw(st.booleans()) else words[draw(st.integers(0, len(words) - 1))]
    found[at] = (found[at][0], b" ".join(words))
    return zipped(found)


def check_bundle(data: bytes) -> None:
    began = time.perf_counter()
    try:
        scene = load_bundle(data).scene
    except SceneError as error:
        FIGURES.outcomes["bundle", error.code] += 1
    else:
        FIGURES.outcomes["bundle", "accepted"] += 1
        assert Scene.from_document(scene.to_document()).hash == scene.hash
        assert all(isinstance(pair, Pair) for pair in scene.pairs)
        check_scene(scene)
    FIGURES.slowest = max(FIGURES.slowest, time.perf_counter() - began)


def test_every_bundle_is_a_scene_or_an_error():
    campaign(bundles(), check_bundle, BUNDLES, 0)


@pytest.mark.slow
def test_a_long_campaign():
    end, number = time.monotonic() + LONG_SECONDS, 1
    while time.monotonic() < end:
        for family in FAMILIES:
            campaign(mutants(family), partial(check_answer, family), 200, number)
        campaign(bundles(), check_bundle, 20, number)
        number += 1
        print(f"after {LONG_SECONDS - (end - time.monotonic()):.0f} s: {FIGURES}", flush=True)
