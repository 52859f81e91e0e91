"""A client is generated from the OpenAPI document, without a warning, and works on a real service."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from fastapi.testclient import TestClient

from certifier.scene.bundle import pack_bundle

ROOT = Path(__file__).parents[2]


def test_a_generated_client_submits_follows_and_fetches(client: TestClient, url: str, worker: None, tmp_path: Path) -> None:
    document = tmp_path / "openapi.json"
    document.write_text(json.dumps(client.get("/openapi.json").json()))
    generator = [sys.executable, "-m", "openapi_python_client", "generate", "--path", str(document), "--meta", "none", "--fail-on-warning"]
    made = subprocess.run([*generator, "--output-path", str(tmp_path / "ciris_client")], capture_output=True, text=True)
    assert made.returncode == 0, made.stdout + made.stderr
    assert "arning" not in made.stdout + made.stderr
    scene = tmp_path / "scene.zip"
    scene.write_bytes(pack_bundle(ROOT / "examples" / "planar_2dof" / "scene.yaml"))
    using = [sys.executable, str(Path(__file__).with_name("generated.py")), str(tmp_path), url, str(scene)]
    used = subprocess.run(using, capture_output=True, text=True)
    assert used.returncode == 0, used.stderr
    (region,) = used.stdout.split()
    assert client.get(f"/v1/regions/{region}").status_code == 200
