"""Secrets are encrypted with a key that is not in the database, and keys can be changed."""

from __future__ import annotations

import base64
import stat
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from certifier.errors import CirisError
from db.vault import Vault, is_sealed, kept_key

OLD, NEW = (base64.b64encode(bytes([i]) * 32).decode() for i in (1, 2))
URL = "https://planner.example.org/ciris"


@given(secret=st.text(max_size=200), about=st.text(max_size=50))
def test_a_secret_comes_back_and_is_not_to_be_seen(secret: str, about: str) -> None:
    sealed = Vault(OLD).seal(secret, about)
    assert Vault(OLD).open(sealed, about) == secret
    assert is_sealed(sealed)
    assert len(secret) < 4 or secret not in sealed


def test_the_same_secret_never_looks_the_same() -> None:
    assert len({Vault(OLD).seal("whsec_x", URL) for _ in range(10)}) == 10


def test_keys_are_changed_by_putting_the_new_one_first() -> None:
    sealed = Vault(OLD).seal("whsec_x", URL)
    assert Vault(f"{NEW}, {OLD}").open(sealed, URL) == "whsec_x"
    renewed = Vault(f"{NEW},{OLD}").seal("whsec_x", URL)
    assert Vault(NEW).open(renewed, URL) == "whsec_x"
    for vault in (Vault(NEW), Vault("")):
        with pytest.raises(CirisError, match="no key fits") as refused:
            vault.open(sealed, URL)
        assert refused.value.code == "secret_lost"


def test_a_secret_cannot_be_moved_to_another_receiver() -> None:
    sealed = Vault(OLD).seal("whsec_x", URL)
    with pytest.raises(CirisError, match="no key fits"):
        Vault(OLD).open(sealed, "https://elsewhere.example.org/")


def test_a_changed_secret_is_none() -> None:
    sealed = Vault(OLD).seal("whsec_x", URL)
    for place in range(3, len(sealed) - 4, 7):
        other = sealed[:place] + ("A" if sealed[place] != "A" else "B") + sealed[place + 1 :]
        with pytest.raises(CirisError, match="no key fits"):
            Vault(OLD).open(other, URL)


def test_what_an_earlier_version_stored_is_read_as_it_is() -> None:
    assert Vault("").open("whsec_plain", URL) == "whsec_plain"


@pytest.mark.parametrize("wrong", ["short", "x" * 44, base64.b64encode(bytes(16)).decode(), f"{OLD},short"])
def test_what_is_no_key_is_refused(wrong: str) -> None:
    with pytest.raises(CirisError, match="not the base64 of 32 bytes"):
        Vault(wrong)


def test_an_empty_file_that_a_full_disk_has_left_gets_a_key(tmp_path: Path) -> None:
    path = tmp_path / "secret.key"
    path.touch(mode=0o600)
    assert Vault(kept_key(path)).usable


def test_a_kept_key_is_made_once_and_read_by_its_owner_alone(tmp_path: Path) -> None:
    path = tmp_path / "secret.key"
    key = kept_key(path)
    assert kept_key(path) == key
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert Vault(key).open(Vault(key).seal("x", "y"), "y") == "x"
    assert list(tmp_path.iterdir()) == [path]
    urlsafe = key.replace("+", "-").replace("/", "_")
    assert Vault(urlsafe).open(Vault(key).seal("x", "y"), "y") == "x"
