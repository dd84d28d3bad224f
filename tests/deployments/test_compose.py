"""What docker-compose.yml promises: no root, no default password, no port beyond loopback."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from flows.production.site import LEASES, LEASES_IN_FILES
from flows.user_folders import body_models_folder

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docker-compose.yml").read_text()
COMPOSE = yaml.safe_load(TEXT)
SERVICES = COMPOSE["services"]
DOCKERFILE = (ROOT / "deployments" / "Dockerfile").read_text()
ONE_SHOT = ("folders", "deployments")
services = pytest.mark.parametrize("name", SERVICES)
long_lived = pytest.mark.parametrize("name", [name for name in SERVICES if name not in ONE_SHOT])


def is_ours(service):
    return "build" in service


def test_the_file_is_one_by_compose_s_own_schema():
    words = ["check-jsonschema", "--builtin-schema", "vendor.compose-spec"]
    program = Path(sys.executable).with_name(words[0])
    done = subprocess.run(
        [program, *words[1:], ROOT / "docker-compose.yml"], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout


@services
def test_a_service_does_not_run_as_root(name):
    service = SERVICES[name]
    if is_ours(service):
        assert re.findall(r"^USER (.+)$", DOCKERFILE, re.MULTILINE)[-1] == "mocoflow"
        assert "user" not in service
    else:
        assert service["user"] not in ("root", "0", "0:0")


@services
def test_a_port_is_published_on_loopback_alone(name):
    for port in SERVICES[name].get("ports", []):
        assert port.startswith("127.0.0.1:")


@services
def test_a_password_comes_from_the_environment_and_has_no_default(name):
    secret = re.compile("PASSWORD|SECRET|AUTH")
    for variable, value in SERVICES[name].get("environment", {}).items():
        if secret.search(variable):
            # The object store's stands behind its user's name.
            bare = value.removeprefix('"mocoflow,').removesuffix('"')
            assert re.fullmatch(r"\$\{[A-Z_]+:\?[^}]+\}", bare), (variable, value)


@services
def test_a_variable_is_required_or_has_a_harmless_default(name):
    harmless = ("", "./data", "./body_models", "http://127.0.0.1:4200")
    used = re.findall(r"\$\{([A-Z_]+)(:[?-])([^}]*)\}", yaml.dump(SERVICES[name], width=10_000))
    for variable, kind, default in used:
        assert kind == ":?" or default in harmless, variable


@long_lived
def test_a_service_is_watched_started_again_and_given_time_to_end(name):
    service = SERVICES[name]
    assert service["healthcheck"]["test"][0] in ("CMD", "CMD-SHELL")
    assert service["healthcheck"]["retries"] >= 3
    assert service["restart"] == "unless-stopped"
    assert int(service["stop_grace_period"].removesuffix("s")) >= 30


@services
def test_a_service_waits_for_services_that_can_become_what_it_waits_for(name):
    for other, how in SERVICES[name].get("depends_on", {}).items():
        ends = how["condition"] == "service_completed_successfully"
        assert (other in ONE_SHOT) == ends
        assert ends or "healthcheck" in SERVICES[other]


@services
def test_what_is_kept_lies_in_named_volumes_and_what_users_give_cannot_be_changed(name):
    for volume in SERVICES[name].get("volumes", []):
        if volume.endswith(":ro"):
            assert volume.startswith("${MOCOFLOW_")
            continue
        source, _, target = volume.partition(":")
        assert source in COMPOSE["volumes"], volume
        assert target.startswith("/")


@pytest.mark.parametrize("name", ["worker-cpu", "worker-gpu"])
def test_body_models_are_mounted_where_runs_look_for_them(name, monkeypatch):
    worker = SERVICES[name]
    monkeypatch.setenv("XDG_DATA_HOME", worker["environment"]["XDG_DATA_HOME"])
    assert f"{body_models_folder()}:ro" in [v.partition("}:")[2] for v in worker["volumes"]]


def test_deployments_are_made_where_the_data_sets_can_be_seen():
    assert SERVICES["deployments"]["volumes"][0] == SERVICES["worker-cpu"]["volumes"][0]


def test_the_health_of_the_server_and_the_database_is_that_of_the_whole():
    assert "/api/ready" in SERVICES["server"]["healthcheck"]["test"][-1]
    assert "--host 127.0.0.1" in SERVICES["database"]["healthcheck"]["test"][-1]


@pytest.mark.parametrize("name", [n for n, service in SERVICES.items() if is_ours(service)])
def test_our_containers_can_gain_no_rights(name):
    assert SERVICES[name]["cap_drop"] == ["ALL"]
    assert SERVICES[name]["security_opt"] == ["no-new-privileges:true"]


def test_the_folders_of_volumes_are_made_for_the_user_that_the_store_runs_as():
    owned = re.search(r"install --directory .*", DOCKERFILE).group().split()
    mounted = [volume.partition(":")[2] for volume in SERVICES["folders"]["volumes"]]
    assert set(mounted) <= set(owned)
    assert f"--uid {SERVICES['storage']['user'].partition(':')[0]} " in DOCKERFILE


def test_workers_are_chosen_by_profile_and_only_one_asks_for_gpus():
    profiles = {name: service.get("profiles") for name, service in SERVICES.items()}
    chosen = {name: profile for name, profile in profiles.items() if profile}
    assert chosen == {"worker-cpu": ["cpu"], "worker-gpu": ["gpu"]}
    with_devices = [name for name, service in SERVICES.items() if "deploy" in service]
    assert with_devices == ["worker-gpu"]


def test_what_the_image_is_made_of_is_sent_to_the_builder():
    copied = re.findall(r"^COPY (.+) \S+$", DOCKERFILE, re.MULTILINE)
    sent = (ROOT / ".dockerignore").read_text().splitlines()
    for name in " ".join(copied).split():
        assert f"!{name}" in sent
        assert (ROOT / name).exists()


def test_slots_that_runs_hold_outlive_the_server():
    server = SERVICES["server"]
    assert server["environment"][LEASES] == LEASES_IN_FILES
    home = re.search(r"PREFECT_HOME=(\S+)", DOCKERFILE)[1]
    assert any(home.startswith(volume.partition(":")[2]) for volume in server["volumes"])
