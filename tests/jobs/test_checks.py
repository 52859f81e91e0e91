"""What is said of joint positions that do not fit the scene."""

import re

import pytest

from certifier.errors import RegionError
from jobs.checks import blocked, check_length
from tests.certifier.scenes import planar_arm
from tests.scenes import slider


def test_what_is_counted_is_one_or_many() -> None:
    for scene, values, said in (
        (planar_arm(2), [0.0], "1 number was given; the scene has 2 joints"),
        (slider(), [0.0, 0.1], "2 numbers were given; the scene has 1 joint"),
    ):
        with pytest.raises(RegionError) as error:
            check_length(scene, values, "seed.q", "seed_wrong_length")
        assert error.value.message == said


def test_where_something_touches_is_said_with_its_unit() -> None:
    (said,) = blocked(planar_arm(2), {"seed.q": [0.0, 0.0], "seed.contain[0]": [0.6, 0.0]})
    assert re.search(r" at q = \(0\.\d+, 0\) rad, as computed", said)
