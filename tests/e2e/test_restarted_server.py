"""The server, or its database, is started again while a run works: the run completes."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path

import pytest

from mocoflow_core.io.run_folder import read_run
from tests.e2e import database as postgres
from tests.e2e.services import ENDED, services, until

pytestmark = pytest.mark.faults

# Long enough that the optimisation outlives the restart on any machine.
LONG = ["person_scores.use=off", "evaluation.frames_per_camera=1"]


SLOTS = "gpu"


def start(parts, scene, root, **parameters):
    return parts.made.start(
        "mocoflow/full",
        **{"scene": str(scene), "out": str(root / "run"), "store": str(root / "store")},
        preset="toy",
        settings=[*LONG, "schedule.longest=1000"],
        **{"budget_s": 90.0, **parameters},
    )


def optimises(root):
    return any((root / "store").glob("optimise_scene/*.partial/checkpoint.safetensors"))


def taken(parts):
    return parts.made.ask(f"/v2/concurrency_limits/{SLOTS}")["active_slots"]


def test_a_run_goes_on_while_the_server_is_killed_and_started_again(scene, tmp_path):
    with services(tmp_path) as parts:
        run = start(parts, scene, tmp_path)
        until(lambda: optimises(tmp_path), 300.0, "the optimisation works")
        parts.server.kill()
        time.sleep(10.0)
        assert optimises(tmp_path), "the run did not outlive the server"
        parts.start_server()
        assert parts.made.wait(run, *ENDED, within_s=400.0) == "COMPLETED", parts.made.logs(run)
        assert read_run(tmp_path / "run").stage("optimise_scene").wall_s > 10.0


def test_a_run_outlives_a_server_that_has_taken_it_for_dead_and_gives_back_its_slot(
    scene, tmp_path
):
    """Away for longer than the automation waits for a heartbeat, and than a slot is leased for."""
    with services(tmp_path, silent_s=45) as parts:
        parts.made.prefect("gcl", "create", SLOTS, "--limit", "1")
        run = start(parts, scene, tmp_path, slots=SLOTS, budget_s=150.0)
        until(lambda: optimises(tmp_path), 300.0, "the optimisation works")
        assert taken(parts) == 1
        parts.server.kill()
        time.sleep(75.0)
        parts.start_server()
        # It may be shown as Crashed until it ends.
        assert parts.made.wait(run, "COMPLETED", within_s=400.0), parts.made.logs(run)
        assert read_run(tmp_path / "run").finished
        until(lambda: taken(parts) == 0, 120.0, "the slot is free")


def test_a_run_whose_machine_has_died_is_shown_as_crashed(scene, tmp_path):
    with services(tmp_path, silent_s=45) as parts:
        run = start(parts, scene, tmp_path)
        until(lambda: optimises(tmp_path), 300.0, "the optimisation works")
        parts.worker.kill()
        assert parts.made.state(run) == "RUNNING"
        assert parts.made.wait(run, *ENDED, within_s=200.0) == "CRASHED"


@pytest.mark.skipif(bool(postgres.missing()), reason=postgres.missing())
def test_a_run_goes_on_while_the_database_is_stopped_and_started_again(scene, tmp_path):
    # Beside the tests' folders, which the database's owner cannot enter.
    with (
        tempfile.TemporaryDirectory(prefix="mocoflow-postgres-") as place,
        postgres.database(_open(Path(place)) / "postgres") as database,
        services(tmp_path, database.url) as parts,
    ):
        run = start(parts, scene, tmp_path)
        until(lambda: optimises(tmp_path), 300.0, "the optimisation works")
        database.stop()
        time.sleep(10.0)
        assert optimises(tmp_path), "the run did not outlive the database"
        database.start()
        assert parts.made.wait(run, *ENDED, within_s=400.0) == "COMPLETED", parts.made.logs(run)
        assert read_run(tmp_path / "run").finished


def _open(folder: Path) -> Path:
    folder.chmod(0o755)
    return folder
