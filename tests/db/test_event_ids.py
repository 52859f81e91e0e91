"""Ids of events as a project's people see them."""

from __future__ import annotations

import secrets

import pytest
from hypothesis import given
from hypothesis import strategies as st

from db import event_ids, projects
from db.event_ids import MOST, EventIds
from db.session import Database


@given(st.integers(0, MOST), st.binary(min_size=16, max_size=16))
def test_a_number_means_the_id_that_it_was_made_of(id: int, key: bytes) -> None:
    ids = EventIds(key)
    assert 0 <= ids.shown(id) <= MOST
    assert ids.meant(ids.shown(id)) == id
    assert ids.shown(ids.meant(id)) == id


def test_ids_that_follow_each_other_do_not_look_so() -> None:
    """Neither of one key nor of two: half of the bits of any two differ, on average."""
    ids, others = EventIds(secrets.token_bytes(16)), EventIds(secrets.token_bytes(16))
    follow = [(ids.shown(id) ^ ids.shown(id + 1)).bit_count() for id in range(1, 2000)]
    apart = [(ids.shown(id) ^ others.shown(id)).bit_count() for id in range(1, 2000)]
    for found in (follow, apart):
        assert sum(found) / len(found) == pytest.approx(MOST.bit_length() / 2, abs=1)


def test_each_project_has_a_key_of_its_own(db: Database) -> None:
    with db.write() as session:
        projects.add(session, "others")
    shown = set()
    for name in ("default", "others"):
        with db.of(name).read() as session:
            shown |= {event_ids.of_project(session).shown(1)}
    assert len(shown) == 2
