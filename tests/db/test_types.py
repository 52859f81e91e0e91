"""Arrays are read from the database by one thread at a time, because Python 3.11 fails where two read headers of arrays."""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from threading import Lock
from typing import Any

import numpy as np
import pytest
from sqlalchemy.dialects import sqlite

from db.types import Npz

DIALECT = sqlite.dialect()


def test_arrays_are_read_by_one_thread_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    stored = Npz().process_bind_param({"C": np.eye(3)}, DIALECT)
    load, alone, together = np.load, Lock(), []

    def slow(*arguments: Any, **more: Any) -> Any:
        together.append(not alone.acquire(blocking=False))
        time.sleep(0.02)
        if not together[-1]:
            alone.release()
        return load(*arguments, **more)

    monkeypatch.setattr(np, "load", slow)
    with ThreadPoolExecutor(4) as threads:
        found = list(threads.map(lambda _: Npz().process_result_value(stored, DIALECT), range(8)))
    assert len(together) == 8
    assert not any(together)
    assert all(arrays is not None and (arrays["C"] == np.eye(3)).all() for arrays in found)
