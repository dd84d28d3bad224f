"""The commands and health checks of docker-compose.yml, by hand where no container engine runs.

Their words and environment are the file's own; only hosts, ports and folders are this machine's.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import urlopen

import pytest
import s3fs
import yaml

from flows.production.api import admits, answers, ask, wait_for
from flows.production.postgresql import PostgreSQL, find_programs
from flows.production.processes import heed_interrupts
from flows.production.site import AUTHENTICATION, Database, Site
from tests.e2e.production import ROOT, available_database
from tests.free_port import free_port

pytestmark = [
    pytest.mark.e2e,
    pytest.mark.skipif(
        available_database() != Database.POSTGRESQL, reason="PostgreSQL is not installed"
    ),
]
SERVICES = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]
SECRET = "somebody:a secret, with / and @"


class Here:
    """This machine in place of the containers."""

    def __init__(self, folder: Path, database_url: str) -> None:
        user, _, place = database_url.partition("://")[2].rpartition("@")
        self.port, self.health, self.storage = free_port(), free_port(), free_port()
        self.api = f"http://127.0.0.1:{self.port}/api"
        self.folder = folder
        self.given = {
            AUTHENTICATION: SECRET,
            "MOCOFLOW_DATABASE_PASSWORD": user.partition(":")[2],
            "MOCOFLOW_STORAGE_SECRET": "another secret",
            "MOCOFLOW_PAGES": "https://pages.example.org",
        }
        address, _, name = place.partition("/")
        self.places = {
            "PREFECT_SERVER_DATABASE_HOST": address.partition(":")[0],
            "PREFECT_SERVER_DATABASE_PORT": address.partition(":")[2],
            "PREFECT_SERVER_DATABASE_NAME": name,
            "PREFECT_API_URL": self.api,
            "PREFECT_WORKER_WEBSERVER_PORT": str(self.health),
            "AWS_ENDPOINT_URL": f"http://127.0.0.1:{self.storage}",
            "MOCOFLOW_DATA_ROOTS": str(folder),
            "MOCOFLOW_RESULTS_ROOT": str(folder),
        }

    def environment(self, service: str) -> dict[str, str]:
        """The service's own, filled in as the container engine does, and nothing else of ours."""

        def filled(value: str) -> str:
            variable = r"\$\{([A-Z_]+):(?:-|\?[^}]*)([^}]*)\}"
            return re.sub(variable, lambda m: self.given.get(m[1], m[2]), value)

        asked = {name: filled(value) for name, value in SERVICES[service]["environment"].items()}
        kept = ("PATH", "PYTHONPATH", "HOME")
        base = {name: os.environ[name] for name in kept if name in os.environ}
        base["XDG_STATE_HOME"] = str(self.folder / "state")  # As the image's own.
        base["PYTHONPATH"] = os.pathsep.join((str(ROOT), base.get("PYTHONPATH", "")))
        base["PREFECT_HOME"] = str(self.folder / "state" / service)
        return base | asked | {n: v for n, v in self.places.items() if n in asked}

    def command(self, words: list[str]) -> list[str]:
        rclone = str(Path(sys.executable).with_name("rclone"))
        programs = {
            "prefect": [sys.executable, "-m", "prefect"],
            "python": [sys.executable],
            "rclone": [rclone],
            "serve": [rclone, "serve"],  # its image's entry point is the program
        }
        here = {
            "0.0.0.0": "127.0.0.1",
            "4200": str(self.port),
            ":7070": f"127.0.0.1:{self.storage}",
            "/storage": str(self.folder / "storage"),
        }
        return programs[words[0]] + [here.get(word, word) for word in words[1:]]

    def is_healthy(self, service: str) -> bool:
        """What the container engine asks now and then."""
        kind, *words = SERVICES[service]["healthcheck"]["test"]
        assert kind == "CMD"
        words = [w.replace(":4200/", f":{self.port}/") for w in words]
        words = [w.replace(":8080/", f":{self.health}/") for w in words]
        words = [w.replace(":7070", f":{self.storage}") for w in words]
        asked = self.environment(service)
        return subprocess.run(self.command(words), env=asked, capture_output=True).returncode == 0


