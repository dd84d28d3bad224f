"""Production on this machine: what was deployed, how a run goes, what a person sees of it."""

from __future__ import annotations

import json
import shutil
import subprocess
import time
from datetime import UTC, datetime
from pathlib import Path
from urllib.error import HTTPError
from uuid import uuid4

import numpy as np
import pytest
import yaml
from PIL import Image

from flows.production.api import ask
from flows.production.postgresql import PostgreSQL
from flows.production.settings import FILE, KEPT
from flows.production.site import Database, Site
from tests.e2e.production import ROOT, UNNEEDED, available_database, new, site_command

pytestmark = pytest.mark.e2e

WITHIN_S = 10.0
CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
HEADLESS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--window-size=1400,1000", "--virtual-time-budget=15000"),
)


def run_fast(deployed, scene, out):
    """``prefect deployment run mocoflow/fast --watch``; the run's id."""
    deployed.prefect(
        *("deployment", "run", "mocoflow/fast", "--watch"),
        *("-p", f"scene={scene}", "-p", f"out={out}", "-p", "preset=toy"),
        wait_s=300.0,
    )
    [run] = [r["id"] for r in deployed.runs().values() if r["parameters"].get("out") == str(out)]
    return run


@pytest.fixture(scope="module")
def first_run(deployed, scene, tmp_path_factory):
    """A run of mocoflow/fast: its id and what it has left."""
    out = tmp_path_factory.mktemp("runs") / "first"
    return run_fast(deployed, scene, out), out


@pytest.mark.skipif(
    available_database() != Database.POSTGRESQL, reason="PostgreSQL is not installed: on SQLite"
)
def test_the_site_is_on_postgresql_as_in_production(deployed):
    assert deployed.site.database == Database.POSTGRESQL


def test_a_deployed_run_completes_and_shows_what_it_found(deployed, first_run):
    run, out = first_run
    assert deployed.state(run) == "COMPLETED"
    assert (out / "report.html").stat().st_size > 0
    shown = deployed.artifacts(run)
    assert {"plan", "error-curve", "scores", "report"} <= shown.keys(), sorted(shown)
    assert (out / "report.html").as_uri() in shown["report"]
    assert "data:image/png;base64," in shown["error-curve"]
    assert "psnr_union" in shown["scores"]
    assert "optimise_scene took" in deployed.logs(run)


def test_the_same_run_again_finds_all_its_stages(deployed, first_run, scene, tmp_path):
    first, _ = first_run
    again = run_fast(deployed, scene, tmp_path / "again")
    stages = json.loads((tmp_path / "again" / "run.json").read_text())["stages"]
    assert len(stages) > 8
    assert all(stage["cached"] for stage in stages)
    assert set(deployed.tasks(again).values()) == {"Cached"}
    assert deployed.tasks(first).keys() == deployed.tasks(again).keys()
    assert "Completed" in deployed.tasks(first).values()


@pytest.mark.skipif(CHROMIUM is None, reason="no chromium or google-chrome is installed")
def test_the_page_of_a_run_has_its_name_and_is_not_blank(deployed, first_run, tmp_path):
    run, _ = first_run
    picture = tmp_path / "run.png"
    page = deployed.url.removesuffix("/api") + f"/runs/flow-run/{run}?tab=Artifacts"

    def browse(option):
        words = [CHROMIUM, *HEADLESS, f"--user-data-dir={tmp_path / 'profile'}", option, page]
        done = subprocess.run(words, check=True, capture_output=True, text=True, timeout=120.0)
        return done.stdout

    assert deployed.ask(f"/flow_runs/{run}")["name"] in browse("--dump-dom")
    browse(f"--screenshot={picture}")
    with Image.open(picture) as opened:
        pixels = np.asarray(opened.convert("RGB")).reshape(-1, 3)
    assert len(pixels) == 1400 * 1000
    colours, counts = np.unique(pixels, axis=0, return_counts=True)
    assert len(colours) > 100
    assert counts.max() < 0.97 * len(pixels)


def test_parameters_out_of_bounds_are_refused_before_there_is_a_run(deployed, scene):
    before = set(deployed.runs())
    with pytest.raises(AssertionError) as refused:
        deployed.prefect("deployment", "run", "mocoflow/full", "-p", "preset=turbo")
    assert "'turbo' is not one of" in " ".join(str(refused.value).split())
    for wrong in ({"seed": -1}, {"devices": 0}, {"budget_s": 0}, {"scene": 7}):
        with pytest.raises(HTTPError, match="409"):
            deployed.start("mocoflow/full", **wrong)
    assert set(deployed.runs()) == before


def test_a_run_that_would_leave_its_roots_fails_and_names_them(deployed, scene):
    runs = {
        "scene": deployed.start("mocoflow/fast", scene="/etc"),
        "out": deployed.start("mocoflow/fast", scene=str(scene), out="/etc/run"),
    }
    roots = deployed.environment["MOCOFLOW_DATA_ROOTS"]
    for parameter, run in runs.items():
        assert deployed.wait(run, "COMPLETED", "FAILED", "CRASHED", within_s=120.0) == "FAILED"
        told = deployed.ask(f"/flow_runs/{run}")["state"]["message"]
        assert f"{parameter} must lie below {roots}" in told


