"""The hooks before a commit run what ./check runs before the tests, and fetch nothing."""

import re
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]


def test_the_hooks_run_what_check_runs_first() -> None:
    (local,) = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))["repos"]
    runs = re.findall(r"^ +run (\w+) (.+)$", (ROOT / "check").read_text(encoding="utf-8"), re.MULTILINE)
    assert local["repo"] == "local"
    assert [(hook["name"], hook["entry"].removeprefix(".venv/bin/")) for hook in local["hooks"]] == [
        run for run in runs if run[0] not in ("database", "kernels", "tests")
    ]
    assert all(hook["entry"].startswith(".venv/bin/") and hook["language"] == "system" for hook in local["hooks"])
