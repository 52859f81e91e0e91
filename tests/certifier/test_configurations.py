"""Names become joint positions only where every joint has exactly one. The oracle joins dicts."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from certifier.configurations import Q_STAR, SAME, is_configuration_name, is_known, positions
from certifier.errors import RegionError

JOINTS = ("arm/a", "arm/b", "arm/c")
CENTRE = (10.0, 20.0, 30.0)
KNOWN = {
    "arm/left/home": {"arm/a": 1.0},
    "arm/right/home": {"arm/b": 2.0},
    "arm/right/open": {"arm/c": 3.0, "arm/b": 2.0},
    "all": {"arm/a": 0.0, "arm/b": 0.0, "arm/c": 0.0},
    "left/home": {"arm/a": -1.0},
}
VALUES = st.sampled_from([0.0, 1.0, 2.0])
MANY = st.dictionaries(st.sampled_from(["p", "q", "r", "s"]), st.dictionaries(st.sampled_from(JOINTS), VALUES, min_size=1), min_size=1)


@given(MANY, st.data())
def test_every_joint_gets_the_one_position_that_is_said(known: dict[str, dict[str, float]], data: st.DataObject) -> None:
    names = data.draw(st.lists(st.sampled_from([*known, Q_STAR]), min_size=1, max_size=5))
    said = {joint: {known[name][joint] for name in names if joint in known.get(name, {})} for joint in JOINTS}
    expected = [min(said[joint], default=centre if Q_STAR in names else None) for joint, centre in zip(JOINTS, CENTRE, strict=True)]
    text = " , ".join(names)
    if any(len(values) > 1 for values in said.values()) or None in expected:
        with pytest.raises(RegionError) as refused:
            positions(text, known, JOINTS, CENTRE, "q[2]")
        assert (refused.value.code, refused.value.field) == ("configuration", "q[2]")
        assert any(joint in refused.value.message for joint in JOINTS)
    else:
        assert positions(text, known, JOINTS, CENTRE) == expected


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("all", [0.0, 0.0, 0.0]),
        ("open,left/home", [-1.0, 2.0, 3.0]),
        ("arm/left/home, right/open", [1.0, 2.0, 3.0]),
        ("q_star", [10.0, 20.0, 30.0]),
        ("q_star,open", [10.0, 2.0, 3.0]),
    ],
)
def test_the_last_parts_of_a_name_are_enough(text: str, found: list[float]) -> None:
    assert positions(text, KNOWN, JOINTS, CENTRE) == found
    assert is_known(text, KNOWN)


@pytest.mark.parametrize(
    ("text", "code", "words"),
    [
        ("home", "unknown_configuration", "arm/left/home or arm/right/home or left/home"),
        ("hone", "unknown_configuration", "did you mean"),
        ("en", "unknown_configuration", "no configuration 'en'"),
        ("", "unknown_configuration", "no configuration ''"),
        ("all,", "unknown_configuration", "no configuration ''"),
        ("all,open", "configuration", "'all' has joint arm/c at 0, and 'open' at 3"),
        ("open", "configuration", "'open' does not say where arm/a is"),
        ("left/home", "configuration", "does not say where arm/b, arm/c are"),
    ],
)
def test_what_names_do_not_say_is_refused(text: str, code: str, words: str) -> None:
    with pytest.raises(RegionError) as refused:
        positions(text, KNOWN, JOINTS, CENTRE, "--q")
    assert refused.value.code == code
    assert words in f"{refused.value.message} {refused.value.hint}"
    assert refused.value.hint


def test_names_that_agree_but_for_rounding_are_joined() -> None:
    for off, agree in ((SAME / 2, True), (2 * SAME, False)):
        known = {"x": {"arm/a": 1.0}, "y": {"arm/a": 1.0 + off}}
        if agree:
            assert positions("x,y", known, JOINTS[:1], CENTRE[:1]) == [1.0]
        else:
            with pytest.raises(RegionError, match="has joint arm/a at"):
                positions("x,y", known, JOINTS[:1], CENTRE[:1])


@pytest.mark.parametrize(
    ("name", "fine"),
    [
        *(("home", True), ("hold-up", True), ("2nd pose", True)),
        *((name, False) for name in ("a,b", "1", "1e3", "nan", "inf", "-.5", "q_star", "", 3, "a\nb")),
    ],
)
def test_a_name_is_no_number_and_has_no_comma(name: object, fine: bool) -> None:
    assert is_configuration_name(name) == fine
