"""The production shape: the services it must have, and that it speaks of commands and settings that exist."""

import re
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml

from client.arguments import parser
from db import traces
from db.settings import Settings
from tests.rooms import ROOMS

ROOT = Path(__file__).parents[2]
SERVICES = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]
OURS = ["migrate", "api", "control", "solve"]


def test_the_services() -> None:
    assert set(SERVICES) == {"postgres", "valkey", *OURS}
    for name in ("postgres", "valkey", "api", "control", "solve"):
        assert "healthcheck" in SERVICES[name]
    for name in ("api", "control", "solve"):
        assert SERVICES[name]["depends_on"] == {
            "migrate": {"condition": "service_completed_successfully"},
            "valkey": {"condition": "service_healthy"},
        }
    assert SERVICES["migrate"]["depends_on"] == {"postgres": {"condition": "service_healthy"}}


def test_the_commands_exist() -> None:
    ciris, *words = SERVICES["migrate"]["command"]
    assert (ciris, parser().parse_args(words).module) == ("ciris", "db.commands")
    for name in OURS[1:]:
        python, option, module, *_ = SERVICES[name]["command"]
        assert (python, option) == ("python", "-m")
        spec = find_spec(module)
        assert spec is not None
        assert not spec.submodule_search_locations or find_spec(f"{module}.__main__") is not None


def test_the_settings_exist() -> None:
    names = {f"CIRIS_{name.upper()}" for name in Settings.model_fields} | set(traces.ENDPOINTS)
    assert {name for service in OURS for name in SERVICES[service]["environment"]} <= names


def test_settings_of_an_operator_come_from_the_file_and_have_the_programs_defaults(monkeypatch: pytest.MonkeyPatch) -> None:
    given = SERVICES["api"]["environment"]
    for name in ("CIRIS_TRUSTED_PROXIES", "CIRIS_WEBHOOK_HOSTS", "CIRIS_REQUESTS_PER_SECOND"):
        assert given[name] == SERVICES["control"]["environment"][name]
        default = re.fullmatch(rf"\$\{{{name}:?-(.*)\}}", given[name])
        assert default
        field = name.removeprefix("CIRIS_").lower()
        monkeypatch.delenv(name, raising=False)
        expected = getattr(Settings(), field)
        monkeypatch.setenv(name, default[1])
        found = getattr(Settings(), field)
        assert set(expected) <= set(found) if name == "CIRIS_TRUSTED_PROXIES" else expected == found
    assert given["CIRIS_TRUSTED_PROXIES"].startswith("${CIRIS_TRUSTED_PROXIES-"), "an empty one means nobody"


def test_no_secret_has_a_default() -> None:
    text = (ROOT / "docker-compose.yml").read_text()
    secrets = re.findall(r"\$\{(\w*(?:PASSWORD|SECRET|KEY)\w*)(:.)?", text)
    assert secrets
    # Without an identity provider there is none of this.
    assert {operator for name, operator in secrets if name != "CIRIS_OIDC_CLIENT_SECRET"} == {":?"}, (
        "compose refuses to start without it, and says so"
    )


def test_no_container_is_the_only_one_of_its_kind() -> None:
    """Fixed names and host ports would keep ``--scale`` from starting a second one."""
    for name in ("control", "solve"):
        assert not {"container_name", "ports"} & set(SERVICES[name])


def test_nothing_is_published_beyond_this_machine() -> None:
    ports = [port for service in SERVICES.values() for port in service.get("ports", [])]
    assert len(ports) == 1
    assert ports[0].startswith("127.0.0.1:")


def test_the_image_copies_every_package() -> None:
    dockerfile, ignored = (ROOT / "Dockerfile").read_text(), (ROOT / ".dockerignore").read_text().split()
    for room in ROOMS:
        assert f"COPY {room} {room}\n" in dockerfile
        assert f"!{room}" in ignored


def test_every_container_is_contained_and_its_log_ends() -> None:
    for name, service in SERVICES.items():
        assert service["read_only"] is True, name
        assert service["cap_drop"] == ["ALL"], name
        assert service["security_opt"] == ["no-new-privileges:true"], name
        assert service["logging"]["driver"] == "json-file"
        assert set(service["logging"]["options"]) == {"max-size", "max-file"}
        assert not {"privileged", "cap_add"} & set(service)
    for name in (*OURS, "postgres"):
        assert "/tmp" in SERVICES[name]["tmpfs"], "the only place to write to, besides volumes"


def test_nobody_is_root() -> None:
    assert {name: SERVICES[name]["user"] for name in ("postgres", "valkey")} == {"postgres": "postgres", "valkey": "valkey"}
    assert re.search(r"^RUN useradd .*--uid (\d+) ciris\n(?:.*\n)*USER \1$", (ROOT / "Dockerfile").read_text(), re.MULTILINE)


def test_images_of_others_are_named_by_digest() -> None:
    images = [SERVICES[name]["image"] for name in ("postgres", "valkey")]
    images += re.findall(r"^FROM (\S+)", (ROOT / "Dockerfile").read_text(), re.MULTILINE)
    assert len(images) == 4
    assert all(re.search(r":[\w.-]+@sha256:[0-9a-f]{64}$", image) for image in images)
