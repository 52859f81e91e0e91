"""Schemathesis against the OpenAPI document: whatever it thinks up, no answer is the service's fault or differs from what is documented."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from certifier.model import Scene
from db import keys
from db.keys import Scope
from db.session import Database

SECONDS = 120
EXAMPLES = 30
BEYOND_SCHEMAS = "positive_data_acceptance,allow_header_conformance"
"""What no schema can say (seeds fit the scene, a zip is a bundle), and a header that the framework fills in for each function."""


@pytest.fixture
def unlimited(environment: pytest.MonkeyPatch) -> None:
    environment.setenv("CIRIS_REQUESTS_PER_SECOND", "1000000")


@pytest.mark.slow
def test_nothing_that_fits_the_document_or_nearly_breaks_the_service(
    unlimited: None, url: str, database: Database, scene: Scene, region: str, tmp_path: Path
) -> None:
    with database.write() as session:
        key = keys.add(session, "schemathesis", Scope.ADMIN)
    names = {"path.scene_id": scene.hash[:16], "path.region_id": region}
    (tmp_path / "schemathesis.toml").write_text("[parameters]\n" + "".join(f'"{name}" = "{value}"\n' for name, value in names.items()))
    options = ["--checks=all", f"--exclude-checks={BEYOND_SCHEMAS}", f"--max-time={SECONDS}", f"-n{EXAMPLES}", "--no-color"]
    command = [sys.executable, "-m", "schemathesis.cli", "run", f"{url}/openapi.json", "-H", f"Authorization: Bearer {key}", *options]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    print(done.stdout[done.stdout.rindex("SUMMARY") :])
    assert done.returncode == 0, done.stdout
    tested = re.search(r"Selected: (\d+)/(\d+)\s+Tested: (\d+)", done.stdout)
    assert tested
    assert len(set(tested.groups())) == 1, "every operation is tested"
