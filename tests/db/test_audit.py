"""The audit log keeps its lines for a while."""

from __future__ import annotations

from datetime import timedelta

import pytest
from sqlalchemy import update

from db import audit
from db.audit import KEPT_DAYS, Action
from db.models import DEFAULT_PROJECT, AuditRow
from db.session import Database
from db.types import utcnow


def test_old_lines_are_forgotten_and_others_stay(db: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(audit, "TOGETHER", 2)
    now = utcnow()
    for days in (0, KEPT_DAYS - 1, KEPT_DAYS + 1, KEPT_DAYS + 2, KEPT_DAYS + 3):
        with db.write() as session:
            audit.note(session, DEFAULT_PROJECT, "me", Action.KEY_MADE, str(days))
            session.flush()
            session.execute(update(AuditRow).where(AuditRow.what == str(days)).values(created_at=now - timedelta(days=days)))
    kept = []
    for _ in range(3):
        with db.write() as session:
            if audit.forgettable(session, now):
                audit.forget(session, now)
        with db.read() as session:
            kept.append([row.what for row in audit.page(session).rows])
    assert [len(lines) for lines in kept] == [3, 2, 2]
    assert kept[-1] == ["0", str(KEPT_DAYS - 1)]
