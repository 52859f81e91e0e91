"""A name means the scene before until the staged one is promoted, and at every moment one of the two."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import pytest
from sqlalchemy.orm import Session

from certifier.errors import CirisError
from db import jobs, projects, regions, retention, scenes, staging
from db.session import Database
from tests.db.builders import a_scene, add_region
from tests.scenes import slider

NAME, STAGED = "slider", "slider@staged"


def with_region(session: Session, scene_id: str) -> None:
    job, _ = jobs.create(session, kind="grow", scene_id=scene_id, options={})
    jobs.start(session, job)
    add_region(session, job)
    jobs.finish(session, job, jobs.JobState.SUCCEEDED, outcome="certified", reason="done")


def staged(db: Database, posts: int) -> str:
    with db.write() as session:
        return staging.stage(session, NAME, slider("other", posts)).id


def found(db: Database, name: str) -> str:
    with db.read() as session:
        return scenes.find(session, name)


@pytest.fixture
def present(db: Database) -> str:
    """The scene that the name means; it has a region."""
    with db.write() as session:
        row = a_scene(session, NAME)
        with_region(session, row.id)
        return row.id


def test_a_staged_scene_gets_its_name_when_it_is_promoted(db: Database, present: str) -> None:
    new = staged(db, 3)
    assert (found(db, NAME), found(db, STAGED)) == (present, new)
    with db.read() as session:
        assert scenes.names(session, [present, new]) == {present: [NAME], new: [STAGED]}
        assert (scenes.get(session, new).name, scenes.get(session, new).document["name"]) == (NAME, NAME), "the file's name does not count"
    with db.write() as session:
        with_region(session, new)
        done = staging.promote(session, NAME, without_regions=False)
    assert done == staging.Promotion(scene=new, regions=1, before=present, regions_before=1)
    assert found(db, NAME) == new
    with pytest.raises(CirisError, match="nothing is staged as the next version of 'slider'"):
        found(db, STAGED)
    with db.write() as session, pytest.raises(CirisError, match="nothing is staged"):
        staging.promote(session, NAME, without_regions=True)


def test_a_scene_without_regions_is_promoted_only_on_demand(db: Database, present: str) -> None:
    new = staged(db, 3)
    with pytest.raises(CirisError, match="has no regions, and slider has 1"), db.write() as session:
        staging.promote(session, NAME, without_regions=False)
    assert (found(db, NAME), found(db, STAGED)) == (present, new)
    with db.write() as session:
        assert staging.promote(session, NAME, without_regions=True).regions == 0
    staged(db, 1)
    with db.write() as session:
        assert staging.promote(session, NAME, without_regions=False).regions_before == 0, "the present one has none either"


def test_staging_replaces_what_was_staged_and_deleting_it_leaves_nothing_staged(db: Database, present: str) -> None:
    staged(db, 3)
    second = staged(db, 4)
    assert found(db, STAGED) == second
    with db.write() as session:
        retention.delete_scene(session, second, dependents=False)
    with pytest.raises(CirisError, match="nothing is staged"):
        found(db, STAGED)
    assert found(db, NAME) == present


def test_the_scene_before_is_staged_to_go_back(db: Database, present: str) -> None:
    new = staged(db, 3)
    with db.write() as session:
        staging.promote(session, NAME, without_regions=True)
    assert staged(db, 2) == present
    with db.write() as session:
        assert staging.promote(session, NAME, without_regions=False) == staging.Promotion(present, 1, new, 0)


def test_a_staged_scene_is_promoted_although_the_one_before_was_deleted(db: Database, present: str) -> None:
    new = staged(db, 3)
    with db.write() as session:
        retention.delete_scene(session, present, dependents=True)
        assert staging.promote(session, NAME, without_regions=False) == staging.Promotion(new, 0, None, 0)
    assert found(db, NAME) == new


def test_a_project_stages_and_promotes_its_own_names_only(db: Database, present: str) -> None:
    with db.write() as session:
        projects.add(session, "others")
    others = db.of("others")
    with others.write() as session, pytest.raises(CirisError, match="no scene has the name"):
        staging.stage(session, NAME, slider(NAME, 3))
    with others.write() as session:
        a_scene(session, NAME)
        theirs = staging.stage(session, NAME, slider(NAME, 3)).id
    mine, own = staged(db.of("default"), 4), db.of("default")
    with others.write() as session:
        assert staging.promote(session, NAME, without_regions=True).scene == theirs
    assert (found(own, NAME), found(own, STAGED), found(others, NAME)) == (present, mine, theirs)


def test_a_name_always_means_a_scene_with_regions(db: Database, present: str) -> None:
    """Readers ask all the time while one scene after another is staged, gets a region and is promoted."""
    done, wrong, asked = threading.Event(), [], []

    def read() -> None:
        while not done.is_set():
            with db.read() as session:
                scene_id = scenes.find(session, NAME)
                asked.append(scene_id)
                if not regions.counts(session, [scene_id])[scene_id]:
                    wrong.append(scene_id)

    readers = [threading.Thread(target=read) for _ in range(2)]
    for reader in readers:
        reader.start()
    promoted = [present]
    try:
        for posts in range(3, 9):
            promoted.append(staged(db, posts))
            with db.write() as session:
                with_region(session, promoted[-1])
            with db.write() as session:
                staging.promote(session, NAME, without_regions=False)
            until(lambda: asked[-1:] == promoted[-1:])
    finally:
        done.set()
        for reader in readers:
            reader.join()
    assert not wrong
    assert list(dict.fromkeys(asked)) == promoted


def until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)
