"""Counts and joint positions in sentences."""

from certifier.words import counted, joint_positions, unit_names, with_units


def test_one_of_a_thing_is_singular() -> None:
    assert [counted(n, "pair") for n in (0, 1, 2)] == ["0 pairs", "1 pair", "2 pairs"]
    assert [counted(n, "geometry", "geometries") for n in (1, 2)] == ["1 geometry", "2 geometries"]


def test_a_configuration_names_its_units() -> None:
    assert joint_positions([0.4, -1 / 3], ["rad", "rad"]) == "(0.4, -0.333333) rad"
    assert joint_positions([0.4, 0.25], ["rad", "m"]) == "(0.4 rad, 0.25 m)"
    assert joint_positions([-0.0, 1 / 3], ["m", "m"], digits=3) == "(0, 0.333) m"
    assert with_units(["1.50"], ["m"]) == "(1.50) m"
    assert [unit_names(units) for units in (["rad", "rad"], ["m"], ["m", "rad", "m"])] == ["rad", "m", "rad and m"]
