"""Production on this machine: what was deployed, how a run goes, what a person sees of it."""

from __future__ import annotations

import json
import shutil
import subprocess
from urllib.error import HTTPError

import numpy as np
import pytest
from PIL import Image

from flows.production.postgresql import PostgreSQL
from flows.production.site import Database, Site
from tests.e2e.production import database, site_command

pytestmark = pytest.mark.e2e

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
def test_the_page_of_a_run_is_a_picture_that_is_not_blank(deployed, first_run, tmp_path):
    run, _ = first_run
    picture = tmp_path / "run.png"
    page = deployed.url.removesuffix("/api") + f"/runs/flow-run/{run}?tab=Artifacts"
    places = (f"--user-data-dir={tmp_path / 'profile'}", f"--screenshot={picture}")
    words = [CHROMIUM, *HEADLESS, *places, page]
    subprocess.run(words, check=True, capture_output=True, timeout=120.0)
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


def test_what_runs_without_a_heartbeat_is_watched(deployed):
    [automation] = deployed.ask("/automations/filter", {})
    assert automation["enabled"]
    assert automation["actions"][0]["state"] == "CRASHED"


def test_up_again_changes_nothing_that_runs(deployed):
    def processes():
        return {file.name: file.read_text() for file in deployed.site.folder.glob("*.pid")}

    before = processes()
    assert {"server.pid", "worker.pid"} <= before.keys()
    said = site_command(deployed, deployed.site, "up")
    assert processes() == before
    assert deployed.url in said


@pytest.mark.skipif(database() != Database.POSTGRESQL, reason="PostgreSQL is not installed")
def test_the_database_is_asked_for_its_password(deployed):
    url = PostgreSQL(deployed.site).url.removeprefix("postgresql+asyncpg://")
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
        site_command(deployed, other, "up")
