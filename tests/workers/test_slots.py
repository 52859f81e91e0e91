"""The slots of a solve worker: as many processes have one as there are, and one that is killed leaves its own."""

from __future__ import annotations

import os
from collections.abc import Iterator
from multiprocessing import Pipe
from multiprocessing.connection import Connection

import pytest

from certifier.orphans import die_with_parent
from tests.workers.service import eventually
from workers.slots import Slots


class Forked:
    """A process that takes and leaves slots when the test asks for it."""

    def __init__(self, slots: Slots) -> None:
        parent = os.getpid()
        self._connection, theirs = Pipe()
        self.pid = os.fork()
        if self.pid == 0:
            die_with_parent(parent=parent)
            _listen(slots, theirs)

    def does(self, what: str) -> bool:
        """Says whether the process has a slot after it was told to take one, to begin a block, or to end it."""
        self._connection.send(what)
        return bool(self._connection.recv())

    def kill(self) -> None:
        os.kill(self.pid, 9)
        os.waitpid(self.pid, 0)


def _listen(slots: Slots, connection: Connection) -> None:
    block = slots.one()
    while True:
        what = connection.recv()
        if what == "begin":
            connection.send(block.__enter__())
        elif what == "end":
            block.__exit__(None, None, None)
            block = slots.one()
            connection.send(False)
        else:
            connection.send(slots.take())


@pytest.fixture
def processes() -> Iterator[list[Forked]]:
    slots = Slots(2)
    forked = [Forked(slots) for _ in range(3)]
    yield forked
    for process in forked:
        process.kill()


def test_as_many_processes_have_a_slot_as_there_are(processes: list[Forked]) -> None:
    first, second, third = processes
    assert [process.does("begin") for process in processes] == [True, True, False]
    assert first.does("take"), "a process has one slot, and keeps it"
    assert not third.does("take")
    second.does("end")
    assert third.does("take"), "a block takes a slot that is free later"
    assert not second.does("begin")
    second.does("end")
    third.does("end")
    assert second.does("begin"), "the block has left it"


def test_who_is_killed_leaves_its_slot(processes: list[Forked]) -> None:
    assert [process.does("begin") for process in processes] == [True, True, False]
    processes.pop(0).kill()
    eventually(lambda: processes[-1].does("take"), "what the killed process had is free", 10)
