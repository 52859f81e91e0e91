"""Files of a forger who knows the format, about conditions: each is refused, and for the reason that it is about."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from certifier.conditioned import MOST_CONDITIONS, MOST_IN_ZONES, with_conditions, without_conditions
from certifier.conditions import Cone, Distance, Inside, Range
from certifier.errors import ProofError, SceneError
from certifier.model import WORLD, JointKind, Pair, Scene
from certifier.motion.search import search
from certifier.proof.container import with_scene
from certifier.proof.motion import Motion, Space
from certifier.verify.file import verify_file
from certifier.verify.scene import check_scene
from tests.certifier.scenes import ball, planar_arm
from tests.certifier.verify.condition_mutations import Parts, scene, valid
from tests.certifier.verify.condition_oracle import File, beyond, of_motion, untrue

LEAN, ROOM, CLEAR, SUM = 0, 2, 4, 5


def said(number: int, **fields: object) -> Callable[[Parts], None]:
    return lambda parts: parts.conditions[number].update(fields)


def inside_out(parts: Parts) -> None:
    faces = parts.conditions[ROOM]["faces"]
    faces[:] = [[-x for x in face] for face in faces]


def named_without_pairs(parts: Parts) -> None:
    parts.conditions.append({**parts.conditions[LEAN], "name": "more"})


def pairs_dropped(parts: Parts) -> None:
    parts.without_pair(next(i for i, pair in enumerate(parts.scene["pairs"]) if "conditions/lean/direction" in pair))


def padding_dropped(parts: Parts) -> None:
    parts.scene["pairs"] = [pair[:2] for pair in parts.scene["pairs"]]


RAW: dict[str, Callable[[Parts], None]] = {
    "a cone wider than what is proved": said(LEAN, angle=1.4),
    "a cone narrower than what is proved": said(LEAN, angle=1.2),
    "an angle of zero": said(LEAN, angle=0.0),
    "an axis of length zero": said(LEAN, axis=[0.0, 0.0, 0.0]),
    "a zone turned inside out": inside_out,
    "a zone without faces": said(ROOM, faces=[]),
    "a zone in another frame": said(ROOM, of="arm/link1"),
    "a larger distance": said(CLEAR, metres=1.35),
    "a distance whose padding is gone": padding_dropped,
    "a narrower range": said(SUM, upper=0.6),
    "a condition without pairs": named_without_pairs,
    "a condition whose pairs are gone": pairs_dropped,
}
AGAIN = {name: RAW[name] for name in ("a zone turned inside out", "a zone in another frame", "a condition without pairs")} | {
    "a cone that the proof is not about": said(LEAN, angle=1.1),
    "a distance that the proof is not about": said(CLEAR, metres=1.5),
    "a range that the proof is not about": said(SUM, upper=0.5),
}


def refusal(data: bytes) -> str:
    with pytest.raises(ProofError) as refused:
        verify_file(data)
    return refused.value.code


@pytest.mark.parametrize("kind", ["region", "motion"])
@pytest.mark.parametrize("what", RAW)
def test_what_stands_for_conditions_is_what_they_say(kind: str, what: str) -> None:
    parts = Parts(valid(kind)[-1])
    RAW[what](parts)
    assert refusal(parts.pack()) == "proof_model"


@pytest.mark.parametrize("kind", ["region", "motion"])
@pytest.mark.parametrize("what", AGAIN)
def test_what_stands_for_other_conditions_is_not_proved(kind: str, what: str) -> None:
    parts = Parts(valid(kind)[-1])
    AGAIN[what](parts)
    before = parts.header["scene"]
    parts.made_again()
    assert parts.header["scene"] is not before, "all of it makes sense but the proof"
    assert refusal(parts.pack()) in ("proof_cell", "proof_motion", "proof_malformed", "proof_pairs")


@pytest.mark.parametrize("number", [float("nan"), float("inf"), 1e101])
def test_numbers_that_are_none_are_refused(number: float) -> None:
    for change in (said(LEAN, angle=number), said(CLEAR, metres=number), said(LEAN, axis=[0.0, 0.0, number])):
        parts = Parts(valid("motion")[0])
        change(parts)
        assert refusal(parts.pack()) == "proof_malformed"


def three_links(zone_of: str, *more: Cone | Inside) -> Scene:
    arm = planar_arm(3)
    return with_conditions(arm, [Inside("first", (arm.geometries[0].name,), zone_of, ((1.0, 0.0, 0.0, 100.0),)), *more])


def test_a_geometry_on_what_stands_for_a_condition_is_refused() -> None:
    """The zone of one condition is welded to a far link. Its joints were not counted in what such a geometry reaches."""
    first = three_links("arm/link3")
    tip = ball("arm/tip", "conditions/first/zone", 0.1)
    hung = replace(without_conditions(first), geometries=(*planar_arm(3).geometries, tip))
    forged = with_conditions(hung, [*first.conditions, Inside("second", (tip.name,), "arm/link1", ((1.0, 0.0, 0.0, 1.2),))])
    with pytest.raises(ProofError, match="hangs on what stands for a condition"):
        check_scene(forged)


def test_a_link_on_what_stands_for_a_condition_is_refused() -> None:
    scene = three_links(WORLD, Cone("second", "arm/link3", (1.0, 0.0, 0.0), WORLD, (1.0, 0.0, 0.0), 0.5))
    joints = tuple(replace(joint, parent="conditions/first/zone") if joint.name == "arm/joint2" else joint for joint in scene.joints)
    with pytest.raises(ProofError, match="hangs on what stands for a condition"):
        check_scene(replace(scene, joints=joints))


def test_a_distance_cannot_smuggle_words_into_a_statement() -> None:
    """A mesh is named by its parts' shapes, which may say anything."""
    arm = planar_arm(1)
    words = "x' stay at least 99 m apart\ncondition 'other': 'y"
    bar, obstacle = arm.geometries
    named = replace(arm, geometries=(replace(bar, shape={"kind": "box", "of": words}), obstacle))
    with pytest.raises(SceneError, match="has to name two bodies or geometries"):
        with_conditions(named, [Distance("d", words, obstacle.name, 0.1)])


