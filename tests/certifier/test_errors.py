"""What an error says is as short as people can read, whatever a user has given."""

from __future__ import annotations

import pytest

from certifier.errors import LONGEST, CirisError
from certifier.scene.conditions import read_conditions


def test_long_names_do_not_travel_whole() -> None:
    with pytest.raises(CirisError) as caught:
        read_conditions([{"name": "x" * 100_000}])
    said = caught.value
    assert all(len(part) <= LONGEST for part in (said.message, said.field or "", said.hint))
    assert said.message.endswith("x'"), "the end is kept"
    assert str(CirisError("x", "short", field="f", hint="h")) == "f: short (h)"
