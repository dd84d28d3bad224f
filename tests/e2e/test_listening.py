"""Nothing that a person starts at a desk listens to anybody else."""

from __future__ import annotations

import os
import subprocess
import sys
import time

import pytest

from flows.production.site import Database
from tests.e2e.dask_cluster import ROOT, cluster
from tests.e2e.services import ENDED
from tests.e2e.sockets import beyond_loopback, listening

pytestmark = pytest.mark.cluster

MAIN = "from flows.command_line import main; main()"


def heard_while(words: list[str], environment: dict[str, str]) -> set[str]:
    """Every address that a command listens at, from its start to its end."""
    process = subprocess.Popen(
        [sys.executable, "-c", MAIN, *words],
        cwd=ROOT,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    found: set[str] = set()
    try:
        while process.poll() is None:
            found |= listening(process.pid)
            time.sleep(0.2)
        said, _ = process.communicate()
    finally:
        process.kill()
    assert process.returncode == 0, said
    return found


@pytest.fixture
def environment(tmp_path):
    """No server: the command starts its own, as at a desk."""
    kept = {name: value for name, value in os.environ.items() if name != "PREFECT_API_URL"}
    return kept | {"PREFECT_HOME": str(tmp_path / "prefect"), "OMP_NUM_THREADS": "1"}


@pytest.mark.parametrize("command", ["reconstruct", "benchmark"])
def test_a_command_listens_on_loopback_alone(command, scene, environment, tmp_path):
    places = ["--out", str(tmp_path / "out"), "--store", str(tmp_path / "store")]
    words = {
        "reconstruct": [str(scene), "--preset", "toy", "--devices", "2"],
        "benchmark": [
            *("--scenes", str(scene), "--methods", "mocoflow", "--presets", "toy"),
            *("--seeds", "2", "--workers", "2"),
        ],
    }
    found = heard_while([command, *words[command], *places], environment)
    assert found  # Prefect's server for as long as the command lasts.
    assert beyond_loopback(found) == set()


def test_a_site_and_its_runs_listen_on_loopback_alone(deployed, scene, tmp_path):
    begun = deployed.start(
        "mocoflow/full",
        **{"scene": str(scene), "out": str(tmp_path / "run"), "store": str(tmp_path / "store")},
        preset="toy",
        settings=["person_scores.use=off"],
    )
    files = list(deployed.site.folder.rglob("*.pid"))
    found: dict[str, set[str]] = {file.name: set() for file in files}
    while deployed.state(begun) not in ENDED:
        for file in files:
            found[file.name] |= listening(int(file.read_text().split()[0]))
    assert deployed.state(begun) == "COMPLETED", deployed.logs(begun)
    assert found["server.pid"]
    if deployed.site.database == Database.POSTGRESQL:
        assert found["postmaster.pid"]
    assert beyond_loopback(set().union(*found.values())) == set()


def test_a_dask_cluster_as_the_documentation_starts_it_does_too(environment, tmp_path):
    with cluster(tmp_path, environment) as made:
        found = {name: listening(process.pid) for name, process in made.processes.items()}
    assert all(found.values())
    assert beyond_loopback(set().union(*found.values())) == set()