def test_a_range_many_turns_away_is_refused_because_statements_round_by_parts() -> None:
    lower = np.radians(57295700.5 - 3e-6)
    with pytest.raises(SceneError, match="within 3600 degrees of 0"):
        with_conditions(planar_arm(1), [Range("r", (("arm/joint1", 1),), lower, lower + np.pi)])


def test_a_tube_beyond_the_limits_of_a_slide_leaves_a_zone() -> None:
    """Nothing stands for a face that no geometry reaches within the limits, and tubes go beyond them."""
    arm = planar_arm(1, ball("world/post", WORLD, 0.1, (0.0, 30.0, 0.0)), kind=JointKind.PRISMATIC, limit=0.01)
    slide = replace(arm.joints[0], axis=np.array([1.0, 0.0, 0.0]))
    tip = ball("arm/link1/tip", "arm/link1", 0.1)
    arm = replace(arm, joints=(slide,), geometries=(tip, arm.geometries[1]), pairs=(Pair(tip.name, "world/post"),))
    zoned = with_conditions(arm, [Inside("zone", (tip.name,), WORLD, ((1.0, 0.0, 0.0, 0.15),))])
    proof = search(zoned, Motion(Space.Q, np.array([[-0.005], [0.005]])), True).proof
    assert proof is not None
    assert proof.rho > 0.05
    data = with_scene(proof.to_bytes(), zoned)
    lines = verify_file(data).lines
    assert untrue(data, "motion", lines) is None
    (line,) = [line.removeprefix("condition 'zone': ") for line in lines if "'zone'" in line]
    everywhere, bodies = line.removesuffix(", at configurations within the joint limits"), of_motion(File.of(data))
    assert everywhere != line
    assert beyond(everywhere, bodies).max() > 0
    assert beyond(line, bodies).max() < 0


def test_more_conditions_than_are_checked_are_refused() -> None:
    arm, tip = without_conditions(scene()), scene().geometries[0].name
    with pytest.raises(SceneError, match=f"{MOST_CONDITIONS} at most"):
        with_conditions(arm, [Distance(f"d{i}", tip, "world/post", 0.1) for i in range(MOST_CONDITIONS + 1)])
    with pytest.raises(SceneError, match=f"{MOST_IN_ZONES} at most"):
        with_conditions(arm, [Inside("zone", (tip,) * (MOST_IN_ZONES + 1), WORLD, ((1.0, 0.0, 0.0, 1.0),))])
