"""The manifests for Kubernetes: they fit its schemas, nothing in them is privileged, and they speak of what exists."""

from __future__ import annotations

import os
import re
import subprocess
import tempfile
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import kubernetes_validate
import pytest
import redis
import yaml

from certifier.orphans import die_with_parent
from db.settings import SPARE, Settings
from tests.workers.service import eventually
from workers.processes import queue_server_command

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "deploy" / "kubernetes"
SCHEMAS = "1.37"
COMPOSE = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]
OURS = ["migrate", "api", "control", "solve"]


def documents() -> list[dict[str, Any]]:
    """Every manifest that kustomize is given."""
    listed = yaml.safe_load((FOLDER / "kustomization.yaml").read_text())["resources"]
    assert {*listed, "kustomization.yaml"} == {path.name for path in FOLDER.iterdir()}
    return [document for name in listed for document in yaml.safe_load_all((FOLDER / name).read_text())]


DOCUMENTS = documents()
PODS = {d["metadata"]["name"]: d["spec"]["template"] for d in DOCUMENTS if "template" in d.get("spec", {})}
CONTAINERS = {name: pod["spec"]["containers"][0] for name, pod in PODS.items()}


def texts(value: Any) -> Iterator[str]:
    if isinstance(value, dict):
        for part in value.values():
            yield from texts(part)
    elif isinstance(value, list):
        for part in value:
            yield from texts(part)
    else:
        yield str(value)


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda document: f"{document['kind']}-{document['metadata']['name']}")
def test_a_manifest_fits_its_schema(document: dict[str, Any]) -> None:
    kubernetes_validate.validate(document, SCHEMAS, strict=True)


def test_the_schemas_would_find_a_mistake() -> None:
    wrong = yaml.safe_load(yaml.safe_dump(next(d for d in DOCUMENTS if d["kind"] == "Deployment")))
    wrong["spec"]["template"]["spec"]["containers"][0]["readOnlyRootFilesystem"] = True
    with pytest.raises(kubernetes_validate.ValidationError):
        kubernetes_validate.validate(wrong, SCHEMAS, strict=True)


def test_there_is_all_that_compose_runs() -> None:
    assert set(PODS) == set(COMPOSE)
    assert all(len(pod["spec"]["containers"]) == 1 and "initContainers" not in pod["spec"] for pod in PODS.values())


