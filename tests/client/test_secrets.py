"""A guarded service as its users see it: keys from the command line, everything that takes a secret, and nothing of it in any log."""

from __future__ import annotations

import base64
import json
import signal
import subprocess
from pathlib import Path
from typing import Any

import httpx2
import pytest

from tests.client.conftest import PLANAR, Done, command, surroundings
from tests.services import Postgres
from tests.workers.service import eventually

PASSWORD = "pa55w0rdOfTheDatabase"
WEBHOOK_SECRET = "whsec_" + base64.b64encode(b"the secret of the webhook, truly").decode()
GUESS = "ciris_0123456789ab_" + "guess" * 8 + "abc"


@pytest.fixture
def machine(tmp_path: Path, postgres: Postgres, migrated_postgres: str) -> dict[str, str]:
    """The environment of a service whose database has a password."""
    url = postgres.new_database(migrated_postgres).replace("postgres@", f"postgres:{PASSWORD}@")
    return surroundings(
        CIRIS_DATA_DIR=str(tmp_path / "data"),
        CIRIS_DATABASE_URL=url,
        CIRIS_HOST="0.0.0.0",
        CIRIS_SOLVE_PROCESSES="1",
        CIRIS_SWEEP_SECONDS="0.5",
        CIRIS_WEBHOOK_HOSTS="127.0.0.1:9",
    )


def run(machine: dict[str, str], *arguments: object, **variables: str) -> Done:
    done = subprocess.run(command(*arguments), env={**machine, **variables}, capture_output=True, timeout=120, check=False)
    return Done(done.returncode, done.stdout, done.stderr.decode())


@pytest.mark.slow
def test_no_secret_is_in_any_log(machine: dict[str, str], tmp_path: Path) -> None:
    refused = run(machine, "up", "--port", "0")
    assert (refused.status, "no API key has been made" in refused.stderr) == (2, True)
    admin = run(machine, "key", "add", "admin", "--scope", "admin").stdout.strip()
    reader = run(machine, "key", "add", "reader", "--scope", "read").stdout.strip()

    with (tmp_path / "up.log").open("wb") as log:
        stack = subprocess.Popen(command("up", "--port", "0"), env=machine, stdout=log, stderr=log)
    try:
        eventually(lambda: b"ciris is up" in (tmp_path / "up.log").read_bytes(), "the service is up")
        use(machine, admin, reader, tmp_path)
    finally:
        stack.send_signal(signal.SIGINT)
        assert stack.wait(30) == 0

    said = (tmp_path / "up.log").read_text() + "".join(path.read_text() for path in (tmp_path / "data" / "logs").glob("*.log"))
    for secret in (admin, reader, GUESS, WEBHOOK_SECRET):
        assert secret not in said
        assert secret.split("_", 2)[-1] not in said
    assert PASSWORD not in said
    lines = [json.loads(line) for log in (tmp_path / "data" / "logs").glob("api*.log") for line in log.read_text().splitlines()]
    requests = [line for line in lines if line["message"] == "request"]
    assert {line["key"] for line in requests} == {None, admin.split("_")[1], reader.split("_")[1]}
    assert {line["status"] for line in requests} >= {200, 201, 401, 403, 422}
    control = [json.loads(line) for line in (tmp_path / "data" / "logs" / "control.log").read_text().splitlines() if line.startswith("{")]
    assert any("webhook" in line and line["job"] for line in control), "lines say which job they are about"


def use(machine: dict[str, str], admin: str, reader: str, directory: Path) -> None:
    """Every way in which a secret enters the service, rightly and wrongly."""
    (directory / "key").write_text(admin + "\n")
    added = run(machine, "scene", "add", PLANAR, "--json", CIRIS_API_KEY_FILE=str(directory / "key"))
    assert added.status == 0, added.stderr
    assert run(machine, "scene", "add", PLANAR, CIRIS_API_KEY=reader).status == 2
    url = json.loads((directory / "data" / "stack.json").read_text())["url"]
    box = {"C": [[1, 0], [-1, 0], [0, 1], [0, -1]], "d": [0.01] * 4}
    body: dict[str, Any] = {"kind": "certify", "scene": added.json["id"], "polytope": box}
    hook = {"url": "http://127.0.0.1:9/nobody-listens", "secret": WEBHOOK_SECRET}
    with httpx2.Client(base_url=url, trust_env=False, timeout=60, headers={"Authorization": f"Bearer {admin}"}) as http:
        job = http.post("/v1/jobs", json=body | {"webhook": hook}).json()
        assert http.post("/v1/jobs", json=body | {"webhook": hook | {"secret": WEBHOOK_SECRET + "A"}}).status_code == 422
        assert http.post("/v1/jobs", json=body | {"scene": WEBHOOK_SECRET}).status_code == 404
        assert http.get("/v1/jobs", headers={"Authorization": f"Bearer {GUESS}"}).status_code == 401
        assert http.get(f"/v1/jobs/{GUESS}").status_code == 404
        assert http.get("/v1/jobs", params={"after": GUESS}).status_code == 422
        assert http.post("/login", data={"key": GUESS}).status_code == 401
        assert http.post("/login", data={"key": reader}).status_code == 303
        eventually(lambda: http.get(f"/v1/jobs/{job['id']}").json()["ended"], "the job ends")
        eventually(lambda: http.get(f"/v1/jobs/{job['id']}/webhook").json()["error"], "the webhook is tried")