def test_schedules_make_runs_and_those_of_data_sets_wait_for_their_roots(deployed):
    def scheduled():
        wanted = {"flow_runs": {"state": {"type": {"any_": ["SCHEDULED"]}}}, "limit": 200}
        runs = deployed.ask("/flow_runs/filter", wanted)
        return {run["deployment_id"] for run in runs if run["auto_scheduled"]}

    def id_of(name):
        return deployed.ask(f"/deployments/name/{name}")["id"]

    names = {id_of(name): name for name in ("stability/nightly", "benchmark/aist")}
    deployed.until(lambda: any(names.get(i) == "stability/nightly" for i in scheduled()), 120.0)
    assert "benchmark/aist" not in {names.get(i) for i in scheduled()}
    for name in ("aist", "zju-mocap", "people-snapshot"):
        found = deployed.ask(f"/deployments/name/benchmark/{name}")
        assert [schedule["active"] for schedule in found["schedules"]] == [False]
        variable = f"MOCOFLOW_{name.upper().replace('-', '_')}_ROOT"
        assert variable in found["description"]


@pytest.fixture
def watched(deployed):
    """Beside the automation of heartbeats, which is there, one that waits only ten seconds."""
    zombies = yaml.safe_load((ROOT / "deployments" / "zombies.yaml").read_text())
    named = {"automations": {"name": {"any_": [zombies["name"]]}}}
    [automation] = deployed.ask("/automations/filter", named)
    assert automation["enabled"]
    zombies["name"] = "at-once"
    zombies["trigger"]["within"] = WITHIN_S
    made = deployed.ask("/automations/", zombies)
    yield
    ask(deployed.url, f"/automations/{made['id']}", method="DELETE")


def test_a_run_whose_heartbeats_stop_is_crashed_and_one_that_goes_on_is_not(deployed, watched):
    def start():
        flow = deployed.ask("/flows/", {"name": "by-hand"})
        run = {"flow_id": flow["id"], "state": {"type": "RUNNING"}}
        return deployed.ask("/flow_runs/", run)["id"]

    def heartbeat(run):
        event = {
            "id": str(uuid4()),
            "occurred": datetime.now(UTC).isoformat(),
            "event": "prefect.flow-run.heartbeat",
            "resource": {"prefect.resource.id": f"prefect.flow-run.{run}"},
        }
        deployed.ask("/events", [event])

    stops, goes_on = start(), start()
    heartbeat(stops)
    end = time.monotonic() + 6 * WITHIN_S
    while deployed.state(stops) == "RUNNING" and time.monotonic() < end:
        heartbeat(goes_on)
        time.sleep(1.0)
    assert deployed.state(stops) == "CRASHED"
    assert deployed.state(goes_on) == "RUNNING"
    deployed.ask(f"/flow_runs/{goes_on}/set_state", {"state": {"type": "COMPLETED"}})


@pytest.mark.parametrize("variable", ["env", "command", "working_dir"])
def test_who_starts_a_run_cannot_change_its_process(variable, deployed):
    value = {"env": '{"MOCOFLOW_DATA_ROOTS": ""}', "command": "id", "working_dir": "/etc"}
    asked = ("--job-variable", f"{variable}={value[variable]}")
    with pytest.raises(AssertionError) as refused:
        deployed.prefect("deployment", "run", "mocoflow/fast", *asked)
    assert f"('{variable}' was unexpected)" in " ".join(str(refused.value).split())


def test_what_it_was_told_is_kept_for_its_owner_and_without_passwords(deployed):
    noted = deployed.site.folder / FILE
    assert noted.stat().st_mode & 0o077 == 0
    assert "MOCOFLOW_DATA_ROOTS" in noted.read_text()
    assert UNNEEDED not in noted.read_text()
    assert set(json.loads(noted.read_text())) <= set(KEPT)


def test_up_again_changes_nothing_that_runs(deployed):
    def processes():
        return {file.name: file.read_text() for file in deployed.site.folder.glob("*.pid")}

    before = processes()
    assert {"server.pid", "worker.pid"} <= before.keys()
    said = site_command(deployed, deployed.site, "up")
    assert processes() == before
    assert deployed.url in said


@pytest.fixture
def cluster(deployed):
    if deployed.site.database != Database.POSTGRESQL:
        pytest.skip("PostgreSQL is not installed")
    return PostgreSQL(deployed.site)


@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="environments are not shown")
def test_the_database_sees_none_of_the_passwords_of_who_started_it(cluster):
    process = (cluster.data / "postmaster.pid").read_text().split()[0]
    seen = Path(f"/proc/{process}/environ").read_text().split("\0")
    assert any(variable.startswith("PATH=") for variable in seen)
    assert not [variable for variable in seen if variable.startswith((UNNEEDED, "PREFECT_"))]


def test_the_database_is_asked_for_its_password(cluster):
    url = cluster.url.removeprefix("postgresql+asyncpg://")
    address, name = url.partition("@")[2].split("/")
    host, port = address.split(":")
    psql = shutil.which("psql") or pytest.skip("no psql")
    words = [psql, "-w", "-h", host, "-p", port, "-U", "prefect", "-d", name, "-c", "select 1"]
    refused = subprocess.run(words, capture_output=True, text=True)
    assert refused.returncode != 0
    assert "password" in refused.stderr


def test_another_site_on_a_taken_port_is_refused(deployed, tmp_path):
    other = Site(tmp_path / "other", deployed.site.port)
    with pytest.raises(AssertionError, match="a free port for the server"):
        site_command(deployed, other, "up", *new(other))