@pytest.mark.parametrize("name", PODS)
def test_nothing_is_privileged_and_everything_is_limited(name: str) -> None:
    pod, container = PODS[name]["spec"], CONTAINERS[name]
    assert pod["automountServiceAccountToken"] is pod["enableServiceLinks"] is False
    assert pod["securityContext"]["runAsNonRoot"] is True
    assert pod["securityContext"]["runAsUser"] > 0
    assert pod["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
    assert container["securityContext"] == {
        "allowPrivilegeEscalation": False,
        "readOnlyRootFilesystem": True,
        "capabilities": {"drop": ["ALL"]},
    }
    assert not {"hostNetwork", "hostPID", "hostIPC"} & set(pod)
    assert not any("hostPath" in volume for volume in pod.get("volumes", []))
    assert {"cpu", "memory"} <= set(container["resources"]["requests"])
    assert "memory" in container["resources"]["limits"]


def test_images_of_others_are_those_of_compose_by_digest() -> None:
    for name in ("postgres", "valkey"):
        assert CONTAINERS[name]["image"] == COMPOSE[name]["image"]
        assert re.search(r":[\w.-]+@sha256:[0-9a-f]{64}$", COMPOSE[name]["image"])
    assert {CONTAINERS[name]["image"] for name in OURS} == {"ciris"}, "kustomize puts the digest of the user's own there"


def test_the_commands_are_those_of_compose_and_keep_the_images_init() -> None:
    for name, container in CONTAINERS.items():
        assert "command" not in container, "it would take the place of tini"
        assert container["args"] == COMPOSE[name]["command"]
    assert 'ENTRYPOINT ["tini", "--", "ciris-entry"]' in (ROOT / "Dockerfile").read_text()
    assert all(find_spec(CONTAINERS[name]["args"][2]) for name in OURS[1:])


def test_the_user_is_that_of_the_image() -> None:
    assert "useradd --create-home --uid 10001 ciris" in (ROOT / "Dockerfile").read_text()
    assert {PODS[name]["spec"]["securityContext"]["runAsUser"] for name in OURS} == {10001}


def test_the_api_survives_a_node() -> None:
    """Its pods are on several nodes where there are some, and one that is drained takes one pod at a time."""
    labels = PODS["api"]["metadata"]["labels"]
    (apart,) = PODS["api"]["spec"]["affinity"]["podAntiAffinity"]["preferredDuringSchedulingIgnoredDuringExecution"]
    assert apart["podAffinityTerm"] == {"topologyKey": "kubernetes.io/hostname", "labelSelector": {"matchLabels": labels}}
    budget = next(d for d in DOCUMENTS if d["kind"] == "PodDisruptionBudget")["spec"]
    assert budget == {"maxUnavailable": 1, "selector": {"matchLabels": labels}}
    assert next(d for d in DOCUMENTS if d["kind"] == "Deployment" and d["metadata"]["name"] == "api")["spec"]["replicas"] == 2


def test_workers_end_by_sigquit_and_are_looked_after() -> None:
    for name in ("control", "solve"):
        container = CONTAINERS[name]
        assert container["lifecycle"]["preStop"]["exec"]["command"] == ["sh", "-c", "kill -s QUIT 1"]
        assert "$CIRIS_HEARTBEAT_FILE" in container["livenessProbe"]["exec"]["command"][2]
        assert PODS[name]["spec"]["terminationGracePeriodSeconds"] >= 30
    assert (CONTAINERS["api"]["readinessProbe"]["httpGet"]["path"], CONTAINERS["api"]["livenessProbe"]["httpGet"]["path"]) == (
        "/readyz",
        "/healthz",
    )


def test_nothing_but_the_api_can_be_reached_from_outside() -> None:
    policies = {d["metadata"]["name"]: d["spec"] for d in DOCUMENTS if d["kind"] == "NetworkPolicy"}
    assert set(policies) == {"nothing-else", "api", "postgres", "valkey"}
    assert policies.pop("nothing-else") == {"podSelector": {}, "policyTypes": ["Ingress"]}
    for name, policy in policies.items():
        assert policy["podSelector"] == {"matchLabels": PODS[name]["metadata"]["labels"]}
        (rule,) = policy["ingress"]
        assert [port["port"] for port in rule["ports"]] == [port["containerPort"] for port in CONTAINERS[name]["ports"]]
        if name == "api":
            assert "from" not in rule
            continue
        assert policy["policyTypes"] == ["Ingress", "Egress"]
        ((selector,),) = ([one["podSelector"]["matchExpressions"][0]] for one in rule["from"])
        url = {"postgres": "CIRIS_DATABASE_URL", "valkey": "CIRIS_REDIS_URL"}[name]
        users = [of for of in OURS if any(entry["name"] == url for entry in CONTAINERS[of]["env"])]
        assert (selector["key"], selector["operator"], selector["values"]) == ("app.kubernetes.io/name", "In", users)


def test_valkey_asks_for_its_password() -> None:
    """The command of the manifests, with the server of this machine."""
    *_, script = COMPOSE["valkey"]["command"]
    with tempfile.TemporaryDirectory(prefix="cv-", dir="/tmp") as directory:
        here = Path(directory)
        (server,) = queue_server_command(here / "q")[:1]
        script = script.replace("$$", "$").replace("/tmp/", f"{here}/").replace("valkey-server /", f"{server} /")
        script += f" --port 0 --unixsocket {here}/q --dir {here}"
        environment = {**os.environ, "VALKEY_PASSWORD": "sesame"}
        process = subprocess.Popen(["sh", "-c", script], env=environment, stdout=subprocess.DEVNULL, preexec_fn=die_with_parent)
        try:
            eventually((here / "q").exists, "the server runs", 30)
            assert redis.Redis(unix_socket_path=str(here / "q"), password="sesame").ping()
            with pytest.raises(redis.AuthenticationError):
                redis.Redis(unix_socket_path=str(here / "q")).ping()
        finally:
            process.terminate()
            process.wait()
    assert not process.returncode, "the shell has become the server, which ends when it is asked to"


def test_a_scaler_may_set_the_number_of_solve_workers() -> None:
    solve = next(d for d in DOCUMENTS if d["metadata"]["name"] == "solve")
    assert "replicas" not in solve["spec"]
    assert CONTAINERS["solve"]["resources"]["limits"]["cpu"] == "2", "the number of its processes"


def test_settings_exist_and_secrets_are_referred_to() -> None:
    config = next(d for d in DOCUMENTS if d["kind"] == "ConfigMap")["data"]
    named = set(config) | {entry["name"] for name in OURS for entry in CONTAINERS[name]["env"]}
    assert {name for name in named if name.startswith("CIRIS_")} <= {f"CIRIS_{name.upper()}" for name in Settings.model_fields}
    assert "CIRIS_TRUSTED_PROXIES" in config, "without the Ingress in it, all callers without a key have one budget"
    limits = CONTAINERS["solve"]["resources"]["limits"]
    part = int(limits["memory"].removesuffix("Gi")) * 2**30 // (int(limits["cpu"]) + SPARE)
    assert int(config["CIRIS_PAIR_MEMORY_BYTES"]) == part, "whichever pod decides about a job, a solve pod does its pairs"
    assert not any(document["kind"] == "Secret" for document in DOCUMENTS)
    for container in CONTAINERS.values():
        for entry in container.get("env", []):
            if "PASSWORD" in entry["name"]:
                assert set(entry["valueFrom"]) == {"secretKeyRef"}
    addresses = [text for text in texts(DOCUMENTS) if "://" in text]
    assert addresses
    assert all("@" not in text or re.search(r":\$\((POSTGRES|VALKEY)_PASSWORD\)@", text) for text in addresses)
    assert all("@" in text for text in addresses if "valkey" in text or "postgres" in text), "both ask for a password"


def test_the_example_of_a_scaler_fits_its_schema() -> None:
    blocks = re.findall(r"```yaml\n(.*?)```", (ROOT / "docs" / "operations.md").read_text(), re.DOTALL)
    scalers = {d["kind"]: d for block in blocks for d in yaml.safe_load_all(block) if "kind" in d}
    assert set(scalers) == {"ScaledObject", "HorizontalPodAutoscaler"}
    kubernetes_validate.validate(scalers["HorizontalPodAutoscaler"], SCHEMAS, strict=True)
    assert {scaler["spec"]["scaleTargetRef"]["name"] for scaler in scalers.values()} == {"solve"}
    assert all("ciris_workers_wanted" in " ".join(texts(scaler)) for scaler in scalers.values())
