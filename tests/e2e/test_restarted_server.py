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


def start(parts, scene, root):
    return parts.made.start(
        "mocoflow/full",
        **{"scene": str(scene), "out": str(root / "run"), "store": str(root / "store")},
        preset="toy",
        budget_s=90.0,
        settings=[*LONG, "schedule.longest=1000"],
    )


def optimises(root):
    return any((root / "store").glob("optimise_scene/*.partial/checkpoint.safetensors"))


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
