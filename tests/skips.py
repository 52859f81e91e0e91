"""Where CI is set no test may be skipped: a run that skipped one fails, and says which and why."""

from __future__ import annotations

import os

import pytest
from _pytest.terminal import TerminalReporter


def _skipped(config: pytest.Config) -> list[pytest.TestReport | pytest.CollectReport]:
    """What was skipped against the rule. Only the terminal of the process that was started counts: with pytest-xdist it hears of all."""
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    if not os.environ.get("CI") or hasattr(config, "workerinput") or reporter is None:
        return []
    return reporter.stats.get("skipped", [])


def pytest_sessionfinish(session: pytest.Session) -> None:
    if session.exitstatus == pytest.ExitCode.OK and _skipped(session.config):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: TerminalReporter, config: pytest.Config) -> None:
    if skipped := _skipped(config):
        terminalreporter.section("skipped, which fails a run where CI is set", red=True)
        for report in skipped:
            assert isinstance(report.longrepr, tuple)
            terminalreporter.line(f"{report.nodeid}: {report.longrepr[2]}")