@pytest.fixture(scope="module")
def here():
    folder = Path(tempfile.mkdtemp(prefix="mocoflow-compose-"))
    folder.chmod(0o755)
    site = Site(folder, database=Database.POSTGRESQL)
    site.logs.mkdir()
    cluster = PostgreSQL(site)
    try:
        yield Here(folder, cluster.start())
    finally:
        cluster.stop()
        shutil.rmtree(folder)


@contextmanager
def running(here, service):
    """A service from its start to its end, which is in its grace."""
    words = here.command(SERVICES[service]["command"])
    grace_s = float(SERVICES[service]["stop_grace_period"].removesuffix("s"))
    log = here.folder / f"{service}.log"
    heed_interrupts()
    with log.open("wb") as output:
        process = subprocess.Popen(
            words, env=here.environment(service), stdout=output, stderr=output, cwd=here.folder
        )
    try:
        assert wait_for(lambda: here.is_healthy(service), 180.0), log.read_text()
        yield
    finally:
        process.terminate()
        process.wait(grace_s)


@pytest.fixture(scope="module")
def server(here):
    with running(here, "server"):
        yield here


def test_the_database_is_healthy_where_it_answers_and_only_there(here):
    kind, line = SERVICES["database"]["healthcheck"]["test"]
    assert kind == "CMD-SHELL"
    path = f"{find_programs()}{os.pathsep}{os.environ['PATH']}"

    def is_healthy(port: str) -> bool:
        asked = {"PATH": path, "PGPORT": port}
        return subprocess.run(line, shell=True, env=asked, capture_output=True).returncode == 0

    assert is_healthy(here.places["PREFECT_SERVER_DATABASE_PORT"])
    assert not is_healthy(str(free_port()))


def test_the_server_answers_nobody_without_the_password(server, monkeypatch):
    monkeypatch.delenv(AUTHENTICATION, raising=False)
    with pytest.raises(HTTPError, match="401"):
        ask(server.api, "/flows/filter", {})
    monkeypatch.setenv(AUTHENTICATION, SECRET)
    assert ask(server.api, "/flows/filter", {}) == []


def test_whether_the_database_answers_is_told_without_the_password(server, monkeypatch):
    monkeypatch.delenv(AUTHENTICATION, raising=False)
    assert answers(server.api)
    assert admits(server.api, SECRET)
    assert not admits(server.api, None)
    assert not admits(server.api, "somebody:a guess")


def test_the_pages_ask_the_api_where_their_address_says(server):
    with urlopen(server.api.removesuffix("/api") + "/ui-settings") as answer:
        assert json.load(answer)["api_url"] == "https://pages.example.org/api"


@pytest.fixture(scope="module")
def storage(here):
    with running(here, "storage"):
        yield here


def bucket(here, secret):
    """The store's bucket as somebody with this password sees it."""
    endpoint = here.places["AWS_ENDPOINT_URL"]
    return s3fs.S3FileSystem(
        key="mocoflow", secret=secret, endpoint_url=endpoint, skip_instance_cache=True
    )


def test_the_object_store_wants_its_password(storage):
    with pytest.raises(PermissionError):
        bucket(storage, "a guess").ls("")
    assert bucket(storage, storage.given["MOCOFLOW_STORAGE_SECRET"]).ls("") == []


def test_deployments_are_made_and_workers_take_their_runs(server, storage, monkeypatch):
    monkeypatch.setenv(AUTHENTICATION, SECRET)
    done = subprocess.run(
        server.command(SERVICES["deployments"]["command"]),
        env=server.environment("deployments"),
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "set MOCOFLOW_AIST_ROOT and deploy again" in done.stdout
    kept = bucket(storage, storage.given["MOCOFLOW_STORAGE_SECRET"])
    assert kept.ls("") == ["mocoflow"]
    assert len(ask(server.api, "/deployments/filter", {})) == 7
    for name in ("cpu", "gpu"):
        with running(server, f"worker-{name}"):
            assert wait_for(lambda name=name: name in online(server), 60.0)


def online(here):
    workers = ask(here.api, "/work_pools/mocoflow/workers/filter", {})
    return [worker["name"] for worker in workers if worker["status"] == "ONLINE"]
