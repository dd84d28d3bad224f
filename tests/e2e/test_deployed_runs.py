"""Runs that a real server schedules and a real worker executes."""

from __future__ import annotations

import time
from contextlib import suppress
from pathlib import Path

import pytest

pytestmark = pytest.mark.e2e

ENDED = ("COMPLETED", "FAILED", "CRASHED", "CANCELLED")


def working_on(folder: Path) -> list[str]:
    """Command lines of all processes that name something in a folder."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            words = (process / "cmdline").read_text().replace("\0", " ")
            if str(folder) in words:
                found.append(words)
    return found


def test_cancelling_a_run_on_two_devices_leaves_no_process(deployed, scene, tmp_path):
    store, out = tmp_path / "store", tmp_path / "run"
    run = deployed.start(
        "mocoflow/full",
        scene=str(scene),
        out=str(out),
        preset="toy",
        devices=2,
        settings=["schedule.coarse_steps=100000"],
        store=str(store),
    )
    deployed.wait(run, "RUNNING", *ENDED, within_s=120.0)
    end = time.monotonic() + 180.0
    # The launcher and both ranks name the job's file.
    while len(working_on(store)) < 3:
        assert deployed.state(run) == "RUNNING"
        assert time.monotonic() < end
        time.sleep(0.2)
    deployed.cancel(run)
    assert deployed.wait(run, *ENDED, within_s=120.0) == "CANCELLED"
    end = time.monotonic() + 30.0
    while working_on(store) and time.monotonic() < end:
        time.sleep(0.2)
    assert working_on(store) == []
    assert not (out / "report.html").exists()


def test_one_cell_of_a_deployed_benchmark_is_cancelled_and_the_other_finishes(
    deployed, scene, tmp_path
):
    out = tmp_path / "benchmark"
    run = deployed.start(
        "benchmark/synthetic",
        scenes=[str(scene)],
        methods=["mocoflow"],
        presets=["toy"],
        seeds=2,
        settings=["schedule.rays=63"],
        out=str(out),
        store=str(tmp_path / "store"),
        afresh=False,
    )
    name, end = "toy/toy/mocoflow/0", time.monotonic() + 180.0
    while deployed.runs().get(name, {"state_type": ""})["state_type"] != "RUNNING":
        assert deployed.state(run) in ("SCHEDULED", "PENDING", "RUNNING")
        assert time.monotonic() < end
        time.sleep(0.05)
    deployed.cancel(deployed.runs()[name]["id"])
    assert deployed.wait(run, *ENDED, within_s=240.0) == "COMPLETED"
    states = {name: cell["state_type"] for name, cell in deployed.runs().items()}
    assert states[name] == "CANCELLED"
    assert states["toy/toy/mocoflow/1"] == "COMPLETED"
    assert "cancelled" in (out / "benchmark.html").read_text()
